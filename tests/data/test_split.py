"""Splitting loses no sample, and what is chosen by is never what is learned from."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Dataset, Trajectory, halves, segments, split_validation, validates_by_ends


def recording(samples, name="run", start=0.0, initial_samples=1):
    q = start + np.cumsum(np.random.default_rng(samples).normal(size=(samples, 1)), axis=0)
    q -= q[0] - start
    u = np.full((samples, 1), float(len(name)))
    ts = 0.1 * np.arange(samples)
    return Trajectory(name=name, ts=ts, q=q, rates=q + 1, us=u, initial_samples=initial_samples)


@given(samples=st.integers(10, 300), seconds=st.floats(0.3, 40.0))
def test_segments_put_together_are_the_recording(samples, seconds):
    trajectory = recording(samples)
    parts = segments(trajectory, seconds)
    np.testing.assert_array_equal(np.concatenate([part.ts for part in parts]), trajectory.ts)
    np.testing.assert_array_equal(np.concatenate([part.q for part in parts]), trajectory.q)


@given(count=st.integers(2, 12), each=st.integers(5, 40))
def test_segments_that_fit_are_equally_long(count, each):
    parts = segments(recording(count * each), 0.1 * each)
    assert [len(part) for part in parts] == [each] * count
    assert [part.name for part in parts] == [f"run#{k + 1}" for k in range(count)]


def test_a_recording_of_one_segment_keeps_its_name():
    assert segments(recording(20), 5.0)[0].name == "run"


def test_segments_too_short_for_a_recording_are_refused():
    with pytest.raises(DataError, match=r"`split_every` must leave at least 4 samples .* got 0.2 s for samples 0.1 s"):
        segments(recording(50, initial_samples=3), 0.2)


@given(lengths=st.lists(st.integers(20, 60), min_size=1, max_size=9), fraction=st.floats(0.1, 0.9))
def test_few_recordings_give_their_ends(lengths, fraction):
    train = tuple(recording(samples, f"run{i}", start=i) for i, samples in enumerate(lengths))
    split = split_validation(Dataset(name="arm", space="R1", train=train), fraction)
    for whole, head, tail in zip(train, split.train, split.validation, strict=True):
        np.testing.assert_array_equal(np.concatenate([head.ts, tail.ts]), whole.ts)
        assert (head.name, tail.name) == (whole.name, f"{whole.name}#tail")
        assert len(tail) == pytest.approx(fraction * len(whole), abs=0.5 + 1e-9)


@given(states=st.integers(10, 40), inputs=st.integers(1, 3), fraction=st.floats(0.05, 0.9))
def test_many_recordings_are_held_out_whole_together_with_those_of_the_same_start(states, inputs, fraction):
    train = tuple(recording(12 + i, "u" * (k + 1), start=i) for k in range(inputs) for i in range(states))
    split = split_validation(Dataset(name="arm", space="R1", train=train), fraction)
    assert sorted(map(id, split.train + split.validation)) == sorted(map(id, train))
    assert not {t.q[0, 0] for t in split.train} & {t.q[0, 0] for t in split.validation}
    assert len(split.validation) == inputs * max(1, round(fraction * states))


@pytest.mark.parametrize("rests", [0, 20, 60, 150, 300])
def test_what_is_held_out_moves_where_a_recording_ends_at_rest(rests):
    moving = 300 - rests
    ts = 0.01 * np.arange(300)
    rates = np.where(np.arange(300) < moving, np.cos(9 * ts), 1e-3 * np.sin(50 * ts))[:, None] * [1.0, 0.0]
    q = np.cumsum(0.01 * rates, axis=0)
    whole = Trajectory(name="step", ts=ts, q=q, rates=rates, us=np.zeros((300, 0)))
    split = split_validation(Dataset(name="step", space="R2", train=(whole,)), 0.15, min_samples=12)
    (held,) = split.validation
    assert np.ptp(held.q[:, 0]) > 0.03 or rests == 300
    assert validates_by_ends(split)
    # No sample is lost, and at most a quarter of the motion is not learned from.
    every = sorted((*split.train, held), key=lambda part: part.ts[0])
    np.testing.assert_array_equal(np.concatenate([part.q for part in every]), q)
    assert [part.name for part in every] == ["step", "step#tail", "step#rest"][: len(every)]
    assert sum(np.sum(part.ts < ts[-1] - 0.01 * rests) for part in split.train) >= 0.7 * moving
    assert len(every) == (3 if rests in (60, 150) else 2)
    # Beside others whose ends move it keeps its motion.
    others = [dataclasses.replace(whole, name=name, q=whole.q + 1, rates=whole.rates + 1.0) for name in "ab"]
    split = split_validation(Dataset(name="step", space="R2", train=(whole, *others)), 0.15, min_samples=12)
    assert [len(part) for part in split.validation] == [45, 45, 45]
    assert [len(part) for part in split.train] == [255, 255, 255]


@given(st.floats(0.2, 3.0))
def test_what_is_held_out_of_a_swing_that_dies_out_still_moves(decay):
    ts = 0.02 * np.arange(500)
    swing = np.exp((-decay + 6j) * ts)
    run = Trajectory(
        name="swing", ts=ts, q=swing.real[:, None], rates=((-decay + 6j) * swing).real[:, None], us=np.zeros((500, 0))
    )
    split = split_validation(Dataset(name="swing", space="T1", train=(run,)), 0.1, min_samples=10)
    (held,) = split.validation
    usual, kept = (np.sqrt(np.mean(rates**2)) for rates in (run.rates, split.train[0].rates))
    assert np.sqrt(np.mean(held.rates**2)) > 0.15 * usual
    assert kept > 0.9 * usual  # Most of the large motion is left to learn from.
    assert sum(map(len, split.train + split.validation)) == len(run)


def test_given_validation_recordings_stay():
    dataset = Dataset(name="arm", space="R1", train=(recording(30, "a"),), validation=(recording(40, "b"),))
    assert split_validation(dataset) is dataset


def test_recordings_too_short_to_cut_stay_whole():
    dataset = Dataset(name="arm", space="R1", train=(recording(30, "a"), recording(100, "b")))
    split = split_validation(dataset, 0.1, min_samples=8)
    assert [len(t) for t in split.train] == [30, 90]
    assert [t.name for t in split.validation] == ["b#tail"]


def test_nothing_to_hold_out_is_refused():
    with pytest.raises(DataError, match=r"hold out 10% of them: 20 .* got 1 recording of 5 samples\."):
        split_validation(Dataset(name="arm", space="R1", train=(recording(5),)), 0.1)


@given(fraction=st.floats(0.02, 0.98), least=st.integers(2, 8))
def test_a_recording_as_long_as_the_refusal_says_is_split(fraction, least):
    short = Dataset(name="arm", space="R1", train=(recording(3),))
    with pytest.raises(DataError, match="got 1 recording of 3 samples") as caught:
        split_validation(short, fraction, min_samples=least)
    (needed,) = map(int, re.findall(r"(\d+) samples or more", str(caught.value)))
    split = split_validation(Dataset(name="arm", space="R1", train=(recording(needed),)), fraction, min_samples=least)
    assert min(len(split.train[0]), len(split.validation[0])) >= least


@pytest.mark.parametrize("fraction", [0.0, 1.0])
def test_a_share_of_nothing_or_all_is_refused(fraction):
    with pytest.raises(ValueError, match="`fraction` must be between 0 and 1"):
        split_validation(Dataset(name="arm", space="R1", train=(recording(50),)), fraction)


def test_short_recordings_of_few_initial_states_give_whole_groups():
    ts = np.arange(4.0)
    recordings = tuple(
        Trajectory(name=f"r{k}", ts=ts, q=ts[:, None] + k // 9, rates=np.ones((4, 1)), us=np.full((4, 1), float(k)))
        for k in range(36)
    )
    split = split_validation(Dataset(name="short", space="R1", train=recordings), 0.1, min_samples=4)
    assert len(split.validation) == 9
    assert {r.q[0, 0] for r in split.validation}.isdisjoint({r.q[0, 0] for r in split.train})


@given(lengths=st.lists(st.integers(5, 300), min_size=1, max_size=9))
def test_halves_share_out_recordings_evenly_and_lose_none(lengths):
    parts = [recording(samples, name=f"run{k}") for k, samples in enumerate(lengths)]
    sides = halves(parts)
    assert sorted(each.name for side in sides for each in side) == [each.name for each in parts]
    for side in sides:
        assert list(side) == sorted(side, key=lambda each: each.name)
    more, less = sorted((sum(map(len, side)) for side in sides), reverse=True)
    assert more - less <= max(lengths)


def test_pieces_of_one_recording_are_on_one_side_and_those_that_take_turns_on_both():
    names = ["a#1", "b#1", "a#2", "b#2", "a#3#tail"]
    sides = halves([recording(20, name=name) for name in names])
    assert [[each.name for each in side] for side in sides] == [["a#1", "a#2", "a#3#tail"], ["b#1", "b#2"]]
    first, second = halves([recording(20, name=f"{'AB'[k % 2]}{k}") for k in range(8)])
    assert sorted(each.name[0] for each in first) == sorted(each.name[0] for each in second) == [*"AABB"]
