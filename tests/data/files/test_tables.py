"""Tables are read as they are written, and what is wrong in them is named by file, column and row."""

import gzip

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from symoden.data import DataError
from symoden.data.files._layout import find_layout
from symoden.data.files._readers import read_rows
from symoden.data.files._tables import find_short_lines, place

ALL = slice(0, None)


def written(path, text):
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


@given(values=st.lists(st.tuples(st.floats(-1e300, 1e300), st.floats(-1e3, 1e3)), min_size=1, max_size=20))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_numbers_are_read_to_the_last_bit(tmp_path, values):
    lines = [f"{a!r},{b!r}" for a, b in values]
    path = written(tmp_path / "run.csv", "\n".join(["a,b", *lines]))
    np.testing.assert_array_equal(read_rows(path, {"x": ("a", "b")}, ALL).signals["x"], values)


@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz", "RUN.CSV.GZ"])
@pytest.mark.parametrize(
    "text",
    [
        "t,q\n0,1.5\n1,2.5\n",
        "\ufefft;q\r\n0;1.5\r\n1; 2.5\r\n\r\n",
        "# t\tq\n0\t1.5\n1\t+2.5e0",
        't, "q" ,note\n0,1.5,"a, b"\n1,2.5,\n',
        "t,q\n0,1.5,,\n1,2.5\n",
        "t\tq\r\n0\t1.5\t\t\r\n1\t2.5 \t\r\n",
        "t | q\n0 | 1.5\n1 | 2.5\n",
        "sep=;\nt;q\n0;1.5\n1;2.5\n",
        '"sep=,"\r\n# t,q\r\n0,1.5\r\n1,2.5\r\n',
    ],
    ids=["commas", "semicolons", "tabs", "quotes", "surplus commas", "surplus tabs", "bars", "sep=;", "sep=,"],
)
def test_every_usual_way_to_write_a_table_is_understood(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(gzip.compress(text.encode()) if name.lower().endswith("gz") else text.encode())
    found = read_rows(path, {"time": "t", "positions": ("q",), "inputs": ()}, ALL)
    np.testing.assert_array_equal(found.signals["time"][:, 0], [0, 1])
    np.testing.assert_array_equal(found.signals["positions"][:, 0], [1.5, 2.5])
    assert found.signals["inputs"].shape == (2, 0)
    assert found.names == {"time": ("t",), "positions": ("q",), "inputs": ()}


@given(values=st.lists(st.tuples(st.floats(-1e300, 1e300), st.floats(-1e3, 1e3)), min_size=1, max_size=20))
@pytest.mark.parametrize("separator", [";", "\t"])
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_decimal_commas_are_read_to_the_last_bit(tmp_path, separator, values):
    lines = [separator.join([f"{a:.17e}", f"{b:.17e}"]).replace(".", ",") for a, b in values]
    path = written(tmp_path / "run.csv", "\n".join([f"a{separator}b", *lines]))
    np.testing.assert_array_equal(read_rows(path, {"x": ("a", "b")}, ALL).signals["x"], values)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("Zeit;Winkel, rad;Bemerkung\ns;rad;\n0,000;-1,5;Start, links\n1; ,25e1 ;\n2;NaN;\n", ("Zeit", "Winkel, rad")),
        ("0,000;-1,5;2,0;3,1\n1;+2,5;0;0\n2;;0;0\n", ("1", "2")),
        ("Zeit, s;Winkel, rad;Status\n0,0;-1,5;OK\n1,0;2,5;OK\n2,0;NaN;OK\n", ("Zeit, s", "Winkel, rad")),
        ("# Zeit\tWinkel\n0,0\t-1,5\n1,0\t2,5\n2,0\tNaN\n", ("Zeit", "Winkel")),
    ],
    ids=["names, units and remarks", "no names", "commas in names", "tabs"],
)
def test_decimal_commas_are_read_where_no_commas_separate_columns(tmp_path, text, names):
    path = written(tmp_path / "run.csv", text)
    np.testing.assert_array_equal(read_rows(path, {"x": names}, ALL).signals["x"], [[0, -1.5], [1, 2.5], [2, np.nan]])
    assert place(path, 0) == f"line {find_layout(text).line} (row 0)"
    assert not find_short_lines(path).short


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   "])
@pytest.mark.parametrize("before", ["", "# a logger\n\n% of 2026, as it seems\n", "\n\n"])
@pytest.mark.parametrize("head", ["names", "names and units", "comment", "none"])
def test_rows_begin_after_comments_names_and_units(tmp_path, separator, before, head):
    names, units, rows = (
        [separator.join(row) for row in table]
        for table in ([("t", "q1", "u")], [("s", "rad", "N m" if separator == ";" else "Nm")], [("0", "1.5", "-2")] * 3)
    )
    heads = {"names": names, "names and units": names + units, "comment": [f"# {names[0]}"], "none": []}[head]
    path = written(tmp_path / "run.txt", before + "\n".join([*heads, *rows]) + "\n")
    chosen = ("1", "2", "3") if head == "none" else ("t", "q1", "u")
    np.testing.assert_array_equal(read_rows(path, {"x": chosen}, ALL).signals["x"], [[0, 1.5, -2]] * 3)
    first = path.read_text().splitlines().index(rows[0]) + 1
    assert place(path, 2) == f"line {first + 2} (row 2)"
    assert find_short_lines(path) == (3, {}, None)
    path.write_text(path.read_text() + f"9{separator}")
    assert find_short_lines(path) == (3, {3: 1 if separator.isspace() else 2}, 3)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "cp1252"])
@pytest.mark.parametrize("ending", ["", ".gz"])
def test_what_spreadsheets_save_is_read_whatever_its_encoding(tmp_path, encoding, ending):
    text = ("\ufeff" if encoding == "utf-16-be" else "") + "Zeit;Winkel [°]\r\n0;1,5\r\n1;x\r\n2;4\r\n"
    path = tmp_path / f"run.csv{ending}"
    path.write_bytes(gzip.compress(text.encode(encoding)) if ending else text.encode(encoding))
    read = read_rows(path, {"x": ("Zeit",)}, ALL).signals["x"]
    np.testing.assert_array_equal(read[:, 0], [0, 1, 2])
    with pytest.raises(DataError, match=r"column `Winkel \[°\]`, line 3 \(row 1\): must be a number or empty; got 'x'"):
        read_rows(path, {"x": ("Winkel [°]",)}, ALL)


@pytest.mark.parametrize(
    ("contents", "said"),
    [
        ("a;b [°]".encode()[:-2], "Perhaps it was cut off"),
        ("a;b\n1;2\n".encode("utf-16")[:-1], "Perhaps it was cut off"),
        ("a;b [°]\n1;2".encode() + b"\xff;3\n", "position 12: invalid start byte. Save it as one"),
    ],
)
def test_text_that_is_broken_is_refused_and_not_taken_for_another_encoding(tmp_path, contents, said):
    path = tmp_path / "run.csv"
    path.write_bytes(contents)
    with pytest.raises(DataError, match="must be a complete CSV file in UTF-8") as caught:
        read_rows(path, {"x": ("a",)}, ALL)
    assert said in str(caught.value)


def test_a_name_may_keep_the_mark_of_comments_that_its_line_has(tmp_path):
    path = written(tmp_path / "run.csv", "%time,field.position0\n0,1\n1,2\n")
    for name in ("%time", "time", "# time"):
        np.testing.assert_array_equal(read_rows(path, {"x": (name,)}, ALL).signals["x"][:, 0], [0, 1])


def test_a_line_that_lacks_a_cell_between_blanks_lacks_all(tmp_path):
    path = written(tmp_path / "run.txt", "t q u\n0 1 2\n1   5\n2 3 4\n")
    read = read_rows(path, {"x": ("t", "q", "u")}, ALL).signals["x"]
    np.testing.assert_array_equal(read, [[0, 1, 2], [np.nan] * 3, [2, 3, 4]])
    assert find_short_lines(path) == (3, {1: 2}, None)


@pytest.mark.parametrize("end", ["]", "];\n", ";]\n\n", "\n];\n", "]\r\n"])
@pytest.mark.parametrize("begin", ["[", "  [  ", "data = [", "data = [\n", "t  q 1\n[", "t  q 1\n\n["])
@pytest.mark.parametrize("separator", ["  ", "\t", ","])
def test_a_matrix_as_matlab_writes_it_is_a_table(tmp_path, begin, separator, end):
    rows = [(0.0, -1.5), (0.1, 2e-3), (0.2, 7.0), (0.3, 0.25)]
    text = begin.replace("t  q", f"t{separator}q") + ";\n".join(f"{t}{separator}{q}" for t, q in rows) + end
    names = ("t", "q 1") if "q 1" in begin else ("1", "2")
    path = written(tmp_path / "run.txt", text.replace("\n", "\r\n") if "\r" in end else text)
    found = read_rows(path, {"all": names}, ALL).signals["all"]
    np.testing.assert_array_equal(found[:4], rows)
    assert np.isnan(found[4:]).all()


def test_columns_without_names_have_numbers(tmp_path):
    path = written(tmp_path / "run.dat", "0 1.5\n1 2\n")
    with pytest.raises(
        DataError, match=r"no column `q`; found `1, 2`\. .* No line names the columns: their numbers do"
    ):
        read_rows(path, {"x": ("q",)}, ALL)


def test_parquet_is_read_by_column(tmp_path):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"q": [1, 2, 3], "u": [True, False, True], "note": ["a", "b", "c"]}).write_parquet(path)
    found = read_rows(path, {"x": ("u", "q")}, slice(1, None))
    np.testing.assert_array_equal(found.signals["x"], [[0, 2], [1, 3]])


@pytest.mark.parametrize("kind", [pl.List(pl.Float32), pl.Array(pl.Float64, 2)])
def test_cells_that_hold_lists_are_columns(tmp_path, kind):
    path = tmp_path / "run.parquet"
    pl.DataFrame(
        {"q": [[1, 2], [3, None], None], "u[0]": [7, 8, 9]}, schema={"q": kind, "u[0]": pl.Int64}
    ).write_parquet(path)
    found = read_rows(path, {"x": "q", "y": ("q[1]", "u[0]")}, ALL)
    np.testing.assert_array_equal(found.signals["x"], [[1, 2], [3, np.nan], [np.nan] * 2])
    np.testing.assert_array_equal(found.signals["y"], [[2, 7], [np.nan, 8], [np.nan, 9]])
    assert found.names == {"x": ("q[0]", "q[1]"), "y": ("q[1]", "u[0]")}


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ([[1.0, 2.0], [1.0]], r"the lists of column `q` must be of one length, at least 1; got `1, 2`"),
        ([["a"], ["b"]], r"column `q` must hold lists of numbers; got List\(String\)"),
        ([[{"x": 1}], [{"x": 2}]], r"column `q` must hold lists of numbers; got List\(Struct"),
        ([None, None], r"column `q` must hold"),
        ([[], []], r"column `q` must hold lists of numbers; got List\(Null\)"),
    ],
)
def test_lists_that_are_no_columns_are_refused(tmp_path, cells, said):
    pl.DataFrame({"q": cells}).write_parquet(tmp_path / "run.parquet")
    with pytest.raises(DataError, match=said):
        read_rows(tmp_path / "run.parquet", {"x": "q"}, ALL)


@pytest.mark.parametrize(
    ("rows", "start", "stop"), [((0, None), 0, 5), ((1, 3), 1, 3), ((-2, None), 3, 5), ((0, -1), 0, 4), ((2, 99), 2, 5)]
)
def test_rows_select_as_python_does(tmp_path, rows, start, stop):
    path = written(tmp_path / "run.csv", "a\n0\n1\n2\n3\n4")
    found = read_rows(path, {"x": ("a",)}, slice(*rows))
    np.testing.assert_array_equal(found.index, range(start, stop))
    assert len(found) == stop - start
    np.testing.assert_array_equal(found.signals["x"][:, 0], range(start, stop))


@pytest.mark.parametrize(
    "cell",
    [
        "",
        " ",
        "nan",
        "NaN",
        "NA",
        "n/a",
        "#N/A",
        "null",
        "None",
        "inf",
        "-inf",
        "-",
        "---",
        "***",
        "?",
        "--.--",
        "#",
        "_",
    ],
)
def test_a_cell_without_a_number_is_nan(tmp_path, cell):
    path = written(tmp_path / "run.csv", f"a,b\n1,2\n3,{cell}\n5,6")
    np.testing.assert_array_equal(read_rows(path, {"x": ("a", "b")}, ALL).signals["x"], [[1, 2], [3, np.nan], [5, 6]])


@pytest.mark.parametrize("cell", ["-1x", "-e", "a-", "- 1"])
def test_marks_beside_letters_or_digits_are_no_missing_numbers(tmp_path, cell):
    path = written(tmp_path / "run.csv", f"a,b\n1,2\n3,{cell}\n5,6")
    with pytest.raises(DataError, match=f"must be a number or empty; got '{cell}'"):
        read_rows(path, {"x": ("a", "b")}, ALL)


def test_a_column_of_marks_alone_is_refused(tmp_path):
    path = written(tmp_path / "run.csv", "a,b\n1,---\n3,\n5,---")
    with pytest.raises(DataError, match=r"column `b`, line 2 \(row 0\): must be a number or empty; got '---'"):
        read_rows(path, {"x": ("a", "b")}, ALL)


@pytest.mark.parametrize("text", ["0.5,---\n1,2.5\n2,3", "t,b\n0.5,---\n1,2.5\n2,3"], ids=["no names", "names"])
def test_marks_in_the_first_row_are_no_names(tmp_path, text):
    names = ("t", "b") if text.startswith("t") else ("1", "2")
    found = read_rows(written(tmp_path / "run.csv", text), {"x": names}, ALL)
    np.testing.assert_array_equal(found.signals["x"], [[0.5, np.nan], [1, 2.5], [2, 3]])


def test_marks_among_times_of_day_are_missing(tmp_path):
    path = written(tmp_path / "run.csv", "a\n---\n10:00:01\n?\n10:00:03")
    np.testing.assert_array_equal(
        read_rows(path, {"x": ("a",)}, ALL).signals["x"][:, 0], [np.nan, 36001, np.nan, 36003]
    )


def test_an_empty_line_and_a_null_are_nan(tmp_path):
    path = written(tmp_path / "run.csv", "a\n1\n\n3")
    np.testing.assert_array_equal(read_rows(path, {"x": ("a",)}, ALL).signals["x"][:, 0], [1, np.nan, 3])
    pl.DataFrame({"a": [1, None, 3]}).write_parquet(tmp_path / "run.parquet")
    found = read_rows(tmp_path / "run.parquet", {"x": ("a",)}, ALL)
    np.testing.assert_array_equal(found.signals["x"][:, 0], [1, np.nan, 3])


def test_what_is_wrong_outside_the_rows_does_no_harm(tmp_path):
    path = written(tmp_path / "run.csv", "a,b\noops,1\n2,\n3,4\nnan,5")
    np.testing.assert_array_equal(read_rows(path, {"x": ("a", "b")}, slice(2, 3)).signals["x"], [[3, 4]])


BAD = [
    ("t,q\n0,1", "no column `a`; found `t, q`"),
    ("t,A1,b\n0,1,1", r"no column `a`; found `t, A1, b`\. Did you mean `A1`\? Give the names as the file has them"),
    ("a,b\n1,2\n3,on\n", r"column `b`, line 3 \(row 1\): must be a number or empty; got 'on'"),
    ('a,b\n"1000,010751",2\n', r"got '1000,010751'\. Decimal commas are read where semicolons or tabs .* with decimal"),
    ("a;b\n1000,010751;2.5\n", r"got '1000,010751'\. Decimal commas are read where .* no number has a point"),
    ("a;b\n7;2\n1,250;3\n", r"row 1\): must be a number or empty; got '1,250'\. Decimal commas"),  # Thousands?
    ("a,b\n1,2\n1,2,3", r"a cell for each of the 2 columns; got 3 in line 3 \(row 1\): '1,2,3'"),
    ("a,b\n0,5,1,5\n", r"got 4 in line 2 \(row 0\): '0,5,1,5'\. Where commas are decimal marks, semicolons or"),
    ("a;b\n1;2\n1;2;;3;", r"got 5 in line 3 \(row 1\): '1;2;;3;'\.$"),
    ("a,b\n0,0.5,1,1.5\n1,0.5,2,1.5\n", r"got 4 in line 2 .*\. Names seem to be missing: write one for each of the 4"),
    ("a,b\n0,0.5,1.5\n1,0.5\n", r"got 3 in line 2 \(row 0\): '0,0.5,1.5'\. Where commas are"),
    ('a,b\n1,"2\n1,2', "must be a table of text; reading stopped at"),
    ("a,b,a\n1,2,3", "column `a` must be there once; got it twice"),
    ("", "is empty"),
    ("\n \n", "is empty; it must have a line of column names"),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[message for _, message in BAD])
def test_a_bad_table_is_refused_by_name_and_row(tmp_path, text, message):
    path = written(tmp_path / "run.csv", text)
    with pytest.raises(DataError, match=message) as caught:
        read_rows(path, {"x": ("a", "b")}, ALL)
    assert str(caught.value).startswith(f"`{path}`: ")


def test_the_row_of_an_error_is_the_files_row(tmp_path):
    path = written(tmp_path / "run.csv", "a\n0\n1\n2\nx\n")
    with pytest.raises(DataError, match=r"column `a`, line 5 \(row 3\): "):
        read_rows(path, {"x": ("a",)}, slice(2, None))


def test_of_many_words_the_first_is_named_and_how_many_there_are_up_to_where(tmp_path):
    path = written(tmp_path / "run.csv", "a,b,c\n0,0,x\n1,off,0\n2,0,0\nERR,,0\nERR,NA,0\n5,no,0\n")
    said = (
        r"column `b`, line 3 \(row 1\): .* got 'off', the first of 4 such cells up to line 7 \(row 5\): 2 in `a`, 2 in"
    )
    with pytest.raises(DataError, match=said + " `b`. Correct them, or select rows without them by `rows`"):
        read_rows(path, {"x": ("a", "b")}, ALL)
    with pytest.raises(DataError, match=r"line 5 \(row 3\): .* first of 2 such cells up to line 6 \(row 4\)\. Correct"):
        read_rows(path, {"x": ("a",)}, slice(2, None))


def test_a_row_of_a_file_that_is_no_text_is_no_line(tmp_path):
    pl.DataFrame({"a": ["1", "x"]}).write_parquet(tmp_path / "run.parquet")
    with pytest.raises(DataError, match="column `a`, row 1: "):
        read_rows(tmp_path / "run.parquet", {"x": ("a",)}, ALL)


@pytest.mark.parametrize("last", ["5", "5,-", "5,6"])
@pytest.mark.parametrize("ending", ["", "\r"])
def test_a_line_in_whose_middle_a_file_ends_has_no_numbers(tmp_path, last, ending):
    path = written(tmp_path / "run.csv", f"a,b,c{ending}\n1,2,3{ending}\n{last}")
    assert find_short_lines(path).cut == 1
    read = read_rows(path, {"x": ("a", "b", "c")}, ALL).signals["x"]
    np.testing.assert_array_equal(read, [[1, 2, 3], [np.nan] * 3])


@pytest.mark.parametrize("text", ["a,b\n1,2", "a,b\n1,2\n", "a,b\n1,2\n  ", "a,b", "a,b\n1,2\n3\n"])
def test_a_file_that_does_not_end_in_the_middle_of_a_line_keeps_its_numbers(tmp_path, text):
    path = written(tmp_path / "run.csv", text)
    assert find_short_lines(path).cut is None
    read = read_rows(path, {"x": ("a",)}, ALL).signals["x"]
    assert len(read) == len(text.split()) - 1
    assert np.isfinite(read).all()


@pytest.mark.parametrize("cut", [5, 40, -1, -9])
def test_a_truncated_compressed_table_is_refused(tmp_path, cut):
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"a\n" + b"".join(b"%d\n" % i for i in range(500)))[:cut])
    with pytest.raises(
        DataError, match=r"must be a complete CSV file in UTF-8; reading stopped at.*\. Perhaps .*copy it"
    ):
        read_rows(path, {"x": ("a",)}, ALL)


@pytest.mark.parametrize("name", ["run.csv.gz", "run.csv", "run.parquet"])
def test_bytes_of_something_else_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"\xff\xfe\x00PAR1" + bytes(range(256)) * 4 + b"PAR1")
    with pytest.raises(DataError, match=f"{name}`: must be a complete"):
        read_rows(tmp_path / name, {"x": ("a",)}, ALL)


def test_every_truncation_of_a_parquet_file_is_refused(tmp_path):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"a": np.arange(100.0)}).write_parquet(path)
    whole = path.read_bytes()
    for cut in range(1, len(whole), 37):
        path.write_bytes(whole[:cut])
        with pytest.raises(DataError, match=r"must be a complete Parquet file.* copy it again"):
            read_rows(path, {"x": ("a",)}, ALL)


def test_a_parquet_column_that_is_no_number_is_refused(tmp_path):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"a": [{"x": 1.0}, {"x": 2.0}]}).write_parquet(path)
    with pytest.raises(DataError, match="column `a` must hold numbers; got Struct"):
        read_rows(path, {"x": ("a",)}, ALL)


def test_a_file_that_unpacks_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("symoden.data.files._tables.LARGEST", 1 << 20)
    monkeypatch.setattr("symoden.data.files._limits.LARGEST", 1 << 20)
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"a\n" + b"0\n" * (1 << 20)))
    with pytest.raises(DataError, match="the file must have at most 1 MiB"):
        read_rows(path, {"x": ("a",)}, ALL)


def test_an_unknown_ending_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"run.yml`: the name must end in one of `\.csv, \.txt, .*\.parquet"):
        read_rows(written(tmp_path / "run.yml", "a: 1"), {"x": ("a",)}, ALL)


def test_an_absent_file_is_refused(tmp_path):
    with pytest.raises(DataError, match="cannot be read: No such file"):
        read_rows(tmp_path / "run.csv", {"x": ("a",)}, ALL)
