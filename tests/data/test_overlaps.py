"""Rows that two parts have in common are refused, after what is wrong with a file itself."""

import pytest

from symoden.data import DataError, check_dataset, read_dataset

from .conftest import arm, written


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
