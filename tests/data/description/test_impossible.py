"""Numbers that no machine has are named and left out, and none that one may have."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import NAMES, arm, found, written

BEYOND = r"1 row with a number beyond 1e\+20 in `{}` .first at line 302"
BRIDGED = r"1 missing number of `{}` .interpolated"


@pytest.mark.parametrize("column", NAMES)
@pytest.mark.parametrize("number", [1e300, -2e20])
def test_a_number_that_no_machine_has_is_named_and_left_out(tmp_path, column, number):
    log = arm(samples=500)
    log[300, NAMES.index(column)] = number
    path = written(tmp_path, log, more="units = {q1 = 1.0}")
    assert found(path) == [("impossible", "masked", column)]
    (check,) = check_dataset(path).recordings
    assert f"`{column}` has 1 number beyond 1e+20, first at line 302 (row 300): {number:g}" in check.findings[0].text
    assert check.duration == pytest.approx(np.ptp(np.delete(log[:, 0], 300)))
    is_input = column in NAMES[5:]
    with pytest.warns(DataWarning, match=f"left out in `run0`: {(BRIDGED if is_input else BEYOND).format(column)}"):
        (recording,) = read_dataset(path).train
    assert len(recording) == (500 if is_input else 499)


@pytest.mark.parametrize("column", NAMES[1:])
@pytest.mark.parametrize("number", [-9999, 999, 65535, -32768])
@pytest.mark.parametrize("rows", [[300], [7, 200, 201, 202, 203, 204, 205, 206, 207, 208]])
def test_a_placeholder_is_named_and_left_out(tmp_path, column, number, rows):
    log = arm(samples=500)
    log[rows, NAMES.index(column)] = number
    path = written(tmp_path, log)
    assert ("impossible", "masked", column) in found(path)
    assert not {kind for kind, *_ in found(path)} - {"impossible", "gap", "time"}
    (check,) = check_dataset(path).recordings
    said = f"`{column}` has {len(rows)} placeholder{'s' if len(rows) > 1 else ''} for missing numbers, first at line"
    assert f"{said} {rows[0] + 2} (row {rows[0]}): {number}" in check.findings[0].text
    used = column in NAMES[5:]  # All but the long run of them is bridged.
    with pytest.warns(DataWarning, match=r"a placeholder for a missing number in" if not used else "missing number"):
        assert sum(map(len, read_dataset(path).train)) == 500 - len(rows) + used


def test_a_placeholder_is_known_whatever_its_unit(tmp_path):
    log = arm(samples=500)
    log[300, 1] = -9999
    path = written(tmp_path, log, more='units = {q1 = "deg", v1 = "deg/s"}')
    (check,) = check_dataset(path).recordings
    assert "1 placeholder for missing numbers, first at line 302 (row 300): -9999" in check.findings[0].text


@pytest.mark.parametrize("more", ["zeros = {u1 = 2048}", "units = {u1 = 0.0045}\nzeros = {u1 = 2048}"])
def test_a_placeholder_is_known_whatever_its_zero(tmp_path, more):
    log = arm(samples=500)
    log[:, 5] = np.round(log[:, 5] * 100) + 2048
    log[300, 5] = 65535
    (check,) = check_dataset(written(tmp_path, log, more=more)).recordings
    assert "1 placeholder for missing numbers, first at line 302 (row 300): 65535" in check.findings[0].text


def test_a_placeholder_is_known_beside_counts_that_are_off_zero(tmp_path):
    log = arm(samples=500)
    log[:, 5] = np.round(30 * np.sin(np.arange(500) / 20)) + 2048
    log[300, 5] = -9999
    path = written(tmp_path, log)
    assert ("impossible", "masked", "u1") in found(path)
    log[:, 5] = np.round(np.sin(np.arange(500) / 20)) + 1048  # Nor is it one beside numbers of its size.
    log[300, 5] = 999
    assert "impossible" not in {kind for kind, *_ in found(written(tmp_path, log))}


@pytest.mark.parametrize("levels", [(0, 999), (-999, 0, 999), (0, 500, 999), (999, 998.5)])
def test_commands_that_are_large_are_no_placeholders(tmp_path, levels):
    log = arm(samples=500)
    log[:, 5] = np.resize(np.repeat(levels, 37), 500)
    assert "impossible" not in {kind for kind, *_ in found(written(tmp_path, log))}


def test_a_number_that_its_unit_makes_infinite_is_impossible(tmp_path):
    log = arm(samples=500)
    log[300, 5] = 1e308
    path = written(tmp_path, log, more="units = {u1 = 1e3}")
    assert "`u1` has 1 number beyond 1e+20, first at line 302 (row 300): inf" in (
        check_dataset(path).recordings[0].findings[0].text
    )


def described(folder, log, formulas):
    """A description whose first input, and position where they say so, are made by formulas."""
    path = written(folder, log, more=f"formulas = {{ {formulas} }}")
    text = path.read_text().replace('inputs = ["u1"', 'inputs = ["u"')
    path.write_text(text.replace('positions = ["q1"', 'positions = ["q"') if "q =" in formulas else text)
    return path


@pytest.mark.parametrize("formula", ["u = '0.001 * u1'", "u = 'u1 - u2'", "u = 'clip(u1, -1, 1)', q = 'q1 - 0*u1'"])
@pytest.mark.parametrize("number", [999, -32768, 1e30])
def test_a_placeholder_is_known_whatever_formulas_make_of_it(tmp_path, formula, number):
    log = arm(samples=500)
    log[[300, 400], 5] = number
    path = described(tmp_path, log, formula)
    what = "numbers beyond 1e+20" if number == 1e30 else "placeholders for missing numbers"
    (check,) = check_dataset(path).recordings
    (one,) = (each for each in check.findings if each.kind in ("impossible", "missing"))
    assert (one.channel, one.level) == ("u1", "masked")
    assert f"`u1` has 2 {what}, first at line 302 (row 300): {number:.10g}" in one.text
    with pytest.warns(DataWarning, match="left out in `run0`"):
        (recording,) = read_dataset(path).train
    assert len(recording) == (498 if "q =" in formula else 500)
    assert np.ptp(recording.us[:, 0]) < 5


def test_what_formulas_make_of_ordinary_numbers_is_ordinary(tmp_path):
    assert found(described(tmp_path, arm(samples=500), "u = '999 + u1'")) == []
