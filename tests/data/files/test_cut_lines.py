"""Lines that were cut off: their last cell may be cut as well, and does not count."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from symoden.data.files._readers import read_rows

TEXT = """
space = "T1"
time = "t"
positions = ["q"]
inputs = ["u"]
units = { t = "ms" }
[train]
files = ["run.csv"]
"""
SIGNALS = {"time": ("t",), "positions": ("q",), "inputs": ("u",)}
T = 40_000 + 5 * np.arange(400)


def written(folder, cut, *, separator=","):
    """A swing at 200 Hz with a speed that is not read: of some lines so many cells, the last of so many characters."""
    q, u = np.sin(0.003 * T), np.sign(np.sin(0.02 * T))
    lines = [[str(t), f"{angle:.4f}", "0.5", f"{push:.1f}"] for t, angle, push in zip(T, q, u, strict=True)]
    for row, (cells, characters) in cut.items():
        lines[row] = [*lines[row][: cells - 1], lines[row][cells - 1][:characters]]
    (folder / "run.csv").write_text("".join(f"{separator.join(cells)}\n" for cells in [["t", "q", "v", "u"], *lines]))
    (folder / "swing.toml").write_text(TEXT)
    return folder / "swing.toml"


def finding(path, kind):
    """What is found of one kind."""
    (check,) = check_dataset(path).recordings
    return [each for each in check.findings if each.kind == kind]


def test_a_stamp_that_was_cut_off_does_not_put_the_others_out_of_order(tmp_path):
    path = written(tmp_path, {101: (1, 3), 300: (1, 4)})
    assert (tmp_path / "run.csv").read_text().splitlines()[102] == "405"
    assert not finding(path, "time")
    (line,) = finding(path, "line")
    assert line.text == "line 103 (row 101) has 1 of 4 fields, and 1 more have too few"
    assert "which may be cut off" in line.advice
    assert "These rows are left out" in line.advice
    with pytest.warns(DataWarning, match="left out in `run`: 2 rows without all numbers"):
        (recording,) = read_dataset(path).train
    np.testing.assert_allclose(recording.ts, np.delete(T, [101, 300]) / 1000)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_the_last_cell_of_a_line_that_was_cut_off_is_missing(tmp_path, separator):
    written(tmp_path, {100: (2, 1), 200: (2, 3), 250: (2, 0), 260: (3, 1)}, separator=separator)
    read = read_rows(tmp_path / "run.csv", SIGNALS, slice(None)).signals
    assert np.flatnonzero(np.isnan(read["positions"][:, 0])).tolist() == [100, 200, 250]
    np.testing.assert_array_equal(read["time"][:, 0], T)


def test_the_first_line_may_be_cut_off(tmp_path):
    written(tmp_path, {0: (2, 1)})
    read = read_rows(tmp_path / "run.csv", SIGNALS, slice(None)).signals
    assert np.flatnonzero(np.isnan(read["positions"][:, 0])).tolist() == [0]
    assert read["time"][0] == T[0]


def test_a_program_that_leaves_out_empty_cells_at_the_ends_of_lines_cuts_nothing(tmp_path):
    written(tmp_path, dict.fromkeys(range(0, 400, 4), (2, 7)))
    read = read_rows(tmp_path / "run.csv", SIGNALS, slice(None)).signals
    assert np.isfinite(read["positions"]).all()
    assert np.isnan(read["inputs"]).sum() == 100


def test_what_becomes_of_lines_that_were_cut_off_is_said_once(tmp_path):
    path = written(tmp_path, {100: (3, 2), 200: (3, 1)})
    assert not finding(path, "missing")
    (line,) = finding(path, "line")
    assert "The rows are used: this input is held at the number before there." in line.advice
    path = written(tmp_path, {100: (3, 2), 150: (1, 2), 200: (3, 1)})
    (line,) = finding(path, "line")
    assert "In 2 of these rows the input is held at the number before; the others are left out" in line.advice
    with pytest.warns(DataWarning, match="2 missing numbers of `u` .*, 1 row without all numbers"):
        assert len(read_dataset(path).train[0]) == 399


def test_empty_cells_that_are_left_out_now_and_then_cut_nothing(tmp_path):
    """Three in a hundred lines end before `u`, all of them after a whole `v`."""
    written(tmp_path, dict.fromkeys(range(7, 400, 33), (3, 3)))
    signals = {**SIGNALS, "inputs": ("v",)}
    read = read_rows(tmp_path / "run.csv", signals, slice(None)).signals
    assert np.isfinite(read["inputs"]).all()


def test_of_a_short_file_a_single_cut_line_is_seen(tmp_path):
    path = written(tmp_path, {7: (1, 2)})
    table = tmp_path / "run.csv"
    table.write_text("".join(table.read_text().splitlines(keepends=True)[:16]))
    assert not finding(path, "time")


def test_the_first_line_may_be_cut_off_where_lines_end_with_a_separator(tmp_path):
    written(tmp_path, {0: (2, 3)})
    table = tmp_path / "run.csv"
    first, *lines = table.read_text().splitlines()[1:]
    table.write_text("\n".join(["t,q,v,u", first, *(f"{line}," for line in lines)]))
    read = read_rows(table, SIGNALS, slice(None)).signals
    assert np.flatnonzero(np.isnan(read["positions"][:, 0])).tolist() == [0]
