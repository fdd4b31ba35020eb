"""A file whose sensor has another zero is named so, and no sign or unit is accused for it."""

import dataclasses

import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.data.dynamics._contradictions import find_contradictions
from symoden.data.dynamics._other_zeros import Zero, best_offset

STEP, IS_ANGLE = 0.01, np.array([True])


def beam(name, seed, *, push, samples=400, force=0.0, shake=0.02):
    """A beam that gravity holds, beneath a rotor whose push hardly changes."""
    rng = np.random.default_rng(seed)
    us = push + shake * np.repeat(rng.uniform(-1, 1, samples // 40 + 1), 40)[:samples]
    states, q, v = np.zeros((samples, 2)), rng.uniform(-0.1, 0.1), 0.0
    for k in range(samples):
        states[k] = q, v
        for _ in range(10):
            v += STEP / 10 * (us[k] + force - 12 * np.sin(q) - 0.3 * v)
            q += STEP / 10 * v
    states += rng.normal(0, 1e-4, states.shape) * [1, 10]
    return Trajectory(name=name, ts=STEP * np.arange(samples), q=states[:, :1], rates=states[:, 1:], us=us[:, None])


def moved(recording, way):
    return dataclasses.replace(recording, q=recording.q + way)


def found(*train, **more):
    dataset = Dataset(name="d", space="T1", train=train, input_names=("lift",), position_names=("tilt",), **more)
    return find_contradictions(dataset, IS_ANGLE)


PUSHES = {"a": 1.0, "b": 1.3, "c": 0.4, "d": 0.7}
BEAMS = [beam(name, seed, push=push) for seed, (name, push) in enumerate(PUSHES.items())]


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("way", [0.15, -0.15])
def test_another_zero_in_one_file_is_named_with_how_far_it_is_off(k, way):
    (finding,) = found(*(moved(each, way) if i == k else each for i, each in enumerate(BEAMS)))
    assert (finding.kind, finding.level, finding.channel) == ("zero", "warning", "tilt")
    how = "taken from" if way > 0 else "added to"
    only = f"`{'abcd'[k]}` (train) moves as the other recordings do only if 0.15 rad is {how} `tilt`: then these tell"
    assert finding.text.startswith(only)
    assert "Its sensor seems to have another zero there, or a constant force acts: home it, shift" in finding.advice


@pytest.mark.parametrize("way", [-2.0, -2.3])
def test_another_zero_that_a_turned_sign_mimics_is_not_called_one(way):
    push = 1.0  # As far as the turned push would hold it, or nearly so.
    (finding,) = found(*BEAMS[:3], moved(beam("d", 3, push=push), way * push / 12))
    assert finding.kind == "zero"


def test_a_constant_force_in_one_file_accuses_no_sign_or_unit():
    leaning = beam("d", 3, push=4.0, force=-8.0)  # By more than a zero may be off.
    assert not {finding.kind for finding in found(*BEAMS[:3], leaning)} & {"sign", "unit", "order", "delay", "zero"}


def test_a_sign_that_is_turned_where_inputs_change_is_no_zero():
    *shaken, odd = (beam(f"shaken {seed}", seed, push=0.0, samples=800, shake=2.0) for seed in range(3))
    (finding,) = found(*BEAMS, *shaken, dataclasses.replace(odd, us=-odd.us))
    assert (finding.kind, finding.text.split(" moves")[0]) == ("sign", "`shaken 2` (train)")


def test_files_that_agree_have_one_zero():
    assert found(*BEAMS) == []


def test_a_position_that_nothing_depends_on_has_no_zero():
    """Of a wheel on an upright axis no force tells where it is counted from."""
    wheel = [dataclasses.replace(each, q=np.cumsum(each.us, axis=0) * STEP, rates=each.us) for each in BEAMS]
    assert found(*wheel[:3], moved(wheel[3], 0.3)) == []


@pytest.mark.parametrize(
    ("right", "most", "unit", "words"),
    [
        (0.3, 0.5, "rad", "0.3 rad is added to `tilt`"),
        (-0.04, 0.5, "rad", "0.04 rad is taken from `tilt`"),
        (2.0, 10.0, "", "2 is added to `tilt`"),
        (0.7, 0.5, "rad", None),
    ],
)
def test_an_offset_is_the_one_that_explains_most_unless_it_is_too_far_off(right, most, unit, words):
    at = BEAMS[0]
    change = best_offset(Zero(0, "tilt", unit, most), lambda way: way.mend(at).q[:, 0] - at.q[:, 0] - right)
    assert (change and change.words) == words


def test_an_offset_that_changes_nothing_is_none():
    assert best_offset(Zero(0, "tilt", "rad", 0.5), lambda _: np.ones(3)) is None
