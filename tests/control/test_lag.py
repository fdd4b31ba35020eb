"""Inputs that act by a lag: what follows a command, in the loop and before the controller."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from symoden.control import EnergyShaping, Lag, Loop, Observer, PredictorFeedback, Regulator, judge, run_episodes
from symoden.control._motion import moved
from symoden.integrate import RK4, rollout

from .conftest import CART_POLE, PENDULUM

SHAPING = EnergyShaping.of(PENDULUM, [0.0], limits=15.0)
START = np.array([[2.0]]), np.array([[0.5]])
REGULATOR = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0, period=0.02)

times = st.floats(1e-3, 10.0)
inputs = st.floats(-5.0, 5.0)


@given(lag=times, seconds=times, acting=inputs, u=inputs)
def test_what_follows_solves_the_lags_equation(lag, seconds, acting, u):
    path = solve_ivp(lambda _, x: [(u - x[0]) / lag, x[0]], (0, seconds), [acting, 0], "LSODA", rtol=1e-10, atol=1e-11)
    after, mean = Lag((lag,)).follow(jnp.array([acting]), jnp.array([u]), seconds)
    np.testing.assert_allclose([after[0], seconds * mean[0]], path.y[:, -1], atol=1e-6)


@given(lags=st.tuples(times, times), seconds=times, acting=st.tuples(inputs, inputs), u=st.tuples(inputs, inputs))
def test_a_time_in_parts_is_the_same_time(lags, seconds, acting, u):
    lag, acting, u = Lag(lags), jnp.array(acting), jnp.array(u)
    after, mean = lag.follow(acting, u, seconds)
    half, first = lag.follow(acting, u, seconds / 2)
    whole, second = lag.follow(half, u, seconds / 2)
    np.testing.assert_allclose([whole, (first + second) / 2], [after, mean], atol=1e-9)


def test_each_input_has_a_lag_of_its_own():
    after, mean = Lag((0.0, 0.5)).follow(jnp.zeros(2), jnp.ones(2), 0.5)
    np.testing.assert_allclose(after, [1.0, 1 - math.exp(-1)])
    np.testing.assert_allclose(mean, [1.0, math.exp(-1)])


def test_inputs_of_a_loop_act_by_the_lag():
    loop = Loop(duration=1.0, period=0.02, step=0.001, lag=(0.1,))
    episode = run_episodes(PENDULUM, SHAPING, *START, loop)
    # The same by the lag's solution at a hundred points a period, joined by straight lines.
    u, fine = np.repeat(np.asarray(episode.u[0]), 100, axis=0), np.arange(5001) * 0.0002
    x = np.zeros((len(fine), 1))
    for k in range(len(fine) - 1):
        x[k + 1] = u[k] + (x[k] - u[k]) * math.exp(-0.0002 / 0.1)
    path = rollout(PENDULUM, *map(jnp.asarray, (START[0][0], START[1][0], fine, x)), solver=RK4(1), hold="linear")
    np.testing.assert_allclose(path.q[::100][:50], episode.q[0], atol=1e-5)
    held = run_episodes(PENDULUM, SHAPING, *START, Loop(duration=1.0, period=0.02, step=0.001))
    assert float(jnp.abs(held.q - episode.q).max()) > 0.05


def test_a_filter_looks_ahead_over_the_lag():
    start = np.array([[0.1, 0.1], [-0.1, 0.15]]), np.zeros((2, 2))
    loop = Loop(duration=6.0, period=0.02, lag=(0.15,))
    without, ahead = (
        np.abs(np.asarray(run_episodes(CART_POLE, REGULATOR, *start, loop, observer=observer).q[:, -1])).max()
        for observer in (None, Observer(CART_POLE, 1e-4))
    )
    assert ahead < 1e-3
    assert not without < 0.1


def test_a_delay_and_a_lag_are_looked_through_together():
    start = np.full((4, 2), 0.05), np.zeros((4, 2))
    loop = Loop(duration=8.0, period=0.02, delay=0.05, lag=(0.06,))
    episodes = run_episodes(CART_POLE, REGULATOR, *start, loop, observer=Observer(CART_POLE, 1e-4))
    assert judge(episodes, CART_POLE.space, np.zeros(2)).success.all()


@given(queued=st.integers(0, 4), first=st.sampled_from([0.0, 0.004]), seed=st.integers(0, 100))
def test_commands_on_their_way_are_followed_in_turn(queued, first, seed):
    lag, period = Lag((0.03, 0.0)), 0.01
    us, acting = jnp.asarray(np.random.default_rng(seed).normal(size=(queued + 1, 2))).astype(float), jnp.ones(2)
    means, after = lag.through(acting, us[:queued], first=first, period=period)
    for k in range(queued):
        acting, mean = lag.follow(acting, us[k], (first or period) if k == 0 else period)
        np.testing.assert_allclose(means[k], mean)
    np.testing.assert_allclose(after[0], acting[0])
    assert means.shape == (queued, 2)


def test_an_input_is_given_for_the_state_in_which_it_acts():
    """From the first measurement, and no input, on: by a delay, a lag, or both, one after the other."""
    q, v, none = jnp.array([0.1, 0.2]), jnp.array([0.3, -0.4]), jnp.zeros(1)
    observer = Observer(CART_POLE, 1e-4)
    for delay, lag in ((0.0, 0.0), (0.04, 0.0), (0.0, 0.2), (0.03, 0.2)):
        feedback = PredictorFeedback(REGULATOR, observer, Loop(period=0.02, delay=delay, lag=(lag,)))
        u, _ = feedback.answer(feedback.start(q, v), q, v)
        then = moved(CART_POLE, *moved(CART_POLE, q, v, none, delay), none, lag)
        np.testing.assert_allclose(u, REGULATOR(*then), rtol=1e-4)


def test_lags_that_are_none_are_refused():
    for wrong in (-0.1, math.inf, math.nan):
        with pytest.raises(ValueError, match="A lag must be at least 0 s, and finite"):
            Loop(lag=(wrong,))
    with pytest.raises(ValueError, match="one number or one per input, 1; got 2"):
        run_episodes(PENDULUM, SHAPING, *START, Loop(duration=1.0, lag=(0.1, 0.2)))
    for delay, lag in ((0.0, (11.0,)), (11.0, ())):
        with pytest.raises(ValueError, match="Delay and lags must be at most 10 s; got"):
            Loop(duration=10.0, delay=delay, lag=lag)


def test_a_lag_of_hardly_anything_is_none():
    loops = [Loop(duration=1.0, period=0.02, lag=lag) for lag in ((), (1e-12,))]
    observer = Observer(PENDULUM, 1e-3)
    first, second = (run_episodes(PENDULUM, SHAPING, *START, loop, observer=observer).q for loop in loops)
    np.testing.assert_allclose(first, second, atol=1e-6)


def test_lost_measurements_are_predicted():
    loop = Loop(period=0.02, delay=0.04, lag=(0.05,))
    feedback = PredictorFeedback(REGULATOR, Observer(CART_POLE, 1e-3), loop)
    q, v = jnp.array([0.1, 0.2]), jnp.array([0.3, -0.4])
    _, memory = feedback.answer(feedback.start(q, v), q, v)
    u, after = feedback.answer(memory, q.at[0].set(jnp.nan), v)
    told, _ = feedback.answer(memory, *memory.guess[:2])
    np.testing.assert_allclose(u, told, rtol=1e-6)
    assert all(np.isfinite(part).all() for part in jax.tree.leaves(after))
    blind, lost = feedback.start(q * jnp.nan, v), q * jnp.nan
    u, blind = feedback.answer(blind, lost, v)
    np.testing.assert_array_equal(u, [0.0])
    begun, _ = feedback.answer(feedback.start(q, v), q, v)
    np.testing.assert_allclose(feedback.answer(blind, q, v)[0], begun, rtol=1e-6)
