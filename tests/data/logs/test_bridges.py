"""Single missing numbers of inputs are bridged as the input is made, and their rows used."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import arm, found, written


def log_of(u, rows, *columns):
    """A log at an even rate whose first input is that, and lacks numbers; so do other columns there."""
    log = arm(samples=500, jitter=0.0)
    log[:, 5] = u
    log[np.ix_(rows, [5, *columns])] = np.nan
    return log


def bridged(path, said):
    """The first input of the recordings that are made, and their numbers of samples."""
    with pytest.warns(DataWarning, match=said):
        recordings = read_dataset(path).train
    return np.concatenate([each.us[:, 0] for each in recordings]), [len(each) for each in recordings]


SINE = np.sin(0.3 * np.arange(500))
STEPS = np.repeat(np.random.default_rng(0).normal(size=25), 20)


@pytest.mark.parametrize("rows", [[100], [100, 200, 201], [100, 101, 102, 103]])
@pytest.mark.parametrize("more", ["", 'hold = "linear"'])
def test_an_input_that_is_smooth_is_interpolated(tmp_path, rows, more):
    count = f"{len(rows)} missing number{'s' if len(rows) > 1 else ''}"
    path = written(tmp_path, log_of(SINE, rows), more=more)
    u, lengths = bridged(path, f"left out in `run0`: {count} of `u1` .interpolated")
    assert lengths == [500]
    ends = [rows[0] - 1, rows[-1] + 1] if rows[-1] - rows[0] == len(rows) - 1 else None
    expected = np.interp(rows, ends, SINE[ends]) if ends else SINE[rows]
    np.testing.assert_allclose(u[rows], expected, atol=1e-12 if ends else 0.15)
    assert found(path) == [("missing", "masked", "u1")]


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_an_input_that_is_made_of_steps_is_held(tmp_path, noise):
    steps = STEPS + noise * np.random.default_rng(1).normal(size=500)
    path = written(tmp_path, log_of(steps, [100, 119, 120]))
    u, lengths = bridged(path, "3 missing numbers of `u1` .held at the number before")
    assert lengths == [500]
    np.testing.assert_allclose(u[[100, 119, 120]], steps[[99, 118, 118]])


def test_a_step_that_lacks_a_number_is_a_straight_line_if_the_description_says_so(tmp_path):
    path = written(tmp_path, log_of(STEPS, [100]), more='hold = "linear"')
    u, _ = bridged(path, "interpolated")
    assert u[100] == pytest.approx((STEPS[99] + STEPS[101]) / 2)


def test_no_gap_is_bridged(tmp_path):
    rows = [100, *range(200, 206)]
    path = written(tmp_path, log_of(SINE, rows))
    _, lengths = bridged(path, "1 missing number of `u1` .interpolated., 6 rows without all numbers, 1 gap")
    assert lengths == [200, 294]
    (check,) = check_dataset(path).recordings
    (one,) = (each for each in check.findings if each.kind == "missing")
    assert "`u1` lacks 7 of 500 numbers, in 2 stretches" in one.text
    assert "In 1 of these rows the input is interpolated; the others are left out" in one.advice
    assert check.missing == 6


def test_ends_are_left_out(tmp_path):
    _, lengths = bridged(written(tmp_path, log_of(SINE, [0, 499])), "2 rows without all numbers")
    assert lengths == [498]


@pytest.mark.parametrize("column", [1, 3])
def test_a_row_that_lacks_more_is_left_out(tmp_path, column):
    log = log_of(SINE, [100], column)
    log[300, 5] = np.nan
    _, lengths = bridged(written(tmp_path, log), r"`run0`: 1 missing number of `u1` .interpolated., 1 row without all")
    assert lengths == [499]


def test_inputs_that_lack_numbers_in_the_same_row_are_bridged_each_in_its_way(tmp_path):
    log = log_of(SINE, [100], 6)
    log[:, 6] = STEPS
    log[100, 6] = np.nan
    with pytest.warns(DataWarning, match=r"1 missing number of `u1` .interpolated., 1 missing number of `u2` .held"):
        (recording,) = read_dataset(written(tmp_path, log)).train
    np.testing.assert_allclose(recording.us[100], [(SINE[99] + SINE[101]) / 2, STEPS[99]])
