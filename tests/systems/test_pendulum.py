"""Pendulum: the paper's numbers, Gymnasium, refusals."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.systems import Pendulum


def test_the_papers_pendulum_has_the_papers_numbers():
    system, q = Pendulum(gravity=10.0, damping=0.1), jnp.array([0.7])
    assert system.inverse_mass_matrix(q).item() == pytest.approx(3.0)
    assert system.potential_energy(q).item() == pytest.approx(5 * (1 - np.cos(0.7)))
    assert system.input_matrix(q).item() == 1.0
    assert system.dissipation_matrix(q, q).item() == 0.1


@given(angle=st.floats(-7.0, 7.0), rate=st.floats(-5.0, 5.0), torque=st.floats(-2.0, 2.0))
def test_the_upright_pendulum_accelerates_as_gymnasiums_does(angle, rate, torque):
    gymnasium = pytest.importorskip("gymnasium")
    simulator = gymnasium.make("Pendulum-v1").unwrapped
    simulator.state = np.array([angle, rate])
    simulator.step(np.array([torque]))
    acceleration = (simulator.state[1] - rate) / simulator.dt
    system = Pendulum(gravity=10.0, upright=True)
    _, p_dot = system.vector_field(jnp.array([angle]), jnp.array([rate]) / 3, jnp.array([torque]))
    assert 3 * p_dot.item() == pytest.approx(acceleration, abs=1e-9)


def test_upright_turns_the_angle_by_half_a_turn_and_nothing_else():
    q, p, u = jnp.array([0.4]), jnp.array([0.3]), jnp.array([1.0])
    hanging, upright = Pendulum(damping=0.2), Pendulum(damping=0.2, upright=True)
    theirs = hanging.vector_field(q + jnp.pi, p, u)
    for ours, other in zip(upright.vector_field(q, p, u), theirs, strict=True):
        assert ours == pytest.approx(np.asarray(other))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"mass": 0.0}, "`mass` must be positive; got 0.0"),
        ({"length": -1.0}, "`length` must be positive; got -1.0"),
        ({"mass": float("nan")}, "`mass` must be positive; got nan"),
        ({"gravity": -9.81}, "`gravity` must be at least 0; got -9.81"),
        ({"damping": -0.1}, "`damping` must be at least 0; got -0.1"),
    ],
)
def test_unphysical_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(Pendulum(), **parameters)
