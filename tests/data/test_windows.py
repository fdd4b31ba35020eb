"""Every window is a stretch of one recording, and every stretch is a window."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Trajectory, windows


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
