"""Rows that two parts have in common are refused, after what is wrong with a file itself."""

import pytest

from symoden.data import DataError, check_dataset, read_dataset
from tests.data.conftest import arm, written


def split(folder, *, train, test, samples=300):
    """A file of which two parts have rows, and one that training alone has."""
    path = written(folder, arm(0, samples=samples), arm(1))
    path.write_text(
        path.read_text() + f'rows = {{ "run0.csv" = {train} }}\n[test]\nfiles = ["run0.csv"]\nrows = {test}\n'
    )
    return path


def refusals(path):
    return [finding.text for finding in check_dataset(path).findings if finding.level == "refused"]


@pytest.mark.parametrize(
    ("train", "test", "rows"),
    [
        ([0, 200], [150], "150 to 199"),
        ([0, 200], [-101], "199 to 199"),
        ([[10, 50], [100, 160]], [40, 120], "40 to 119"),
    ],
)
def test_rows_in_common_are_a_finding_and_all_files_are_looked_at(tmp_path, train, test, rows):
    path = split(tmp_path, train=train, test=test)
    (text,) = refusals(path)
    assert f"[train] and [test] must have no rows in common; both have rows {rows} of `{tmp_path}/run0.csv`." in text
    check = check_dataset(path)
    assert {each.log.name for each in check.recordings} >= {"run1"}
    assert "copy" not in {finding.kind for finding in check.findings}
    with pytest.raises(DataError, match=rf"both have rows {rows} of"):
        read_dataset(path)


def test_parts_side_by_side_have_none_in_common(tmp_path):
    assert refusals(split(tmp_path, train=[0, 200], test=[200])) == []


def test_rows_that_repeat_the_one_before_count(tmp_path):
    path = split(tmp_path, train=[0, 200], test=[199])
    lines = (tmp_path / "run0.csv").read_text().splitlines()
    lines[200] = lines[199]  # Row 199, the only one in common, is row 198 again.
    (tmp_path / "run0.csv").write_text("\n".join(lines) + "\n")
    (text,) = refusals(path)
    assert "both have rows 199 to 199" in text


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda lines: lines[:2], r"run1\.csv`: a recording must have at least 2 rows; got 1\. Leave it out\.$"),
        (
            lambda lines: [lines[0], *(f"{k},,,,,," for k in range(9))],
            r"run1\.csv`: .* at least 2 rows without a missing",
        ),
        (lambda lines: [*lines[:9], lines[3], *lines[9:]], r"run1\.csv`: column `t`.* must increase"),
    ],
)
def test_training_names_a_damaged_file_before_rows_in_common(tmp_path, damage, said):
    path = split(tmp_path, train=[0, 200], test=[150])
    lines = (tmp_path / "run1.csv").read_text().splitlines()
    (tmp_path / "run1.csv").write_text("\n".join(damage(lines)) + "\n")
    with pytest.raises(DataError, match=said):
        read_dataset(path)


def test_of_rows_that_are_counted_from_the_end_of_a_file_that_was_cut_off_the_end_is_blamed(tmp_path):
    path = split(tmp_path, train=[0, 400], test=[-200], samples=600)
    assert refusals(path) == []
    lines = (tmp_path / "run0.csv").read_text().splitlines()
    (tmp_path / "run0.csv").write_text("\n".join(lines[:301]) + "\n")
    (text,) = refusals(path)
    assert "run0.csv`, which ends before row 400 of [train]: perhaps it was cut off. Name other" in text


def test_where_parts_have_recordings_of_a_file_nothing_is_said_of_its_end(tmp_path):
    path = split(tmp_path, train=[0, 200], test=[0, 200])
    lines = (tmp_path / "run0.csv").read_text().splitlines()
    rows = [f"{line},{row // 100}" for row, line in enumerate(lines[1:])]
    (tmp_path / "run0.csv").write_text("\n".join([f"{lines[0]},trial", *rows]) + "\n")
    text = (
        path.read_text().replace('"run0.csv", "run1.csv"', '"run0.csv"').replace("[train]", "[train]\nrecordings = [0]")
    )
    path.write_text('recording = "trial"' + text.replace("[test]", "[test]\nrecordings = [0]"))
    (text,) = refusals(path)
    assert "both have rows 0 to 99 of" in text
    assert "cut off" not in text


@pytest.mark.parametrize(("rows", "last"), [([0, 6000], 6000), ([[0, 50], [100, 301]], 301), ([0, 300], 0), ([20], 0)])
def test_rows_behind_the_end_of_a_file_are_noted(tmp_path, rows, last):
    path = split(tmp_path, train=rows, test=[0, 0])
    path.write_text(path.read_text().split("[test]")[0])
    notes = [one.text for one in check_dataset(path).findings if one.kind == "missing"]
    assert notes == [f"[train] `rows` name rows of `run0.csv` up to {last}, and it ends after row 299"] * bool(last)
