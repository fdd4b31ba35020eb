"""Acrobot: Gymnasium, inputs, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.systems import Acrobot


@jax.jit
def accelerations(system, q, v, u):
    p = system.mass_matrix(q) @ v
    motion = (jnp.concatenate(system.vector_field(q, p, u)),)
    return jax.jvp(lambda state: system.decode(state)[1], (jnp.concatenate([q, p]),), motion)[1]


pairs = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))


@given(angles=pairs, rates=pairs, torque=st.floats(-2.0, 2.0))
def test_it_accelerates_as_gymnasiums_does(angles, rates, torque):
    gymnasium = pytest.importorskip("gymnasium")
    simulator = gymnasium.make("Acrobot-v1").unwrapped
    theirs = simulator._dsdt(np.array([*angles, *rates, torque]))[2:4]
    ours = accelerations(Acrobot(), jnp.array(angles), jnp.array(rates), jnp.array([torque]))
    assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9)


def test_torques_act_at_their_joints():
    q = jnp.array([0.1, 0.2])
    assert Acrobot().input_matrix(q).tolist() == [[0.0], [1.0]]
    assert Acrobot(fully_actuated=True).input_matrix(q).tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert (Acrobot().inputs, Acrobot(fully_actuated=True).inputs) == (1, 2)
    assert str(Acrobot().space) == "T2"


@pytest.mark.parametrize("name", ["masses", "lengths", "centres", "inertias"])
def test_sizes_must_be_positive(name):
    with pytest.raises(ValueError, match=rf"`{name}\[1\]` must be positive; got 0"):
        dataclasses.replace(Acrobot(), **{name: (1.0, 0.0)})


@pytest.mark.parametrize(("name", "value"), [("gravity", -1.0), ("dampings", (-1.0, 0.0))])
def test_friction_and_gravity_must_not_be_negative(name, value):
    with pytest.raises(ValueError, match=rf"`{name}.*` must be at least 0; got -1.0"):
        dataclasses.replace(Acrobot(), **{name: value})
