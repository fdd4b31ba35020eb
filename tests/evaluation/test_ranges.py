"""Where training data lie: angles modulo turns, cyclic coordinates anywhere."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import Trajectory
from symoden.evaluation import Ranges
from symoden.spaces import Space


def swing(name="swing", *, samples=30, size=1):
    ts = 0.1 * np.arange(samples)
    q = np.stack([np.cos(ts + i) for i in range(size)], axis=1)
    rates = np.stack([-np.sin(ts + i) for i in range(size)], axis=1)
    return Trajectory(name=name, ts=ts, q=q, rates=rates, us=np.ones((samples, 1)))


def outside(ranges, recording, space):
    return ranges.outside(recording.q, recording.rates, recording.us, space)


def farthest_of(ranges, *arrays, space):
    found = ranges.farthest(*arrays, space)
    assert found is not None
    return found


@given(turns=st.integers(-5, 5), size=st.integers(1, 3))
def test_training_data_are_inside_their_range_however_often_angles_turned(turns, size):
    recording = swing(size=size)
    space = Space.parse(f"T{size}")
    ranges = Ranges.of([recording], space)
    turned = dataclasses.replace(recording, q=recording.q + 2 * np.pi * turns)
    assert not outside(ranges, turned, space).any()
    assert turns == 0 or outside(ranges, turned, Space.parse(f"R{size}")).all()


@given(
    middle=st.floats(-10, 10),
    ends=st.lists(st.tuples(st.floats(-1, 0), st.floats(0, 1), st.integers(-3, 3)), min_size=1, max_size=6),
    reach=st.floats(1.0, 3.1),
)
def test_recordings_that_are_a_turn_apart_have_seen_the_same_configurations(middle, ends, reach):
    """As of a hanging pendulum that is logged between −π and π."""
    recordings = [swing(size=1) for _ in ends]
    paths = [np.linspace(middle + reach * low, middle + reach * high, len(recordings[0])) for low, high, _ in ends]
    turned = [
        dataclasses.replace(recording, q=(path + 2 * np.pi * turns)[:, None])
        for recording, path, (_, _, turns) in zip(recordings, paths, ends, strict=True)
    ]
    space, joined = Space.parse("T1"), np.concatenate(paths)
    ((low, high),) = Ranges.of(turned, space).positions
    assert high - low <= np.ptp(joined) + 1e-9
    assert not any(outside(Ranges.of(turned, space), recording, space).any() for recording in turned)
    opposite = dataclasses.replace(turned[0], q=np.full_like(turned[0].q, middle + np.pi + 0.01 * np.sign(middle)))
    assert outside(Ranges.of(turned, space), opposite, space).all()
    length = Space.parse("R1")
    assert Ranges.of(turned, length).positions == ((min(t.q.min() for t in turned), max(t.q.max() for t in turned)),)


def test_an_angle_that_went_all_the_way_round_has_one_turn_of_configurations():
    recording = swing(size=2)
    q = np.stack([np.linspace(1.0, 9.0, len(recording)), np.linspace(-1.0, 2.0, len(recording))], axis=1)
    for space, first in (("T2", (-np.pi, np.pi)), ("R2", (1.0, 9.0))):
        parsed = Space.parse(space)
        low, high = Ranges.of([dataclasses.replace(recording, q=q)], parsed).configurations(parsed)
        np.testing.assert_allclose(np.stack([low, high], axis=1), [first, (-1.0, 2.0)])


@pytest.mark.parametrize("column", ["q", "rates", "us"])
def test_a_sample_that_training_never_saw_is_outside(column):
    recording = swing()
    values = getattr(recording, column).copy()
    values[7] = 1.5 if column == "q" else -1.5
    space = Space.parse("T1")
    ranges = Ranges.of([recording], space)
    away = outside(ranges, dataclasses.replace(recording, **{column: values}), space)
    assert np.flatnonzero(away).tolist() == [7]
    values[9] = np.nan  # A rollout that diverged.
    arrays = {name: values if name == column else getattr(recording, name) for name in ("q", "rates", "us")}
    away = ranges.outside(arrays["q"], arrays["rates"], arrays["us"], space)
    assert np.flatnonzero(away).tolist() == [7, 9]


def test_wherever_a_cyclic_coordinate_is_all_was_seen():
    recording = swing(size=2)
    space, q = Space.parse("R2"), recording.q + np.array([100.0, 0.0])
    for cyclic, away in (((), True), (("q1",), False), (("q2",), True)):
        found = outside(Ranges.of([recording], space, cyclic=cyclic), dataclasses.replace(recording, q=q), space)
        assert (found == away).all()


@pytest.mark.parametrize("column", ["q", "rates", "us"])
def test_what_is_outside_by_less_than_the_margin_does_not_count(column):
    line, space = np.linspace(-1.0, 1.0, 30)[:, None], Space.parse("T1")
    recording = dataclasses.replace(swing(), q=line, rates=line, us=line)
    ranges = Ranges.of([recording], space)
    for beyond, away in ((0.01, False), (0.03, True)):
        arrays = {"q": recording.q, "rates": recording.rates, "us": recording.us}
        arrays[column] = np.full((30, 1), 1 + 2 * beyond)
        q, rates, us = arrays.values()
        assert (ranges.outside(q, rates, us, space, margin=0.02) == away).all()
        assert ranges.outside(q, rates, us, space).all()
        farthest = farthest_of(ranges, q, rates, us, space=space)
        assert farthest.of == {"q": "position", "rates": "rate", "us": "input"}[column]
        assert farthest.here == pytest.approx((1 + 2 * beyond,) * 2)
        assert farthest.training == (-1.0, 1.0)
        assert farthest.share == pytest.approx(beyond, rel=1e-6)


def test_the_farthest_column_is_the_one_that_goes_beyond_by_most_of_its_own_range():
    recording = swing(size=2)
    space, rates = Space.parse("R1 T1"), recording.rates * [1.0, 50.0]
    ranges = Ranges.of([dataclasses.replace(recording, rates=rates)], space)
    q, pushed = recording.q + np.array([0.5, 20 * np.pi]), rates + np.array([0.0, 10.0])
    farthest = farthest_of(ranges, q, pushed, None, space=space)  # By a quarter, not at all, nor by a tenth.
    assert (farthest.of, farthest.column) == ("position", 0)
    assert farthest_of(ranges, recording.q, pushed, recording.us, space=space).column == 1
    assert ranges.farthest(recording.q, rates, recording.us, space) is None


@given(turns=st.integers(-5, 5))
def test_an_angle_beyond_training_is_named_by_the_turn_next_to_it(turns):
    recording, space = swing(), Space.parse("T1")
    ranges = Ranges.of([recording], space)
    q = recording.q.copy()
    q[3:5, 0] = 1.5, math.nan  # A rollout that diverged.
    farthest = farthest_of(ranges, q + 2 * np.pi * turns, recording.rates, None, space=space)
    np.testing.assert_allclose(farthest.here, (recording.q.min(), 1.5))
