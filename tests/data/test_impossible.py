"""Numbers that no machine has are named and left out, and none that one may have."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset

from .conftest import NAMES, arm, found, written


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
    with pytest.warns(
        DataWarning, match=f"left out in `run0`: 1 row with a number beyond 1e\\+20 in `{column}` .first at line 302"
    ):
        (recording,) = read_dataset(path).train
    assert len(recording) == 499


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
    with pytest.warns(DataWarning, match=r"with a placeholder for a missing number in"):
        assert sum(map(len, read_dataset(path).train)) == 500 - len(rows)


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
