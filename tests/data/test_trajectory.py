"""A trajectory holds what was recorded, unchangeably, and nothing else."""

import numpy as np
import pytest

from symoden.data import DataError, Trajectory
from symoden.data._trajectory import finite_numbers


def recording(**changes):
    ts = np.linspace(0.0, 1.0, 11)
    fields = {
        "name": "swing",
        "ts": ts,
        "q": np.sin(ts)[:, None],
        "rates": np.cos(ts)[:, None],
        "us": np.zeros((11, 0)),
    }
    return Trajectory(**{**fields, **changes})


def test_arrays_are_copies_that_cannot_be_written_to():
    ts = np.linspace(0.0, 1.0, 11)
    trajectory = recording(ts=ts)
    ts[0] = -1.0
    assert trajectory.ts[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.q[0] = 1.0


def test_whole_numbers_become_double_precision():
    assert recording(q=np.arange(11)[:, None]).q.dtype == np.float64


def test_a_part_keeps_time_stamps_and_settings():
    part = recording(initial_samples=2, noise_gain=3.0).cut(3, 8, name="part")
    assert (part.name, len(part), part.initial_samples, part.noise_gain) == ("part", 5, 2, 3.0)
    np.testing.assert_array_equal(part.ts, recording().ts[3:8])
    assert part.duration == pytest.approx(0.4)


BAD = [
    ({"q": np.zeros(11)}, r"`swing`: `q` must be an array of real numbers with 2 axes; got float64 with shape \(11,\)"),
    ({"us": np.zeros(11)}, r"An array `x` of one axis becomes a column by `x\[:, None\]`"),
    ({"us": np.zeros((11, 1), complex)}, "`us` must be an array of real numbers with 2 axes; got complex128"),
    ({"ts": np.array([["a"]])}, "`ts` must be an array of real numbers with 1 axis; got <U1"),
    ({"q": np.zeros((10, 1))}, r"must agree in T and n; got shapes \(11,\), \(10, 1\)"),
    ({"rates": np.zeros((11, 2))}, "must agree in T and n"),
    ({"q": np.zeros((11, 0)), "rates": np.zeros((11, 0))}, "at least one coordinate"),
    ({"us": np.full((11, 1), np.inf)}, "`us`, row 0: must be finite; got inf"),
    (
        {"ts": np.r_[0.0, 0.2, 0.1, np.linspace(1, 2, 8)]},
        r"`swing`: `ts`, row 2: times must increase; got 0.1 after 0.2",
    ),
    ({"ts": np.zeros(11)}, r"row 1: times must increase; .*10 such rows"),
    ({"initial_samples": 0}, "`initial_samples` must be at least 1"),
    ({"initial_samples": 11}, "leave a sample to score; got 11 of 11 samples"),
    ({"noise_gain": 0.0}, "`noise_gain` must be positive and finite; got 0.0"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_what_is_no_recording_is_refused(changes, message):
    with pytest.raises(DataError, match=message):
        recording(**changes)


def test_a_notebook_shows_a_line_and_no_arrays():
    assert repr(recording()) == "Trajectory('swing': 11 samples, 1 s, n = 1, m = 0)"
    assert repr(recording(noise_gain=3.0)).endswith("m = 0, estimated rates)")


def test_one_sample_is_refused():
    with pytest.raises(DataError, match="at least 2 samples; got 1"):
        Trajectory(name="swing", ts=np.zeros(1), q=np.zeros((1, 1)), rates=np.zeros((1, 1)), us=np.zeros((1, 0)))


def test_rows_of_different_length_are_refused():
    with pytest.raises(DataError, match="`q` must be an array of numbers; got rows of different length"):
        finite_numbers([[1.0], [2.0, 3.0]], "`q`", axes=2)
