"""What is missing is left out and said; what is left is what was logged; nothing is made up for a gap."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, DataWarning, read_dataset

TEXT = """
space = "T1"
{more}
time = "t"
positions = ["q"]
velocities = ["v"]
inputs = ["u"]
[train]
files = ["a.csv"]
"""


def swing(samples=400, dt=0.01):
    t = dt * np.arange(samples)
    return np.stack([t, 3 * np.sin(2 * t), 6 * np.cos(2 * t), np.sin(7 * t)], axis=1)


def written(folder, rows, *, more="", part=""):
    np.savetxt(folder / "a.csv", rows, delimiter=",", header="t,q,v,u", comments="", fmt="%.17g")
    path = folder / "arm.toml"
    path.write_text(TEXT.format(more=more) + part)
    return path


def columns(recordings):
    parts = [np.concatenate([r.ts[:, None], r.q, r.rates, r.us], axis=1) for r in recordings]
    return np.concatenate(parts)


@given(
    start=st.integers(30, 200),
    length=st.integers(8, 100),
    column=st.integers(0, 3),
    deleted=st.booleans(),
)
def test_a_gap_splits_and_every_other_row_stays(tmp_path_factory, start, length, column, deleted):
    rows = swing()
    holes = rows.copy()
    holes[start : start + length, column] = np.nan
    kept = np.delete(rows, np.s_[start : start + length], axis=0)
    path = written(tmp_path_factory.mktemp("gap"), kept if deleted else holes)
    with pytest.warns(
        DataWarning, match=r"left out in `a`: .*1 gap in time .*kept as `a#1` to `a#2`\. `symoden data"
    ) as said:
        recordings = read_dataset(path).train
    assert len(said) == 1
    assert (f"{length} rows without all numbers" in str(said[0].message)) is not deleted
    assert [(r.name, len(r)) for r in recordings] == [("a#1", start), ("a#2", 400 - start - length)]
    np.testing.assert_allclose(columns(recordings), kept, atol=1e-12)


def test_a_few_lost_samples_are_no_gap(tmp_path):
    rows = swing()
    rows[50, 1] = rows[[100, 101, 102], 2] = np.nan
    with pytest.warns(DataWarning, match=r"left out in `a`: 4 rows without all numbers\. "):
        (recording,) = read_dataset(written(tmp_path, rows)).train
    assert (recording.name, len(recording)) == ("a", 396)


def test_gaps_are_measured_against_the_step_of_resampling(tmp_path):
    rows = np.delete(swing(4000, 0.001), np.s_[1000:1020], axis=0)
    (recording,) = read_dataset(written(tmp_path, rows, more="resample = 0.02")).train
    assert len(recording) == 200
    with pytest.warns(DataWarning, match="1 gap in time"):
        assert len(read_dataset(written(tmp_path, rows, more="resample = 0.005")).train) == 2


def test_short_pieces_are_dropped_and_said(tmp_path):
    rows = np.delete(swing(), np.r_[100:150, 160:200], axis=0)
    with pytest.warns(DataWarning, match=r"2 gaps in time .* 10 samples too short"):
        recordings = read_dataset(written(tmp_path, rows)).train
    assert [len(r) for r in recordings] == [100, 200]


def test_angles_are_unwrapped_piece_by_piece_and_segments_are_counted_through(tmp_path):
    rows = swing()
    rows[:, 1] = np.mod(20 * rows[:, 0], 2 * np.pi)
    rows[:, 2] = 20 + 1e-3 * rows[:, 3]
    rows[150:200, 1] = np.nan
    with pytest.warns(DataWarning):
        recordings = read_dataset(written(tmp_path, rows, part="split_every = 0.5\n")).train
    assert [r.name for r in recordings] == [f"a#{k}" for k in range(1, 8)]
    for recording in recordings:
        np.testing.assert_allclose(np.diff(recording.q[:, 0]), 0.2, atol=1e-9)


def test_each_piece_loses_the_delay_of_its_inputs(tmp_path):
    rows = np.delete(swing(), np.s_[200:250], axis=0)
    with pytest.warns(DataWarning):
        recordings = read_dataset(written(tmp_path, rows, more="input_delay = 0.1")).train
    assert [len(r) for r in recordings] == [190, 140]


def test_a_piece_that_the_delay_makes_too_short_is_dropped(tmp_path):
    rows = np.delete(swing(), np.r_[200:250, 280:300], axis=0)
    with pytest.warns(DataWarning, match="30 samples too short"):
        recordings = read_dataset(written(tmp_path, rows, more="input_delay = 0.1")).train
    assert [len(r) for r in recordings] == [190, 90]


def test_the_order_of_times_is_refused_across_missing_ones(tmp_path):
    rows = swing()
    rows[100, 0] = np.nan
    rows[101, 0] = rows[99, 0]
    with pytest.raises(DataError, match=r"column `t`, line 103 \(row 101\): times must .* \(1 such row\)"):
        read_dataset(written(tmp_path, rows))


def test_a_column_without_numbers_is_refused_by_name(tmp_path):
    rows = swing()
    rows[:, 2] = np.nan
    with pytest.raises(DataError, match=r"at least 2 rows without .* got 0 of 400\. Column `v` lacks 400"):
        read_dataset(written(tmp_path, rows))


def test_many_recordings_are_warned_of_in_one_line(tmp_path):
    rows = swing()
    rows[50, 1] = np.nan
    for k in range(5):
        np.savetxt(tmp_path / f"b{k}.csv", rows + np.array([k, 0, 0, 0]), delimiter=",", header="t,q,v,u", comments="")
    path = written(tmp_path, rows)
    path.write_text(path.read_text().replace("a.csv", "b*.csv"))
    with pytest.warns(DataWarning, match="`b0`: .*`b1`: .*`b2`: .*; and 2 more") as said:
        read_dataset(path)
    assert len(said) == 1
