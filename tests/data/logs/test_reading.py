"""All files of a description are read, and each that cannot be is named beside those that can."""

import numpy as np
import pytest

from symoden.data import DataError, DataWarning, check_dataset, read_dataset
from tests.data.conftest import NAMES, arm, written

TOO_SHORT = "a recording must have at least 2 rows"


def rewrite(path, **cells):
    """Write words into cells of a file: `q1=(3, "off")`."""
    lines = [line.split(",") for line in path.read_text().splitlines()]
    for name, (row, word) in cells.items():
        lines[row + 1][NAMES.index(name)] = word
    path.write_text("\n".join(",".join(line) for line in lines) + "\n")


def described(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def named(check):
    return [(one.part, one.name) for one in check.unreadable]


def texts(check):
    return [finding.text for finding in check.findings if finding.level == "refused"]


def test_where_no_file_can_be_read_each_one_is_named(tmp_path):
    path = written(tmp_path, arm(0), arm(1), arm(2))
    for name in ("run0", "run2"):
        rewrite(tmp_path / f"{name}.csv", q1=(3, "off"))
    (tmp_path / "run1.csv").write_text("")
    check = check_dataset(path)
    assert check.refused
    assert check.recordings == ()
    assert check.findings == ()
    assert named(check) == [("train", "run0"), ("train", "run1"), ("train", "run2")]
    said = [one.finding for one in check.unreadable]
    assert [one.kind for one in said] == ["refused"] * 3
    assert ["got 'off'" in one.text for one in said] == [True, False, True]
    assert "run1.csv`: is empty" in said[1].text


def test_training_names_the_first_file_and_how_many_more_there_are(tmp_path):
    path = written(tmp_path, arm(0), arm(1), arm(2), arm(3))
    path.write_text(path.read_text() + '[test]\nfiles = ["run2.csv"]\n')
    rewrite(tmp_path / "run1.csv", q1=(3, "off"))
    with pytest.raises(DataError, match=r"`.*run1\.csv`: column `q1`, .*by `rows`\.$"):
        read_dataset(path)
    (tmp_path / "run0.csv").write_text("t\n")
    (tmp_path / "run2.csv").write_bytes(b"")  # In two parts, and one file all the same.
    with pytest.raises(
        DataError, match=rf"`.*run0\.csv`: no column .* 2 more cannot be read .*check {path}` says why\."
    ):
        read_dataset(path)


def test_a_pattern_without_files_is_named_beside_the_files(tmp_path):
    path = written(tmp_path, arm(0), arm(1))
    described(path, '"run0.csv"', '"run1.csv", "gone.csv", "run*.csv", "logs/*.csv"')
    check = check_dataset(path)
    assert named(check) == [("train", "gone"), ("train", "*")]
    assert [str(one.path) for one in check.unreadable] == ["gone.csv", "logs/*.csv"]
    assert "no file matches `gone.csv`; looked in" in check.unreadable[0].finding.text
    assert [one.log.name for one in check.recordings] == ["run1", "run0"]  # In the order of `files`, each once.
    with pytest.raises(DataError, match=r"no file matches `gone\.csv`.* 1 more cannot be read"):
        read_dataset(path)


def test_rows_of_a_file_that_cannot_be_read_are_no_fault_of_the_others(tmp_path):
    more = 'rows = { "run0.csv" = [0, 1000], "run1.csv" = [[0, 900], [1000]] }\n'
    path = written(tmp_path, arm(0), arm(1), arm(2))
    path.write_text(path.read_text() + more)
    rewrite(tmp_path / "run0.csv", q1=(3, "off"))
    check = check_dataset(path)
    assert named(check) == [("train", "run0")]
    assert [one.log.name for one in check.recordings] == ["run1-1", "run1-2", "run2"]
    assert texts(check) == []


def test_rows_of_a_file_that_a_part_does_not_have_are_a_finding(tmp_path):
    path = written(tmp_path, arm(0))
    path.write_text(path.read_text() + 'rows = { "run7.csv" = [5] }\n')
    check = check_dataset(path)
    assert len(check.recordings) == 1
    (text,) = texts(check)
    assert "[train] `rows` must be of files that the part has; got `run7.csv`" in text
    described(path, '"run0.csv"]', '"run0.csv", "run7.csv"]')
    check = check_dataset(path)
    assert named(check) == [("train", "run7")]  # It is not there: that is the cause.
    assert texts(check) == []


def in_trials(folder, *lengths, more=""):
    """A file of several recordings, which a column tells apart."""
    path = written(folder, arm(0, samples=sum(lengths)), more='recording = "trial"\n' + more)
    trials = np.repeat(np.arange(len(lengths)), lengths)
    head, *lines = (folder / "run0.csv").read_text().splitlines()
    rows = [f"{line},{trial}" for line, trial in zip(lines, trials, strict=True)]
    (folder / "run0.csv").write_text("\n".join([f"{head},trial", *rows]) + "\n")
    return path


def test_of_a_file_of_recordings_one_that_is_too_short_is_named_alone(tmp_path):
    check = check_dataset(in_trials(tmp_path, 700, 1, 700))
    assert named(check) == [("train", "run0-1")]
    assert f"`trial` = 1: {TOO_SHORT}" in check.unreadable[0].finding.text
    assert [one.log.name for one in check.recordings] == ["run0-0", "run0-2"]


def test_recordings_that_no_file_has_are_a_finding_where_all_files_can_be_read(tmp_path):
    path = in_trials(tmp_path, 700, 700)
    path.write_text(path.read_text() + '[test]\nfiles = ["run*.csv"]\nrecordings = [1, 8]\n')
    check = check_dataset(path)
    assert [(one.log.part, one.log.name) for one in check.recordings] == [("train", "run0-0"), ("test", "run0-1")]
    (text,) = texts(check)
    assert "[test] `recordings` must name those of its files; got `8`" in text
    (tmp_path / "run1.csv").write_text("")  # It may have been there.
    check = check_dataset(path)
    assert named(check) == [("test", "run1")]
    assert texts(check) == []


def test_unreadable_files_of_one_name_are_told_apart_by_their_folders(tmp_path):
    path = written(tmp_path, arm(0))
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        for ending in ("csv", "npz"):
            (tmp_path / folder / f"swing.{ending}").write_text("")
    described(path, '"run0.csv"', '"run0.csv", "monday/swing.*", "tuesday/swing.*"')
    assert [name for _, name in named(check_dataset(path))] == ["monday-swing"] * 2 + ["tuesday-swing"] * 2


def arrays(path, seed, *, inputs):
    t, *columns = arm(seed).T
    np.savez(path, t=t, q=np.stack(columns[:2], 1), v=np.stack(columns[2:4], 1), u=np.stack([columns[4]] * inputs, 1))


def test_a_file_with_another_number_of_inputs_than_most_is_named(tmp_path):
    for k, inputs in enumerate((2, 1, 1)):
        arrays(tmp_path / f"run{k}.npz", k, inputs=inputs)
    path = tmp_path / "arm.toml"
    head = 'space = "T2"\ntime = "t"\npositions = "q"\nvelocities = "v"\ninputs = "u"\n'
    path.write_text(head + '[train]\nfiles = ["run0.npz", "run1.npz"]\n[test]\nfiles = ["run2.npz"]\n')
    check = check_dataset(path)
    assert named(check) == [("train", "run0")]
    assert "`u` must have as many columns as in most files, 1; got 2" in check.unreadable[0].finding.text
    assert [one.log.name for one in check.recordings] == ["run1", "run2"]


def test_of_clocks_that_are_refused_the_file_is_named_alone(tmp_path):
    path = written(tmp_path, arm(0, step=0.005), arm(1, step=0.05), more="dt = 0.04")
    check = check_dataset(path)
    assert named(check) == [("train", "run0")]
    assert "rows must be taken once in that time, or less often" in check.unreadable[0].finding.text
    assert [one.log.name for one in check.recordings] == ["run1"]


def test_files_that_can_be_read_are_compared_all_the_same(tmp_path):
    path = written(tmp_path, arm(0), arm(1), arm(2))
    described(path, '"run2.csv"]', '"run2.csv"]\n[test]\nfiles = ["copy.csv"]')
    (tmp_path / "copy.csv").write_bytes((tmp_path / "run1.csv").read_bytes())
    rewrite(tmp_path / "copy.csv", u1=(0, "0.25"))  # No recording is the other number by number.
    with pytest.warns(DataWarning, match=r"\[test\] has rows of \[train\]"):
        read_dataset(path)
    rewrite(tmp_path / "run0.csv", q1=(3, "off"))
    rewrite(tmp_path / "run2.csv", t=(20, "0.0"))
    check = check_dataset(path)
    assert named(check) == [("train", "run0")]
    assert [one.recordings for one in check.recordings] == [1, 0, 1]
    assert "copy" in {finding.kind for finding in check.findings}


def test_what_the_other_files_lack_is_not_said_where_one_cannot_be_read(tmp_path):
    still = arm(1)
    still[:, 1:5] = 0.5
    path = written(tmp_path, arm(0), still)
    rewrite(tmp_path / "run0.csv", q1=(3, "off"))
    check = check_dataset(path)
    assert named(check) == [("train", "run0")]
    assert texts(check) == []
    described(path, '"run0.csv", ', "")
    (text,) = texts(check_dataset(path))
    assert "what is to be learned must move in [train]" in text
