"""Dates and times of day are seconds."""

import numpy as np
import polars as pl
import pytest

from symoden.data import DataError
from symoden.data.files._readers import read_rows

ALL = slice(0, None)


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("shift", ["", "Z", "+00:00", "+0200"])
@pytest.mark.parametrize("between", ["T", " "])
def test_dates_are_seconds_since_1970(tmp_path, between, shift):
    times = [f"2025-10-09{between}08:53:20{part}{shift}" for part in ("", ".008", ".016500")]
    path = written(tmp_path / "run.csv", "t,q\n" + "".join(f"{time},1\n" for time in times) + ",1\n")
    found = read_rows(path, {"x": ("t",)}, ALL).signals["x"][:, 0]
    start = 1.76e9 - (7200 if shift == "+0200" else 0)
    np.testing.assert_allclose(found, [start, start + 0.008, start + 0.0165, np.nan], atol=1e-6, rtol=0)


@pytest.mark.parametrize("point", [".", ","])
def test_times_of_day_are_seconds_and_go_on_after_midnight(tmp_path, point):
    times = ["9:59:59", f"10:04:01{point}25", "", "21:59:59", "00:00:00", f"11:00:00{point}5", "22:00:00", "1:00:00"]
    path = written(tmp_path / "run.csv", "t;q\n" + "".join(f"{time};1.5\n" for time in times))
    found = read_rows(path, {"x": ("t",)}, ALL).signals["x"][:, 0]
    day = 86400.0
    np.testing.assert_array_equal(
        found, [35999, 36241.25, np.nan, 79199, day, day + 39600.5, day + 79200, 2 * day + 3600], strict=True
    )


def test_a_day_that_rows_out_of_order_seem_to_begin_is_none(tmp_path):
    path = written(tmp_path / "run.csv", "t\n \nnan\n23:59:59.9\n00:00:00.1\n23:59:59.95\n00:00:00.2\n00:00:00.3\n")
    day = 86400.0
    np.testing.assert_allclose(
        read_rows(path, {"x": ("t",)}, ALL).signals["x"][:, 0],
        [np.nan, day - 0.1, day + 0.1, day - 0.05, day + 0.2, day + 0.3],
        rtol=0,
        atol=1e-9,
    )


def test_a_long_rest_within_a_day_is_one(tmp_path):
    path = written(tmp_path / "run.csv", "t\n01:00:00\n14:00:00\n14:00:01\n")
    np.testing.assert_array_equal(read_rows(path, {"x": ("t",)}, ALL).signals["x"][:, 0], [3600, 50400, 50401])


@pytest.mark.parametrize("odd", ["10:04", "10:4:01", "now", "1.5", "10:04:75", "10:60:00", "100:00:00", "١٠:٠٤:٠١"])
def test_a_time_of_day_among_others_that_is_none_is_named(tmp_path, odd):
    path = written(tmp_path / "run.csv", f"t\n10:04:01\n{odd}\n")
    with pytest.raises(DataError, match=rf"column `t`, line 3 \(row 1\): must be a number or empty; got '{odd}'"):
        read_rows(path, {"x": ("t",)}, ALL)


def test_date_types_are_seconds_since_1970_too(tmp_path):
    stamps = pl.Series([1_760_000_000_008, None]).cast(pl.Datetime("ms", "Europe/Berlin"))
    pl.DataFrame({"t": stamps}).write_parquet(tmp_path / "run.parquet")
    found = read_rows(tmp_path / "run.parquet", {"x": ("t",)}, ALL).signals["x"][:, 0]
    np.testing.assert_allclose(found, [1_760_000_000.008, np.nan], atol=1e-6, rtol=0)


def test_a_date_among_others_that_is_none_is_named(tmp_path):
    path = written(tmp_path / "run.csv", "t\n2025-10-09T08:53:20\n2025-10-09T08:53\nnever\n")
    with pytest.raises(DataError, match=r"column `t`, line 2 \(row 0\): must be a number or empty; got '2025"):
        read_rows(path, {"x": ("t",)}, ALL)
