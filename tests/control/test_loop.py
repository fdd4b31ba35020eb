"""The closed loop: sampled, delayed, noisy; and the filter before the controller."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import EnergyShaping, Loop, Observer, Regulator, close_loop, judge, run_episodes
from symoden.integrate import RK4, rollout

from .conftest import CART_POLE, PENDULUM

SHAPING = EnergyShaping.of(PENDULUM, [0.0], limits=15.0)
LOOP = Loop(duration=0.5, noise=0.01)
START = np.array([[2.0], [-1.0]]), np.array([[0.5], [0.0]])
FIRST = jnp.asarray(START[0][0]), jnp.asarray(START[1][0])


def test_inputs_are_held_for_a_period():
    loop = Loop(duration=1.0, period=0.1, step=0.01)
    episodes = run_episodes(PENDULUM, SHAPING, *START, loop)
    assert episodes.u.shape == (2, 10, 1)
    path = rollout(PENDULUM, FIRST[0], FIRST[1], episodes.ts[0], episodes.u[0], solver=RK4(10))
    np.testing.assert_allclose(path.q, episodes.q[0], atol=1e-12)


@pytest.mark.parametrize(("delay", "late"), [(0.1, 1), (0.2, 2)])
def test_a_delay_of_whole_periods_shifts_the_inputs(delay, late):
    loop = Loop(duration=1.0, period=0.1, step=0.01, delay=delay)
    episodes = run_episodes(PENDULUM, SHAPING, *START, loop)
    acted = jnp.concatenate([jnp.zeros((late, 1)), episodes.u[0, :-late]])
    path = rollout(PENDULUM, FIRST[0], FIRST[1], episodes.ts[0], acted, solver=RK4(10))
    np.testing.assert_allclose(path.q, episodes.q[0], atol=1e-12)


def test_a_part_of_a_period_delays_in_between():
    loops = [Loop(duration=1.0, period=0.1, step=0.001, delay=delay) for delay in (0.0, 0.05, 0.0999999, 0.1)]
    ends = [float(run_episodes(PENDULUM, SHAPING, *START, loop).q[0, 3, 0]) for loop in loops]
    assert ends[0] < ends[1] < ends[3]
    assert ends[2] == pytest.approx(ends[3], abs=1e-5)


@pytest.mark.usefixtures("single_use_keys")
def test_noise_is_measured_and_not_felt():
    quiet, noisy, again = (
        run_episodes(PENDULUM, SHAPING, *START, Loop(duration=0.5, noise=noise), seed=3) for noise in (0.0, 0.1, 0.1)
    )
    assert float(jnp.abs(quiet.q[:, 0] - noisy.q[:, 0]).max()) == 0
    assert float(jnp.abs(quiet.u[:, 0] - noisy.u[:, 0]).max()) > 1e-3
    np.testing.assert_array_equal(noisy.q, again.q)


def test_a_filter_on_a_true_model_takes_noise_away():
    regulator = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0, period=0.02)
    loop = Loop(duration=6.0, period=0.02, noise=0.01)
    start = np.full((8, 2), 0.1), np.zeros((8, 2))
    raw, filtered = (
        np.asarray(run_episodes(CART_POLE, regulator, *start, loop, observer=observer).v[:, 150:]).std()
        for observer in (None, Observer(CART_POLE, 0.01))
    )
    assert filtered < 0.5 * raw


def test_each_channel_is_trusted_as_its_noise_allows():
    observer = Observer(CART_POLE, np.array([1e-6, 1.0, 1e-6, 1.0]), drift=(1e-2,) * 4)
    q, v, u = jnp.array([0.1, 3.0]), jnp.array([0.2, -1.0]), jnp.array([1.0])
    guess = observer.predict(observer.start(q, v), u, 0.02)
    guess = guess._replace(covariance=jnp.diag(jnp.diag(guess.covariance)).at[1, 1].set(1e-4).at[3, 3].set(1e-4))
    after = observer.correct(guess, guess.q + 0.01, guess.v + 0.01)
    moved = np.concatenate([after.q - guess.q, after.v - guess.v])
    np.testing.assert_allclose(moved, [0.01, 0, 0.01, 0], atol=1e-5)


def test_a_filter_looks_ahead_over_the_delay():
    regulator = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0, period=0.02)
    loop = Loop(duration=6.0, period=0.02, delay=0.13)
    start = np.array([[0.1, 0.1]]), np.zeros((1, 2))
    without, ahead = (
        float(jnp.abs(run_episodes(CART_POLE, regulator, *start, loop, observer=observer).q[0, -1]).max())
        for observer in (None, Observer(CART_POLE, 1e-4))
    )
    assert ahead < 1e-3
    assert not without < 0.1


def test_a_measurement_that_fits_changes_nothing():
    observer = Observer(CART_POLE, 0.01)
    q, v, u = jnp.array([0.1, 3.0]), jnp.array([0.2, -1.0]), jnp.array([1.0])
    guess = observer.predict(observer.start(q, v), u, 0.02)
    after = observer.correct(guess, guess.q + jnp.array([0.0, 2 * jnp.pi]), guess.v)
    np.testing.assert_allclose([after.q, after.v], [guess.q, guess.v], atol=1e-12)
    assert np.all(np.diag(after.covariance) < np.diag(guess.covariance))


def test_settings_out_of_range_are_refused():
    words: dict[str, Any]
    for words in ({"period": 0.0}, {"duration": 0.001}, {"step": -1.0}, {"duration": float("nan")}):
        with pytest.raises(ValueError, match="must be positive, the duration at least one period"):
            Loop(**words)
    for words in ({"noise": -0.1}, {"noise": 1e300}, {"delay": -0.1}):
        with pytest.raises(ValueError, match="Noise must be between 0 and 1e\\+06, delay at least 0"):
            Loop(**words)
    for period in (1e-9, 1e-320):
        with pytest.raises(ValueError, match="at most 10000000 control periods"):
            Loop(duration=1.0, period=period)
    for noise in (0.0, (1e-3, 1e-3, 1e-3), (1e-3, -1.0), float("nan")):
        with pytest.raises(ValueError, match=r"`noise` must be positive, one number or one for each of the 2 channels"):
            Observer(PENDULUM, noise)
    with pytest.raises(ValueError, match="`drift` must be positive"):
        Observer(PENDULUM, 1e-3, drift=0.0)


def test_an_episode_is_judged_by_its_end_and_settles_when_it_stays():
    episodes = run_episodes(PENDULUM, SHAPING, *START, Loop(duration=6.0))
    verdict = judge(episodes, PENDULUM.space, np.array([2 * np.pi]))
    assert verdict.success.all()
    for k in range(2):
        away = (np.abs(np.asarray(episodes.q[k])) > 0.05) | (np.abs(np.asarray(episodes.v[k])) > 0.1)
        last = np.flatnonzero(away[:, 0])[-1]
        assert verdict.settling[k] == pytest.approx(float(episodes.ts[k, last + 1]))
    other = judge(episodes, PENDULUM.space, np.array([0.1]))
    assert not other.success.any()
    assert np.isnan(other.settling).all()


def test_episodes_too_short_to_stay_are_not_judged():
    at_target = np.full((1, 1), 2 * np.pi), np.zeros((1, 1))
    assert judge(
        run_episodes(PENDULUM, SHAPING, *at_target, Loop(duration=2.0)), PENDULUM.space, at_target[0][0]
    ).success
    episodes = run_episodes(PENDULUM, SHAPING, *at_target, Loop(duration=1.5))
    with pytest.raises(ValueError, match=r"must last at least 2 s, .* got 1\.5 s"):
        judge(episodes, PENDULUM.space, at_target[0][0])


def test_a_diverging_episode_is_no_success():
    episodes = run_episodes(PENDULUM, SHAPING, np.array([[np.nan]]), np.zeros((1, 1)), Loop(duration=3.0))
    assert not judge(episodes, PENDULUM.space, np.zeros(1)).success.any()


def test_one_episode_is_the_same_alone():
    keys = jax.random.split(jax.random.key(0), 2)
    batch = run_episodes(PENDULUM, SHAPING, *START, LOOP)
    alone = close_loop(PENDULUM, SHAPING, jnp.asarray(START[0][1]), jnp.asarray(START[1][1]), LOOP, key=keys[1])
    np.testing.assert_allclose(batch.q[1], alone.q, atol=1e-12)
