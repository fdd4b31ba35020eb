"""Recordings whose columns are in several files, which are joined."""

import gzip
import warnings

import numpy as np
import polars as pl
import pytest

from symoden.data import DataError, DataWarning, check_dataset, read_dataset

HEAD = """
space = "T2"
time = "t"
positions = ["q.1st", "q.2nd"]
inputs = ["tau.1st", "tau.2nd"]
[train]
files = [{ q = "run*/q.csv", tau = "run*/tau.csv" }]
"""
SAMPLES = 80
TS = 0.01 * np.arange(SAMPLES)


def motion(run):
    return np.stack([np.sin(3 * TS + run), 0.5 * np.cos(2 * TS)], axis=1)


def torques(ts, run):
    return np.stack([np.cos(4 * ts + run), np.sin(ts)], axis=1)


def written(path, columns, **times):
    """A table of the two joints, times before them if there are some."""
    path.parent.mkdir(exist_ok=True)
    pl.DataFrame({**times, "1st": columns[:, 0], "2nd": columns[:, 1]}).write_csv(path)


@pytest.fixture
def described(tmp_path):
    """Two recordings, each of a file of positions and one of torques at the same times."""
    for run in (1, 2):
        written(tmp_path / f"run{run}" / "q.csv", motion(run), t=TS)
        written(tmp_path / f"run{run}" / "tau.csv", torques(TS, run), t=TS)
    path = tmp_path / "arm.toml"
    path.write_text(HEAD)
    return path


def changed(described, *changes):
    text = described.read_text()
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    described.write_text(text)
    return described


def assert_read(described):
    first, second = read_dataset(described).train
    for run, recording in ((1, first), (2, second)):
        np.testing.assert_array_equal(recording.ts, TS)
        np.testing.assert_array_equal(recording.q, motion(run))
        np.testing.assert_array_equal(recording.us, torques(TS, run))
    return first, second


def test_files_whose_stars_stand_for_the_same_are_joined(described):
    first, second = assert_read(described)
    assert (first.name, second.name) == ("run1-q+tau", "run2-q+tau")


def test_all_columns_of_a_file_have_its_name(described):
    assert_read(changed(described, ('["q.1st", "q.2nd"]', '"q"'), ('["tau.1st", "tau.2nd"]', '["tau[0]", "tau[1]"]')))


def test_rows_without_times_belong_together_one_by_one(described):
    for run in (1, 2):
        written(described.parent / f"run{run}" / "tau.csv", torques(TS, run))
    assert_read(changed(described, ('time = "t"', 'time = "q.t"')))


def test_matrices_without_names_and_times(described):
    for run in (1, 2):
        for name, columns in (("q", motion(run)), ("tau", torques(TS, run))):
            with gzip.open(described.parent / f"run{run}" / f"{name}.txt.gz", "wt") as file:
                np.savetxt(file, columns, fmt="%.17g")
    names = ('["q.1st", "q.2nd"]', '["q.1", "q.2"]'), ('["tau.1st", "tau.2nd"]', '"tau"')
    assert_read(changed(described, ('time = "t"', "dt = 0.01"), (".csv", ".txt.gz"), *names))


def test_files_with_times_of_their_own_are_merged_by_these(described):
    own = np.arange(-0.009, TS[-1] + 0.02, 0.013)
    for run in (1, 2):
        written(described.parent / f"run{run}" / "tau.csv", torques(own, run), t=own)
    changed(described, ("[train]", 'hold = "linear"\n[train]'))
    with pytest.warns(DataWarning, match=r"`tau\.1st, tau\.2nd` and the positions have numbers in different rows"):
        recording = read_dataset(described).train[0]
    np.testing.assert_array_equal(recording.q, motion(1))
    np.testing.assert_allclose(recording.us, torques(recording.ts, 1), atol=1e-3)


def test_intervals_and_formulas_count_in_what_is_joined(described):
    rows = ("[train]", '[train]\nrows = { "run1/*" = [10, 50] }')
    twice = ("[train]", 'formulas = { twice = "2*`tau.1st` + `q.2nd`" }\n[train]')
    first, second = read_dataset(
        changed(described, rows, twice, ('["tau.1st", "tau.2nd"]', '["twice", "tau.2nd"]'))
    ).train
    np.testing.assert_array_equal(first.q, motion(1)[10:50])
    np.testing.assert_allclose(second.us[:, 0], 2 * torques(TS, 2)[:, 0] + motion(2)[:, 1])


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ([("run*/tau.csv", "run1/tau.csv")], "as many stars each"),
        ([("run*/tau.csv", "run*/torque.csv")], "no file matches `run*/torque.csv`"),
        ([('{ q = "run*/q.csv", tau = "run*/tau.csv" }', '{ q = "run*/q.csv" }')], "two files or more"),
        ([("run*/tau.csv", "run*/tau.npz")], "no file matches"),
        ([("[{", '["run1/q.csv", {')], "not of both"),
        ([("q.1st", "q.first")], "no column `q.first`"),
        ([('"q.2nd"', '"2nd"')], "no column `2nd`"),
    ],
)
def test_descriptions_that_cannot_be_are_refused(described, changes, says):
    with pytest.raises(DataError) as error:
        read_dataset(changed(described, *changes))
    assert says in str(error.value)


def test_a_file_without_its_other_is_named(described):
    (described.parent / "run2" / "tau.csv").unlink()
    with pytest.raises(DataError, match=r"run2/q\.csv` has none that `run\*/tau\.csv` matches"):
        read_dataset(described)


def test_pairs_are_told_by_stars_not_by_their_order(described):
    (described.parent / "run2" / "tau.csv").rename(described.parent / "run3.csv")
    (described.parent / "run3").mkdir()
    (described.parent / "run3.csv").rename(described.parent / "run3" / "tau.csv")
    with pytest.raises(DataError, match=r"has none that"):
        read_dataset(described)


def test_rows_without_times_must_be_as_many(described):
    written(described.parent / "run1" / "tau.csv", torques(TS, 1)[1:])
    written(described.parent / "run2" / "tau.csv", torques(TS, 2))
    with pytest.raises(DataError, match=r"q\.csv` 80, `.*tau\.csv` 79"):
        read_dataset(changed(described, ('time = "t"', 'time = "q.t"')))


def test_times_in_some_files_alone_are_refused(described):
    written(described.parent / "run1" / "tau.csv", torques(TS, 1))
    with pytest.raises(DataError, match=r"run1/tau\.csv`: must have the column of times `t`.*`q\.t`"):
        read_dataset(described)


def test_times_that_go_back_are_not_sorted_away(described):
    ts = TS + 0.001
    ts[40] = ts[20]
    written(described.parent / "run1" / "tau.csv", torques(ts, 1), t=ts)
    with pytest.raises(DataError, match=r"tau\.csv`: column `t` must not decrease"):
        read_dataset(described)


def test_arrays_are_refused(described):
    np.savez(described.parent / "run1" / "tau.npz", tau=torques(TS, 1))
    np.savez(described.parent / "run2" / "tau.npz", tau=torques(TS, 2))
    with pytest.raises(DataError, match=r"files that are joined must be tables"):
        read_dataset(changed(described, ("run*/tau.csv", "run*/tau.npz")))


def test_tables_in_memory_are_not_joined():
    frame = pl.DataFrame({"t": TS, "q": TS})
    description = {
        "space": "R1",
        "time": "t",
        "positions": ["q.q"],
        "inputs": ["u.q"],
        "train": {"files": [{"q": "one", "u": "other"}]},
    }
    with pytest.raises(DataError, match=r"tables in memory are not.*pandas\.merge"):
        read_dataset(description, tables={"one": frame, "other": frame})


@pytest.mark.parametrize("where", ["./run*", "run?", "run[0-9]", "run[!x^]", "**/run*"])
def test_whatever_is_left_open_in_a_pattern_tells_pairs(described, where):
    assert_read(changed(described, ("run*", where)))


def test_a_path_below_a_folder_of_any_name(described):
    q, tau = (described.parent / name for name in ("q[1].csv", "tau.csv"))
    written(q, motion(1), t=TS)
    written(tau, torques(TS, 1), t=TS)
    recording = read_dataset(changed(described, ("run*/q.csv", q.name), ("run*/tau.csv", str(tau)))).train[0]
    np.testing.assert_array_equal(recording.us, torques(TS, 1))


def test_recordings_that_share_a_file_are_two(described):
    one = '{ tau = "run1/tau.csv", q = "run1/q.csv" }, { tau = "run1/tau.csv", q = "run2/q.csv" }'
    first, second = read_dataset(changed(described, ('{ q = "run*/q.csv", tau = "run*/tau.csv" }', one))).train
    assert {first.name, second.name} == {"tau+q", "tau+run2-q"}
    np.testing.assert_array_equal(first.q, motion(1))
    np.testing.assert_array_equal(second.q, motion(2))


@pytest.mark.parametrize("time", ['time = "q.t"', "dt = 0.01"])
def test_times_are_none_of_all_columns(described, time):
    assert_read(changed(described, ('time = "t"', time), ('["tau.1st", "tau.2nd"]', '"tau"')))


def test_a_column_of_a_formula_is_one_of_all_nevertheless(described):
    summed = ("[train]", 'formulas = { sum = "`q.2nd` + 0 * `tau.2nd`" }\n[train]')
    assert_read(changed(described, summed, ('"q.2nd"', '"sum"'), ('["tau.1st", "tau.2nd"]', '"tau"')))


@pytest.mark.parametrize("own", [False, True])
def test_words_tell_recordings_apart(described, own):
    labels = np.repeat(["up", "down"], SAMPLES // 2)
    for run in (1, 2):
        path = described.parent / f"run{run}" / "q.csv"
        pl.read_csv(path).with_columns(pl.Series("which", labels)).write_csv(path)
        if own:
            ts = TS + 0.001
            written(described.parent / f"run{run}" / "tau.csv", torques(ts, run), t=ts)
    changed(described, ('["q.1st", "q.2nd"]', '"q"'), ("[train]", 'recording = "q.which"\nhold = "linear"\n[train]'))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        names = [each.name for each in read_dataset(described).train]
    assert names[:2] == ["run1-q+tau-up", "run1-q+tau-down"]


def test_units_below_names_are_compared_with_how_they_are_read(described):
    path = described.parent / "run1" / "q.csv"
    path.write_text(path.read_text().replace("\n", "\ns,deg,deg\n", 1))
    assert any("says deg" in each.text for one in check_dataset(described).recordings for each in one.findings)


def test_names_that_end_as_those_of_tables_of_text(described):
    for run in (1, 2):
        folder = described.parent / f"run{run}"
        (folder / "tau.csv").rename(folder / "tau.txt.csv")
    assert_names = [each.name for each in read_dataset(changed(described, ("tau.csv", "tau.txt.csv"))).train]
    assert assert_names == ["run1-q+tau_txt", "run2-q+tau_txt"]
    assert not check_dataset(described).refused


def test_a_time_stamp_that_one_file_lacks_is_that_of_the_other(described):
    for run in (1, 2):
        ts = TS + 1e-9
        ts[[5, 60]] = np.nan
        written(described.parent / f"run{run}" / "tau.csv", torques(TS, run), t=ts)
    assert_read(described)


@pytest.mark.parametrize("name", ["t", "q.1", "q[0]"])
def test_names_of_files_that_cannot_be_told_from_columns_are_refused(described, name):
    with pytest.raises(DataError, match=r"must not be called as|letters, digits and underscores"):
        read_dataset(
            changed(described, ("{ q =", f'{{ "{name}" ='), ("q.1st", f"{name}.1st"), ("q.2nd", f"{name}.2nd"))
        )


def test_a_word_in_a_file_with_times_of_its_own_is_named_in_its_line(described):
    path = described.parent / "run1" / "tau.csv"
    written(path, torques(TS + 0.001, 1), t=TS + 0.001)
    lines = path.read_text().splitlines()
    lines[10] = lines[10].rpartition(",")[0] + ",abc"
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"run1/tau\.csv`: column `2nd`, line 11 \(row 9\).*'abc'"):
        read_dataset(described)
