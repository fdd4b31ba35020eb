"""Swing-up: energy goes to that of the target, and the actuated coordinate does what it is told."""

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from symoden.control import CollocatedPump, EnergyPump, Loop, run_episodes
from symoden.control._motion import velocity_field

from .conftest import ACROBOT, CART_POLE, PENDULUM, rate_of

PUMP = EnergyPump.of(PENDULUM, [0.0], limits=4.0)
RIDES = {
    "cart-pole": CollocatedPump.of(CART_POLE, [0.0, 0.0], limits=1e9),
    "acrobot": CollocatedPump.of(ACROBOT, [np.pi, 0.0], limits=1e9),
}
SYSTEMS = {"cart-pole": CART_POLE, "acrobot": ACROBOT}
FIELD = eqx.filter_jit(velocity_field)
CALL = eqx.filter_jit(lambda controller, q, v: controller(q, v))


@given(q=st.floats(-10, 10), v=st.floats(-12, 12).filter(lambda v: abs(v) > 0.05))
def test_the_energy_of_a_pendulum_goes_to_that_of_the_target(q, v):
    rate, u = rate_of(PENDULUM, PUMP, [q], [v])
    assert rate <= 1e-9
    assert abs(u[0]) <= 4


def test_with_the_wanted_energy_friction_alone_is_fed_back():
    q = jnp.array([2.0])
    v = jnp.sqrt(2 * (PUMP.energy - PENDULUM.potential_energy(q)) * 3)[None]
    assert float(PUMP(q, v)[0]) == pytest.approx(0.1 * float(v[0]))


def test_hanging_at_rest_is_left():
    assert abs(float(PUMP(jnp.array([np.pi]), jnp.zeros(1))[0])) > 0.05
    assert abs(float(PUMP(jnp.zeros(1), jnp.zeros(1))[0])) < 1e-9


@pytest.mark.parametrize("name", RIDES)
@given(values=st.lists(st.floats(-3, 3), min_size=4, max_size=4))
def test_the_actuated_coordinate_accelerates_as_wanted(name, values):
    pump = RIDES[name]
    q, v = jnp.array(values[:2]), jnp.array(values[2:])
    a = pump.actuated
    acceleration = FIELD(pump.model, q, v, CALL(pump, q, v))[1][a]
    zeroed = eqx.tree_at(lambda p: p.gains, pump, pump.gains.at[jnp.array([0, 5])].set(0.0))
    plain = FIELD(pump.model, q, v, CALL(zeroed, q, v))[1][a]
    e = pump.space.difference(q, pump.target)[a]
    assert float(plain) == pytest.approx(float(-pump.gains[3] * e - pump.gains[4] * v[a]), rel=1e-6, abs=1e-6)
    lam = (
        pump.energy - 0.5 * v @ pump.model.mass_matrix(q) @ v - SYSTEMS[name].potential_energy(q)
    ) / pump.energy_range
    lam = lam + pump.gains[6]
    M = pump.model.mass_matrix(q)
    pushed = pump.gains[3] * pump.gains[0] * jnp.tanh(pump.gains[1] * lam) * jnp.tanh(v[1 - a] / pump.gains[2])
    pushed = pushed - pump.gains[5] * lam * M[a, 1 - a] / M[1 - a, 1 - a] * v[1 - a]
    assert float(acceleration - plain) == pytest.approx(float(pushed), rel=1e-6, abs=1e-5)


def test_near_the_wanted_energy_inputs_do_not_chatter():
    q0, v0 = np.array([[3.0], [1.0]]), np.array([[0.0], [4.0]])
    u = np.asarray(run_episodes(PENDULUM, PUMP, q0, v0, Loop(duration=4.0, period=0.01)).u[:, :, 0])
    turns = (np.abs(np.diff(np.sign(u), axis=1)) > 1).sum(axis=1)
    assert np.all(turns < 10)


def test_limits_hold_in_swing_up():
    pump = CollocatedPump.of(CART_POLE, [0.0, 0.0], limits=15.0)
    q, v = 3 * jax.random.normal(jax.random.key(0), (2, 200, 2))
    u = jax.vmap(pump)(q, v)
    assert float(jnp.abs(u).max()) == 15.0


def test_other_mechanisms_are_refused():
    with pytest.raises(ValueError, match="one input with a finite limit"):
        EnergyPump.of(PENDULUM, [0.0], limits=None)
    with pytest.raises(ValueError, match="got 2 coordinates"):
        EnergyPump.of(CART_POLE, [0.0, 0.0], limits=1.0)
    with pytest.raises(ValueError, match="needs two coordinates and one input; the model has 1 and 1"):
        CollocatedPump.of(PENDULUM, [0.0], limits=1.0)
