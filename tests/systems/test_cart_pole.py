"""Cart-pole: Gymnasium, inputs, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import pytest
from hypothesis import given, strategies as st

from symoden.systems import CartPole


@jax.jit
def accelerations(system, q, v, u):
    p = system.mass_matrix(q) @ v
    motion = (jnp.concatenate(system.vector_field(q, p, u)),)
    return jax.jvp(lambda state: system.decode(state)[1], (jnp.concatenate([q, p]),), motion)[1]


@given(angle=st.floats(-7.0, 7.0), rates=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), push=st.booleans())
def test_it_accelerates_as_gymnasiums_does(angle, rates, push):
    gymnasium = pytest.importorskip("gymnasium")
    simulator = gymnasium.make("CartPole-v1").unwrapped
    simulator.reset(seed=0)
    simulator.state = (0.3, rates[0], angle, rates[1])
    simulator.step(int(push))
    _, speed, _, turning = simulator.state
    system = CartPole(cart_mass=1.0, pole_mass=0.1)
    force = jnp.array([10.0 if push else -10.0])
    ours = accelerations(system, jnp.array([0.3, angle]), jnp.array(rates), force)
    assert ours == pytest.approx([(speed - rates[0]) / 0.02, (turning - rates[1]) / 0.02], abs=1e-9)


def test_the_force_acts_on_the_cart_and_the_torque_on_the_pole():
    q = jnp.array([0.1, 0.2])
    assert CartPole().input_matrix(q).tolist() == [[1.0], [0.0]]
    assert CartPole(fully_actuated=True).input_matrix(q).tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert (CartPole().inputs, CartPole(fully_actuated=True).inputs) == (1, 2)
    assert str(CartPole().space) == "R1 T1"


@pytest.mark.parametrize("name", ["cart_mass", "pole_mass", "half_length"])
def test_sizes_must_be_positive(name):
    with pytest.raises(ValueError, match=f"`{name}` must be positive; got 0"):
        dataclasses.replace(CartPole(), **{name: 0.0})


@pytest.mark.parametrize("name", ["gravity", "cart_damping", "pole_damping"])
def test_friction_and_gravity_must_not_be_negative(name):
    with pytest.raises(ValueError, match=f"`{name}` must be at least 0; got -1.0"):
        dataclasses.replace(CartPole(), **{name: -1.0})
