"""Controlled Lagrangian: without friction its energy falls exactly, and it holds the top."""

import equinox as eqx
import hypothesis.strategies as st
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from symoden.control import ControlledLagrangian, Loop, judge, run_episodes
from symoden.systems import CartPole

from .conftest import ACROBOT, CART_POLE, FREE_CART_POLE, PENDULUM, rate_of

GAINS = [7.0, 0.12, 8.0, 13.0]
FREE = ControlledLagrangian.of(FREE_CART_POLE, [0.0, 0.0], gains=GAINS)
DAMPED = ControlledLagrangian.of(CART_POLE, [0.0, 0.0], gains=GAINS)
ENERGY = eqx.filter_jit(FREE.desired_energy)
CALL = eqx.filter_jit(FREE)
near = st.floats(-0.7, 0.7)


@given(x=st.floats(-2, 2), theta=near, v=st.tuples(st.floats(-2, 2), st.floats(-2, 2)))
def test_without_friction_the_desired_energy_falls_by_damping_alone(x, theta, v):
    q, v = jnp.array([x, theta]), jnp.array(v)
    rate, _ = rate_of(FREE_CART_POLE, FREE, q, v)
    kappa, a, _, c = GAINS
    place_rate = a * v[0] + (a * kappa + 1) * 0.25 * jnp.cos(theta) * v[1]
    assert rate == pytest.approx(float(-c * place_rate**2), rel=1e-6, abs=1e-7)


@given(x=st.floats(-1, 1), theta=near, v=st.tuples(st.floats(-1, 1), st.floats(-1, 1)))
def test_the_desired_energy_is_least_at_the_target(x, theta, v):
    assert float(ENERGY(jnp.array([x, theta]), jnp.array(v))) >= -1e-12


@given(theta=near, rate=st.floats(-2, 2))
def test_friction_where_no_input_acts_works_against_it(theta, rate):
    q, v = jnp.array([0.3, theta]), jnp.array([0.2, rate])
    more = rate_of(CART_POLE, DAMPED, q, v)[0] - rate_of(FREE_CART_POLE, FREE, q, v)[0]
    assert more == pytest.approx(0.05 * rate**2, abs=1e-7)


def test_the_target_is_an_equilibrium():
    assert abs(float(CALL(jnp.zeros(2), jnp.zeros(2))[0])) < 1e-12


def test_chosen_gains_bring_cart_and_pole_to_the_target():
    controller = ControlledLagrangian.of(CART_POLE, [0.0, 0.0], limits=15.0)
    generator = np.random.default_rng(0)
    q0, v0 = generator.uniform(-1, 1, (2, 20, 2)) * np.array([[[0.5, 0.6]], [[0.1, 0.1]]])
    episodes = run_episodes(CART_POLE, controller, q0, v0, Loop(duration=10.0, period=0.01))
    verdict = judge(episodes, CART_POLE.space, np.zeros(2))
    assert verdict.success.all()
    assert float(jnp.abs(episodes.u).max()) <= 15.0


def test_other_mechanisms_are_refused():
    with pytest.raises(ValueError, match="two coordinates and one input; the model has 1 and 1"):
        ControlledLagrangian.of(PENDULUM, [0.0])
    for system, target in ((ACROBOT, [np.pi, 0.0]), (CART_POLE, [0.0, np.pi]), (CartPole(gravity=0.0), [0.0, 0.0])):
        with pytest.raises(ValueError, match="cyclic actuated coordinate"):
            ControlledLagrangian.of(system, target)
