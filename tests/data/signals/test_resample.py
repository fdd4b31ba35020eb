"""Resampling keeps what slow samples can show, removes what they cannot, and delays nothing."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Trajectory, resample


def uneven(seed, samples=2000, step=0.002):
    steps = step * np.random.default_rng(seed).uniform(0.5, 1.5, samples - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def recording(ts, q, us=None):
    us = np.zeros((len(ts), 0)) if us is None else us
    return Trajectory(name="run", ts=ts, q=q[:, None], rates=q[:, None], us=us)


@given(seed=st.integers(0, 100), slope=st.floats(-5, 5), dt=st.floats(0.0005, 0.1), start=st.floats(-1e3, 1e9))
def test_a_straight_line_stays_itself_at_every_step(seed, slope, dt, start):
    ts = uneven(seed)
    new = resample(recording(ts + start, slope * ts + 1), dt)
    np.testing.assert_allclose(np.diff(new.ts), dt, atol=1e-6 * max(1.0, start * 1e-9 / dt))
    np.testing.assert_allclose(new.q[:, 0], slope * (new.ts - new.ts[0]) + 1, atol=1e-6 * (1 + abs(slope)))
    assert new.duration <= ts[-1] * (1 + 1e-9) < new.duration + dt * 1.001


@pytest.mark.parametrize("hertz", [1.0, 5.0, 20.0])
def test_a_sine_is_averaged_exactly_and_not_delayed(hertz):
    ts, dt = uneven(0, 20_000, 0.0002), 0.01
    new = resample(recording(ts, np.sin(2 * np.pi * hertz * ts)), dt)
    inside = slice(1, -1)
    expected = np.sinc(hertz * dt) * np.sin(2 * np.pi * hertz * new.ts)
    np.testing.assert_allclose(new.q[inside, 0], expected[inside], atol=2e-4)


@pytest.mark.parametrize("hertz", [100.0, 200.0])
def test_a_vibration_that_would_turn_up_as_a_standstill_is_removed(hertz):
    ts = uneven(0, 20_000, 0.0002)
    new = resample(recording(ts, np.cos(2 * np.pi * hertz * ts)), 0.01)
    assert np.abs(new.q[1:-1]).max() < 2e-3


def test_noise_falls_with_the_root_of_the_samples_that_are_averaged():
    noise = np.random.default_rng(0).normal(size=50_000)
    new = resample(recording(0.001 * np.arange(50_000), noise), 0.05)
    assert new.q[1:-1].std() == pytest.approx(1 / np.sqrt(50), rel=0.1)


def test_averaged_velocities_remain_the_derivative_of_averaged_positions():
    ts = uneven(1, 20_000, 0.0002)
    fast = Trajectory(
        name="run", ts=ts, q=np.sin(9 * ts)[:, None], rates=9 * np.cos(9 * ts)[:, None], us=np.zeros((len(ts), 0))
    )
    new = resample(fast, 0.01)
    slopes = np.gradient(new.q[1:-1, 0], new.ts[1:-1])
    np.testing.assert_allclose(slopes[1:-1], new.rates[2:-2, 0], rtol=0.002, atol=0.02)


def test_a_shorter_step_interpolates():
    ts = np.arange(5.0)
    new = resample(recording(ts, ts**2), 0.5)
    np.testing.assert_allclose(new.q[:, 0], np.interp(new.ts, ts, ts**2))


def test_the_same_step_changes_nothing():
    ts = 0.01 * np.arange(200)
    old = recording(ts, np.sin(ts), np.cos(ts)[:, None])
    new = resample(old, 0.01)
    np.testing.assert_allclose(new.q, old.q, atol=1e-12)
    np.testing.assert_allclose(new.us, old.us, atol=1e-12)


@given(seed=st.integers(0, 1000), dt=st.floats(0.0007, 0.05))
def test_the_impulse_of_a_held_input_is_kept(seed, dt):
    ts = uneven(seed)
    u = np.random.default_rng(seed).normal(size=(len(ts), 2))
    new = resample(recording(ts, ts, u), dt)
    end = new.ts[-1] + dt
    lengths = np.diff(np.append(np.minimum(ts, end), end))
    np.testing.assert_allclose(dt * new.us.sum(axis=0), (lengths[:, None] * u).sum(axis=0), atol=1e-9)


@given(seed=st.integers(0, 1000), dt=st.floats(0.0007, 0.05), level=st.floats(-2e3, 2e3))
def test_a_held_input_that_never_changes_stays_what_it_is(seed, dt, level):
    """Its rounding would be taken for a motion of its own."""
    ts = uneven(seed)
    assert set(resample(recording(ts, ts, np.full((len(ts), 1), level)), dt).us[:, 0]) == {level}


def test_a_held_step_is_felt_from_its_own_time_stamp_on():
    ts = 0.1 * np.arange(11)
    new = resample(recording(ts, ts, (ts >= 0.5 - 1e-9)[:, None].astype(float)), 0.2)
    np.testing.assert_allclose(new.us[:, 0], [0, 0, 0.5, 1, 1, 1], atol=1e-9)


def test_a_linear_input_is_averaged_about_its_time_stamp():
    ts = 0.1 * np.arange(11)
    new = resample(recording(ts, ts, ts[:, None]), 0.2, hold="linear")
    np.testing.assert_allclose(new.us[:, 0], new.ts, atol=1e-12)


@pytest.mark.parametrize("dt", [2.0, 1e-9])
def test_a_step_that_leaves_too_few_or_too_many_samples_is_refused(dt):
    with pytest.raises(DataError, match=f"`run`: `resample` must give 2 to .*; got a step of {dt} s"):
        resample(recording(np.linspace(0, 1, 11), np.zeros(11)), dt)


def test_a_step_far_shorter_than_the_samples_is_a_wrong_unit_of_time():
    milliseconds = recording(4.0 * np.arange(100), np.zeros(100))
    with pytest.raises(DataError, match=r"`run`: `resample` must not be far .* got 0.01 s where they are 4 s\. .* ms"):
        resample(milliseconds, 0.01)
    assert len(resample(milliseconds, 0.1).ts) == 3961


def test_a_step_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="`dt` must be positive"):
        resample(recording(np.linspace(0, 1, 11), np.zeros(11)), 0.0)


@pytest.mark.parametrize("step", [0.01, 0.001])
@pytest.mark.parametrize("start", [0.0, 1.7e9, 1.7e9 + 0.1234567])
def test_stamps_since_1970_have_as_many_samples(start, step):
    ts = start + np.round(step * np.arange(997), 6)
    assert len(resample(recording(ts, np.zeros(997) + ts - start), 4 * step)) == 250
