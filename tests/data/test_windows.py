"""Every window is a stretch of one recording, and every stretch is a window."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Trajectory, least_motion, windows, with_few_rests


def recording(samples, seed=0, n=2, m=1):
    values = np.random.default_rng(seed).normal(size=(samples, 2 * n + m))
    q, rates, us = np.split(values, [n, 2 * n], axis=1)
    ts = np.cumsum(0.1 + np.abs(values[:, 0]))
    return Trajectory(name=f"run{seed}", ts=ts, q=q, rates=rates, us=us)


@given(
    lengths=st.lists(st.integers(8, 20), min_size=1, max_size=4), horizon=st.integers(1, 7), stride=st.integers(1, 5)
)
def test_windows_are_all_stretches_at_the_stride(lengths, horizon, stride):
    trajectories = [recording(samples, seed) for seed, samples in enumerate(lengths)]
    cut = windows(trajectories, horizon, stride=stride)
    stretches = [(t, slice(k, k + horizon + 1)) for t in trajectories for k in range(0, len(t) - horizon, stride)]
    assert len(cut) == len(stretches)
    for i, (trajectory, part) in enumerate(stretches):
        np.testing.assert_array_equal(cut.q[i], trajectory.q[part])
        np.testing.assert_array_equal(cut.rates[i], trajectory.rates[part])
        np.testing.assert_array_equal(cut.us[i], trajectory.us[part])
        np.testing.assert_array_equal(cut.ts[i], trajectory.ts[part] - trajectory.ts[part.start])


def test_the_papers_windows_are_seventeen_per_trajectory():
    assert len(windows([recording(20, seed) for seed in range(5)], 3)) == 5 * 17


def test_free_motion_has_windows_without_inputs():
    assert windows([recording(9, m=0)], 3).us.shape == (6, 4, 0)


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (("a", "b", "c"), [0, 1, 2]),
        (("a#1", "b#1", "a#2", "c"), [0, 1, 0, 2]),
        (("a#1", "a#2", "b#1", "b#2"), [0, 1, 2, 3]),  # Two logs do not tell how much they differ.
    ],
)
def test_windows_know_their_log(names, numbers):
    found = windows([dataclasses.replace(recording(9), name=name) for name in names], 3, stride=3)
    assert found.recording.tolist() == np.repeat(numbers, 2).tolist()


def test_a_clock_that_counts_from_1970_keeps_its_steps_in_single_precision():
    trajectory = recording(9)
    late = Trajectory(name="late", ts=trajectory.ts + 1.7e9, q=trajectory.q, rates=trajectory.rates, us=trajectory.us)
    np.testing.assert_allclose(windows([late], 3).ts.astype(np.float32), windows([trajectory], 3).ts, atol=1e-5)


@pytest.mark.parametrize("samples", [2, 8])
def test_a_recording_shorter_than_a_window_is_refused(samples):
    with pytest.raises(
        DataError, match=f"`run0`: a recording must be longer than a window of 9 samples; got {samples}"
    ):
        windows([recording(20, 1), recording(samples)], 8)


def test_no_trajectory_is_refused():
    with pytest.raises(DataError, match="at least one trajectory"):
        windows([], 3)


@pytest.mark.parametrize(("horizon", "stride"), [(0, 1), (3, 0)])
def test_a_horizon_or_stride_below_one_is_refused(horizon, stride):
    with pytest.raises(ValueError, match=f"must be at least 1; got {horizon} and {stride}"):
        windows([recording(9)], horizon, stride=stride)


def stops(moving, resting, *, noise=0.0, counts=None, seed=0):
    """A joint that turns for a while, and then rests."""
    rng = np.random.default_rng(seed)
    ts = 0.01 * np.arange(moving + resting)
    q = np.minimum(0.5 * ts, 0.5 * ts[moving])[:, None] + rng.normal(0, noise, (moving + resting, 1))
    if counts:
        q = np.round(q * counts) / counts
    return Trajectory(name=f"stops{seed}", ts=ts, q=q, rates=np.gradient(q, ts, axis=0), us=np.zeros((len(ts), 1)))


@given(
    moving=st.integers(1, 30), resting=st.integers(0, 40), noise=st.sampled_from([0.0, 1e-4]), seed=st.integers(0, 9)
)
def test_all_windows_that_move_are_kept_and_a_tenth_that_rests(moving, resting, noise, seed):
    logs = [stops(10 * moving, 10 * resting + 1, noise=noise, seed=seed)]
    every = windows(logs, 10, stride=10)
    kept = with_few_rests(every, least_motion(logs))
    assert len(every) == moving + resting
    np.testing.assert_array_equal(kept.q[:moving], every.q[:moving])
    assert len(kept) - moving == min(resting, max(1, moving // 9))
    if resting:
        np.testing.assert_array_equal(kept.q[moving], every.q[moving])  # The first rest is one of them.


@pytest.mark.parametrize("sensor", [{"counts": 2000}, {"noise": 3e-4}, {"noise": 3e-4, "counts": 2000}])
def test_rests_are_known_by_sensors_that_round_and_are_noisy(sensor):
    logs = [stops(600, 1401, seed=seed, **sensor) for seed in range(2)]
    assert len(with_few_rests(windows(logs, 20, stride=20), least_motion(logs))) == 60 + 60 // 9


def test_noise_as_large_as_the_motion_is_no_rest():
    logs = [stops(100, 301, noise=0.1)]
    every = windows(logs, 10, stride=10)
    assert with_few_rests(every, least_motion(logs)) is every


def test_a_joint_that_moves_alone_is_no_rest():
    log = stops(200, 401)
    logs = [Trajectory(name="two", ts=log.ts, q=log.q[:, [0, 0]] * [0, 1], rates=log.rates[:, [0, 0]], us=log.us)]
    kept = with_few_rests(windows(logs, 10, stride=10), least_motion(logs))
    assert len(kept) == 20 + 2


def test_where_nothing_moves_all_windows_stay():
    every = windows([stops(1, 100)], 10, stride=10).take(np.arange(1, 9))
    assert len(with_few_rests(every, np.array([0.1]))) == 8
