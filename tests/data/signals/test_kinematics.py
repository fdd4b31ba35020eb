"""Velocities are compared with their positions where the machine moves, however long it rests and chatters."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import lfilter

from symoden.data import check_dataset
from tests.data.conftest import arm, found, scale, written


def resting(seed=0, *, samples=4000, every=2.0, chatter=0.3, filtered=0.0):
    """A log of two joints that go to another place every few seconds, in 0.3 s, and chatter at rest."""
    rng = np.random.default_rng(seed)
    t = 0.005 * np.arange(samples)
    log = arm(seed, samples=samples, jitter=0.0)
    log[:, 0] = t
    starts = np.arange(0.5, t[-1], every)
    for k in (0, 1):
        by = rng.choice([-1, 1], len(starts)) * rng.uniform(0.15, 0.3, len(starts))
        s = np.clip((t[:, None] - starts - 0.1 * k) / 0.3, 0.0, 1.0)
        log[:, 1 + k] = (s**2 * (3 - 2 * s)) @ by + 1e-3 * rng.normal(size=samples)
        log[:, 3 + k] = (6 * s * (1 - s) / 0.3) @ by + chatter * np.sqrt(1 - filtered**2) * lfilter(
            [1.0], [1.0, -filtered], rng.normal(size=samples)
        )
    return log


@pytest.mark.parametrize(
    ("factors", "kind", "channel"),
    [
        ({"v1": -1.0}, "sign", "v1"),
        ({"q1": 180 / np.pi}, "unit", "q1"),
        ({"v2": 180 / np.pi}, "unit", "q2"),
        ({"t": 1000.0}, "unit", ""),
    ],
)
def test_what_is_wrong_with_a_velocity_is_seen_where_a_machine_that_mostly_rests_moves(
    tmp_path, factors, kind, channel
):
    assert found(written(tmp_path, scale(resting(every=3.0, chatter=0.2), **factors))) == [(kind, "warning", channel)]


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), every=st.floats(0.5, 8.0), chatter=st.floats(0.0, 1.5))
def test_nothing_is_wrong_with_a_machine_that_rests_and_chatters(tmp_path_factory, seed, every, chatter):
    log = resting(seed, every=every, chatter=chatter)
    assert found(written(tmp_path_factory.mktemp("rests"), log)) == []


@pytest.mark.parametrize(("filtered", "chatter"), [(0.6, 0.2), (0.6, 0.5), (0.8, 0.1)])
def test_a_filter_that_makes_chatter_slow_makes_no_motion_of_it(tmp_path, filtered, chatter):
    logs = [resting(seed, every=4.0, chatter=chatter, filtered=filtered) for seed in range(3)]
    assert found(written(tmp_path, *logs)) == []


@pytest.mark.parametrize("factor", [1.0, 180 / np.pi])
def test_a_position_that_a_filter_makes_late_is_not_called_one_in_another_unit(tmp_path, factor):
    t = 0.005 * np.arange(4000)
    log = arm(0, samples=len(t), jitter=0.0)
    log[:, 0] = t
    for k in (0, 1):
        log[:, 1 + k] = 0.2 * np.sin(14 * t + k) + 0.1 * np.sin(23 * t)
        log[:, 3 + k] = 2.8 * np.cos(14 * t + k) + 2.3 * np.cos(23 * t)
    log[:, 1] = lfilter([0.1], [1.0, -0.9], log[:, 1])  # 45 ms
    path = written(tmp_path, scale(log, v1=factor))
    assert found(path) == [("velocity", "warning", "v1")]
    (one,) = check_dataset(path).recordings[0].findings
    assert "`q1` follows the integral of `v1` about 0.0" in one.text
    assert ("look at its unit" in one.text) == (factor != 1.0)


@pytest.mark.parametrize("factor", [-1 / 30, 3.0])
def test_an_angle_that_is_wrapped_where_it_is_fastest_tells_its_velocitys_unit(tmp_path, factor):
    log = arm(0, samples=300, step=0.025, jitter=0.0)
    t = log[:, 0]
    q = np.pi + 2 * np.sin(14 * t) + 0.3 * np.sin(3 * t)
    log[:, 1], log[:, 3] = np.mod(q + np.pi, 2 * np.pi) - np.pi, factor * (28 * np.cos(14 * t) + 0.9 * np.cos(3 * t))
    (velocity,) = (one for one in check_dataset(written(tmp_path, log)).recordings[0].channels if one.name == "v1")
    assert velocity.ratio == pytest.approx(1 / factor, rel=0.02)
