"""A column may tell the recordings of a file apart, and parts may name them."""

import numpy as np
import polars as pl
import pytest

from symoden.data import DataError, DataWarning, check_dataset, read_dataset

HEAD = """
space = "R1"
time = "t"
recording = "trial"
positions = ["x"]
inputs = ["u"]
"""
TRAIN = '[train]\nfiles = ["runs.{ending}"]\n'
SAMPLES = 60
TEST = '[test]\nfiles = ["runs.csv"]\nrecordings = {}\n'


def table(labels=(3, 1, 7), samples=SAMPLES):
    """Motions that begin at a time and a place of their own, one after the other."""
    t = 0.01 * np.arange(samples)
    return pl.concat(
        pl.DataFrame({"trial": [label] * samples, "t": t + k, "x": np.sin(5 * t) + k, "u": np.cos(3 * t + k)})
        for k, label in enumerate(labels)
    )


def written(folder, frame, *, ending="csv", more="", train=TRAIN):
    path = folder / f"runs.{ending}"
    if ending == "npz":
        np.savez(path, **{name: frame[name].to_numpy() for name in frame.columns})
    else:
        getattr(frame, f"write_{ending}")(path)
    description = folder / "runs.toml"
    description.write_text(HEAD + train.format(ending=ending) + more)
    return description


def names(recordings):
    return [recording.name for recording in recordings]


@pytest.mark.parametrize("ending", ["csv", "parquet", "npz"])
def test_recordings_are_told_apart_in_the_order_in_which_they_begin(tmp_path, ending):
    train = read_dataset(written(tmp_path, table(), ending=ending)).train
    assert names(train) == ["runs-3", "runs-1", "runs-7"]
    for k, recording in enumerate(train):
        np.testing.assert_allclose(recording.ts, 0.01 * np.arange(SAMPLES) + k)
        np.testing.assert_allclose(recording.q[0, 0], k, atol=1e-12)


def test_rows_of_one_recording_need_not_follow_each_other(tmp_path):
    apart = table().with_columns(pl.col("t") % 1.0)
    mixed = apart.sort("t")
    assert len(set(mixed["trial"][:6])) == 3
    read = {}
    for name, frame in (("apart", apart), ("mixed", mixed)):
        (tmp_path / name).mkdir()
        read[name] = {each.name: each for each in read_dataset(written(tmp_path / name, frame)).train}
    assert set(read["apart"]) == set(read["mixed"]) == {"runs-3", "runs-1", "runs-7"}
    for name, recording in read["apart"].items():
        np.testing.assert_array_equal(read["mixed"][name].q, recording.q)


@pytest.mark.parametrize(
    "labels", [("7e123456", "4e567890"), ("20230629143524001", "20230629143524002"), ("002", "2"), (2**53, 2**53 + 1)]
)
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_labels_that_differ_are_never_taken_for_one(tmp_path, labels, ending):
    more = TEST.replace("csv", ending).format([labels[1]]).replace("'", '"')
    dataset = read_dataset(written(tmp_path, table(labels), ending=ending, more=more))
    assert names(dataset.train) == [f"runs-{labels[0]}"]
    assert names(dataset.test) == [f"runs-{labels[1]}"]


def test_an_incomplete_row_without_a_label_belongs_to_the_recording_before_it(tmp_path):
    frame = table().with_columns(pl.col("trial").cast(pl.String))
    for row in (0, 70, 3 * SAMPLES - 1):
        frame[row, "trial"] = None
        frame[row, "x"] = None
    with pytest.warns(DataWarning, match="without all numbers"):
        train = read_dataset(written(tmp_path, frame)).train
    assert {each.name: len(each) for each in train} == dict.fromkeys(["runs-3", "runs-1", "runs-7"], SAMPLES - 1)


def test_a_part_that_names_none_has_those_that_no_other_names(tmp_path):
    more = '[test]\nfiles = ["runs.csv"]\nrecordings = [7]\n[validation]\nfiles = ["runs.csv"]\nrecordings = [3.0]\n'
    dataset = read_dataset(written(tmp_path, table(), more=more))
    parts = dataset.train, dataset.test, dataset.validation
    assert [names(part) for part in parts] == [["runs-1"], ["runs-7"], ["runs-3"]]


def test_words_tell_recordings_apart_too(tmp_path):
    frame = table(("fast", "slow 2", "20230629143524"))
    more = '[test]\nfiles = ["runs.csv"]\nrecordings = ["slow 2"]\n'
    dataset = read_dataset(written(tmp_path, frame, more=more))
    assert names(dataset.train) == ["runs-fast", "runs-20230629143524"]
    assert names(dataset.test) == ["runs-slow 2"]


def test_places_are_those_of_the_file(tmp_path):
    frame = table()
    frame[2 * SAMPLES + 5, "x"] = 1e30
    checks = check_dataset(written(tmp_path, frame)).recordings
    assert [check.log.name for check in checks] == ["runs-3", "runs-1", "runs-7"]
    (finding,) = [finding for finding in checks[2].findings if finding.kind == "impossible"]
    assert f"line {2 * SAMPLES + 7} (row {2 * SAMPLES + 5})" in finding.text


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (TEST.format("[8]"), r"\[test\] `recordings` must name those of its files; got `8`.*They have `3, 1, 7`"),
        (TEST.format("[1, 3, 7]"), r"\[train\] must have recordings that no other part names; got none"),
        (TEST.format("7"), r"\[test\] `recordings` must be a list of numbers or texts, .*; got 7"),
        (TEST.format("[1]") + TEST.format("[1]").replace("test", "validation"), r"both have rows 60 to 119"),
    ],
)
def test_recordings_that_cannot_be_are_refused(tmp_path, more, said):
    with pytest.raises(DataError, match=said):
        read_dataset(written(tmp_path, table(), more=more))


def test_recordings_without_a_column_that_tells_them_are_refused(tmp_path):
    path = written(tmp_path, table(), more=TEST.format("[1]"))
    path.write_text(path.read_text().replace('recording = "trial"\n', ""))
    with pytest.raises(DataError, match=r"\[test\] `recordings` are told apart by a column, a star in names"):
        read_dataset(path)


@pytest.mark.parametrize("cell", ["", "na", "nan"])
def test_every_row_must_say_where_it_belongs(tmp_path, cell):
    frame = table().with_columns(pl.col("trial").cast(pl.String))
    frame[70, "trial"] = cell
    with pytest.raises(DataError, match=r"column `trial`, line 72 \(row 70\): must say which recording"):
        read_dataset(written(tmp_path, frame))


def test_a_recording_of_one_row_is_named(tmp_path):
    frame = pl.concat([table(), table((9,), samples=1)])
    with pytest.raises(DataError, match=r"`trial` = 9: a recording must have at least 2 rows; got 1"):
        read_dataset(written(tmp_path, frame))


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_several_intervals_of_rows_are_recordings_of_their_own(tmp_path, ending):
    """Such as before and after a clock was set back, or a hand that helped."""
    train = TRAIN + "rows = [[0, 25], [40, 55]]\n"
    description = written(tmp_path, table(labels=(3,)), ending=ending, train=train)
    description.write_text(description.read_text().replace('recording = "trial"\n', ""))
    first, second = read_dataset(description).train
    assert names([first, second]) == ["runs-1", "runs-2"]
    np.testing.assert_allclose(first.ts, 0.01 * np.arange(25))
    np.testing.assert_allclose(second.ts, 0.01 * np.arange(40, 55))


def test_intervals_of_rows_are_taken_apart_by_their_column_too(tmp_path):
    train = read_dataset(written(tmp_path, table(labels=(3, 1)), train=TRAIN + "rows = [[10, 80], [90]]\n")).train
    assert {recording.name: len(recording) for recording in train} == {"runs-3-1": 50, "runs-1-1": 20, "runs-1-2": 30}


def test_intervals_with_rows_in_common_are_refused(tmp_path):
    with pytest.raises(DataError, match=r"rows 20 to 24 of `.*runs\.csv` are in two of them"):
        read_dataset(written(tmp_path, table(labels=(3,)), train=TRAIN + "rows = [[0, 25], [20]]\n"))


@pytest.mark.parametrize("name", ["runs.csv", "run*.csv", "*s.csv"])
def test_rows_may_be_of_single_files_and_leave_the_others_whole(tmp_path, name):
    written(tmp_path, table(labels=(3,))).rename(tmp_path / "other.toml")
    (tmp_path / "runs.csv").rename(tmp_path / "whole.csv")
    train = (
        TRAIN.replace('"runs.{ending}"', '"runs.csv", "whole.csv"') + f'rows = {{{{ "{name}" = [[0, 25], [40]] }}}}\n'
    )
    found = read_dataset(written(tmp_path, table(labels=(3,)), train=train)).train
    assert {each.name: len(each) for each in found} == {"runs-3-1": 25, "runs-3-2": 20, "whole-3": 60}


def test_rows_of_a_file_that_the_part_does_not_have_are_refused(tmp_path):
    train = TRAIN + 'rows = {{ "run.csv" = [5] }}\n'
    with pytest.raises(DataError, match=r"got `run\.csv`\. Did you mean `runs\.csv`\? It has `runs\.csv`"):
        read_dataset(written(tmp_path, table(labels=(3,)), train=train))


@pytest.mark.parametrize(("rows", "said"), [("[[0, 25], [90, 95]]", r"\[90, 95\]"), ("[70]", r"\[70\]")])
def test_rows_beyond_the_end_of_a_file_are_refused_with_its_length(tmp_path, rows, said):
    with pytest.raises(DataError, match=rf"`.*runs\.csv` has 60, and none of them is in {said}\. .* if it was cut off"):
        read_dataset(written(tmp_path, table(labels=(3,)), train=TRAIN + f"rows = {rows}\n"))
