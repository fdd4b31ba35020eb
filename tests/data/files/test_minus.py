"""The sign of minus (U+2212) in tables of text."""

import numpy as np
import polars as pl
import pytest

from symoden.data import DataError
from symoden.data.files._decimals import with_hyphens
from symoden.data.files._readers import read_rows
from symoden.data.files._tables import read_csv

EXPECTED = np.array([[0.0, -3.14], [-0.5, 2.0e-3], [1.0, -1.0]])


@pytest.mark.parametrize(
    "text",
    [
        "t,q\n0.0,−3.14\n−.5,2e−3\n1.0,−1\n",
        't,q\n0.0,"−3.14"\n−.5, 2e−3\n1.0,-1\n',
        "t;q\n0,0;−3,14\n−0,5;2e−3\n1,0;−1,0\n",
        "t\tq\r\n0.0\t−3.14\r\n−0.5\t0.002\r\n1.0\t−1.\r\n",
        "t q\n0.0 −3.14\n−.5 2e−3\n1.0 −1\n",
        "swing of monday\nt,q\n−0,−3.14\n−.5,2e−3\n1.0,−1\n",
    ],
)
def test_minus_is_read_however_it_is_written(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8", newline="")
    found = read_rows(path, {"time": "t", "positions": ("q",)}, slice(None)).signals
    np.testing.assert_array_equal(np.concatenate([found["time"], found["positions"]], axis=1), EXPECTED)


def test_rows_whose_numbers_have_it_are_no_names(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("−1.5,−3.14\n−.5,2\n", encoding="utf-8")
    assert read_csv(path).rows() == [("-1.5", "-3.14"), ("-.5", "2")]


def test_words_and_names_keep_it(tmp_path):
    frame = pl.DataFrame({"x − y": ["run −1", "−", "−1", None, "1−2"]})
    assert with_hyphens(frame)["x − y"].to_list() == ["run −1", "−", "-1", None, "1−2"]
    path = tmp_path / "a.csv"
    path.write_text("t,x − y\n0,−1\n1,left − 2\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"column `x − y`, line 3 .* got 'left − 2'"):
        read_rows(path, {"time": "t", "positions": ("x − y",)}, slice(None))
