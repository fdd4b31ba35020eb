"""Rounding, noise and cut-offs are measured as they were made."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data.signals._kinematics import Accuracy, jumps, velocity_ratio
from symoden.data.signals._signals import least_change, longest_step, noise_level, quantum, shares_cut_off, standstills

EXACT = (Accuracy(quantum=0.0, noise=0.0), Accuracy(quantum=0.0, noise=0.0))


def uneven(seed, samples=2000, step=0.002):
    return np.cumsum(step * np.random.default_rng(seed).uniform(0.5, 1.5, samples))


def motion(ts, amplitude=1.0):
    return amplitude * (np.sin(3 * ts) + 0.3 * np.sin(11 * ts + 1))


def speed(ts, amplitude=1.0):
    return amplitude * (3 * np.cos(3 * ts) + 3.3 * np.cos(11 * ts + 1))


@given(seed=st.integers(0, 1000), step=st.floats(3e-4, 0.02), offset=st.floats(-1, 1))
def test_the_step_of_rounding_is_found(seed, step, offset):
    signal = offset + step * np.round(motion(uneven(seed)) / step)
    assert quantum(signal) == pytest.approx(step, rel=1e-3)


@given(seed=st.integers(0, 1000))
def test_what_is_not_rounded_has_no_step(seed):
    ts, rng = uneven(seed), np.random.default_rng(seed)
    staircase = np.repeat(rng.integers(-3, 4, 20).astype(float), 100)
    for signal in (motion(ts), rng.normal(size=2000), 0.1 * np.arange(2000), 0 * ts, np.sign(motion(ts)), staircase):
        assert quantum(signal) == 0


@pytest.mark.parametrize("speed", [0.1, 0.5, 0.85, 0.92, 0.97, 1.03, 1.4, 2.03, 3.04])
def test_the_step_of_an_encoder_that_turns_steadily_is_found(speed):
    assert quantum(0.01 * np.floor(speed * np.arange(2000) + 0.3)) == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("rows", [slice(0, 1), slice(1000, None), slice(1000, 1001)])
def test_one_row_off_the_grid_hides_no_step(rows):
    """The first one before a sensor was ready, all from where it was set to zero, one that was made up."""
    signal = 0.01 * np.round(100 * np.sin(2 * np.pi * np.arange(2000) / 2000))
    signal[rows] += 0.00437
    assert quantum(signal) == pytest.approx(0.01, rel=1e-6)


@given(
    lag=st.floats(0.01, 0.1),
    seconds=st.floats(0.3, 3.0),
    rest=st.floats(0.0, 0.1),
    strokes=st.integers(1, 4),
    resolution=st.sampled_from([0.0, 1.5e-5]),
)
def test_a_steady_motion_is_not_rounded_to_what_it_moves_in_a_sample(lag, seconds, rest, strokes, resolution):
    """A motor whose voltage is switched on, off and round, and that takes some samples to follow."""
    step = 0.005
    v, volts = [0.0] * round(rest / step), [1.0 if k % 2 else -1.0 for k in range(1, strokes + 1)]
    for volt in np.repeat(volts, round(seconds / step)):
        v.append(v[-1] + (volt - v[-1]) * (1 - np.exp(-step / lag)) if v else 0.0)
    signal = 0.36 * step * np.cumsum(v)
    if resolution:
        signal = resolution * np.round(signal / resolution)
    assert quantum(signal) <= resolution * (1 + 1e-6)


@given(seed=st.integers(0, 1000), sigma=st.floats(1e-4, 0.1))
def test_noise_is_measured_on_a_moving_signal_at_uneven_times(seed, sigma):
    ts = uneven(seed)
    noisy = motion(ts) + sigma * np.random.default_rng(seed).normal(size=2000)
    assert noise_level(ts, noisy, longest=0.01) == pytest.approx(sigma, rel=0.2)


def test_bursts_with_gaps_between_them_are_no_noise():
    burst = np.repeat(np.arange(200.0), 10)
    ts = burst + np.tile(0.001 * np.arange(10), 200)
    assert noise_level(ts, np.random.default_rng(0).normal(size=200)[burst.astype(int)], longest=0.01) < 1e-9


def test_gaps_and_wraps_are_no_noise():
    ts = np.concatenate([uneven(0), 50 + uneven(1)])
    assert noise_level(ts, np.mod(5 * motion(ts), 2 * np.pi), longest=0.01) < 1e-6


@given(limit=st.floats(0.3, 0.95))
def test_a_clipped_signal_is_cut_off(limit):
    wave = np.sin(7 * uneven(0))
    clipped = np.clip(wave, -limit, limit)
    shares = shares_cut_off(clipped)
    assert list(shares) == [-limit, limit]
    assert sum(shares.values()) == pytest.approx((np.abs(wave) >= limit).mean(), abs=1e-3)
    assert list(shares_cut_off(np.minimum(wave, limit))) == [limit]
    assert shares_cut_off(np.maximum(wave, 0)) == {}  # at rest at 0
    assert shares_cut_off(np.append(np.linspace(-0.9, 0.9, 49), 1.2)) == {}  # One of fifty has to be the largest.
    assert shares_cut_off(wave) == shares_cut_off(np.sign(wave)) == shares_cut_off(0 * wave) == {}
    assert shares_cut_off(0.01 * np.round(wave / 0.01)) == {}


def test_standstills_end_where_the_value_changes_or_time_has_a_gap():
    ts, signal = np.arange(10.0), np.array([1, 1, 1, 2, 2, 2, 2, 2, 2, 3.0])
    assert standstills(ts, signal, least=3, longest=1.5) == [(0, 2), (3, 8)]
    assert standstills(ts + 5 * (ts > 5), signal, least=3, longest=1.5) == [(0, 2), (3, 5), (6, 8)]


@given(
    seed=st.integers(0, 1000),
    factor=st.one_of(st.floats(0.01, 100), st.floats(-100, -0.01)),
    failing=st.floats(0.0, 0.7),
    wrapped=st.booleans(),
)
def test_the_factor_between_position_and_velocity_is_found(seed, factor, failing, wrapped):
    ts = uneven(seed, 4000)
    q, v = motion(ts), speed(ts) / factor
    q[: round(failing * 4000)] = q[0]
    q = np.mod(q, 2 * np.pi) if wrapped else q
    ratio = velocity_ratio(ts, q, v, longest=0.01, accuracy=EXACT)
    assert ratio.factor == pytest.approx(factor, rel=0.02)
    assert ratio.misfit < 0.05


def test_nothing_is_said_of_noise_and_rest():
    ts, rng = uneven(0), np.random.default_rng(0)
    still = Accuracy(quantum=0.0, noise=1.0)
    for q, v in ((rng.normal(size=2000), speed(ts)), (motion(ts), rng.normal(size=2000)), (0 * ts, speed(ts))):
        assert not velocity_ratio(ts, q, v, longest=0.01, accuracy=(still, still)).known


def test_jumps_are_told_from_wraps_and_gaps():
    ts = np.arange(6.0)
    q = np.array([0.0, 0.1, 0.2 + 2 * np.pi, 0.3, 4.5, 4.6])
    turns, others = jumps(ts, q, longest=1.5)
    assert (turns.tolist(), others.tolist()) == ([1, 2], [3])
    assert [len(each) for each in jumps(ts, q, longest=0.5)] == [0, 0]


def test_a_fast_wheel_wraps_by_a_turn_and_a_step_or_two():
    ts = np.delete(np.arange(200.0), np.arange(20, 200, 27))
    turned = 0.9 * ts  # A seventh of a turn from row to row, two sevenths where one is lost.
    turns, others = jumps(ts, turned % (2 * np.pi), longest=5.0)
    assert not len(others)
    assert len(turns) == int(turned[-1] / (2 * np.pi))
    spoiled = turned.copy()
    spoiled[100 + np.argmin(np.abs(turned[100:110] % (2 * np.pi) - 1.5))] += 2.5
    assert len(jumps(ts, spoiled % (2 * np.pi), longest=5.0)[1])


def test_a_gap_is_longer_than_five_usual_steps_even_where_time_stamps_come_in_bursts():
    assert longest_step(np.full(100, 0.01)) == pytest.approx(0.05)
    assert longest_step(np.tile([0.001, 0.001, 0.028], 50)) == pytest.approx(0.14)
    assert longest_step(np.full(100, 0.01), resample=0.1) == pytest.approx(0.2)


def test_the_smallest_change_is_one_count_of_a_rounded_signal_and_none_of_a_constant_one():
    assert least_change(0.3 + 0.01 * np.array([0, 0, 5, 4, 4, 0])) == pytest.approx(0.01)
    assert least_change(np.full(9, 0.3)) == 0
