"""Descriptions and tables in memory: the same data set as from files, and words on what is none."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import symoden
from symoden.data import DataError, DataWarning, check_dataset, read_dataset

TS = np.linspace(0.0, 2.0, 201)
COLUMNS = {"time": "t", "positions": ["q"], "inputs": ["u"]}
SAID = {"space": "T1", **COLUMNS, "train": {"files": ["swing[12]"]}, "test": {"files": ["swing3"]}}
LINES = [
    'space = "T1"\ntime = "t"\npositions = ["q"]\ninputs = ["u"]',
    '[train]\nfiles = ["swing[12].csv"]',
    '[test]\nfiles = ["swing3.csv"]',
]


def swing(k: int) -> dict[str, np.ndarray]:
    """Columns of a recording."""
    return {"t": TS, "q": np.sin(3 * TS + k), "u": np.cos(5 * TS)}


TABLES = {f"swing{k}": swing(k) for k in (1, 2, 3)}


def changed(**columns: object) -> dict[str, dict[str, object]]:
    """The tables, with other columns in the last one."""
    last: dict[str, object] = {**swing(3), **columns}
    return {"swing1": {**swing(1)}, "swing2": {**swing(2)}, "swing3": last}


class Frame:
    """A data frame that is no mapping, as that of pandas."""

    def __init__(self, columns: dict[str, np.ndarray], names: list[str] | None = None) -> None:
        self._held = columns
        self.columns = np.array(list(columns) if names is None else names, dtype=object)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._held[name]

    def reset_index(self) -> "Frame":
        """Its index is no column."""
        return self


KINDS = {
    "mapping": dict,
    "lists": lambda columns: {name: column.tolist() for name, column in columns.items()},
    "structured": lambda columns: np.array(
        list(zip(*columns.values(), strict=True)), [(name, float) for name in columns]
    ),
    "polars": pl.DataFrame,
    "frame": Frame,
    "objects": lambda columns: {name: column.astype(object) for name, column in columns.items()},
    "mixed objects": lambda columns: {name: np.array([*column], object) for name, column in columns.items()},
    "texts": lambda columns: {name: [repr(float(x)) for x in column] for name, column in columns.items()},
    "more": lambda columns: columns | {"gain": 3.0, "image": np.zeros((7, 7)), "ragged": [[1], [1, 2]]},
}


@pytest.mark.parametrize("kind", KINDS)
def test_tables_in_memory_give_what_files_give(tmp_path, kind):
    for name, table in TABLES.items():
        pl.DataFrame(table).write_csv(tmp_path / f"{name}.csv")
    (tmp_path / "description.toml").write_text("\n".join(LINES))
    of_files = read_dataset(tmp_path / "description.toml")
    in_memory = read_dataset(SAID, tables={name: KINDS[kind](table) for name, table in TABLES.items()})
    assert in_memory.digest == of_files.digest
    assert [each.name for each in in_memory.recordings] == ["swing1", "swing2", "swing3"]


def test_a_description_in_memory_may_name_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pl.DataFrame(swing(1)).write_csv("swing1.csv")
    said = SAID | {"train": {"files": [Path("swing1.csv")]}, "input_matrix": np.eye(1), "positions": ("q",)}
    said["inputs"] = np.array(["u"])
    del said["test"]
    assert read_dataset(said).input_matrix == np.eye(1)


def test_tables_may_take_the_place_of_files_that_a_file_describes(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(LINES[0] + '\n[train]\nfiles = ["swing3"]\n')
    holed = np.where(TS[50] == TS, np.nan, swing(3)["q"])
    with pytest.warns(DataWarning, match=r"1 row without all numbers. `symoden.check_dataset` says what"):
        assert len(read_dataset(path, tables=changed(q=holed)).train[0]) == 200


def test_arrays_of_two_axes_are_variables_and_stay_as_they_are():
    arrays = {"t": TS, "q": np.sin(np.stack([TS, 2 * TS], axis=1)), "u": np.full((201, 1), np.inf)}
    arrays["u"][1:] = 1.0
    given = {name: array.copy() for name, array in arrays.items()}
    said = {"space": "T2", "time": "t", "positions": "q", "inputs": "u", "train": {"files": ["*"]}}
    with pytest.warns(DataWarning, match=r"left out in `both`: 1 row without all numbers"):
        (recording,) = read_dataset(said, tables={"both": arrays}).train
    assert recording.q.shape == (200, 2)
    assert all(np.array_equal(arrays[name], given[name]) for name in arrays)


@pytest.mark.parametrize(
    "stamps",
    [
        np.datetime64("2025-01-01") + (1e6 * TS).astype("timedelta64[us]"),
        (1e9 * TS).astype("timedelta64[ns]"),
        [f"2025-01-01T00:00:{t:05.2f}" for t in TS],
    ],
    ids=["dates", "durations", "texts"],
)
@pytest.mark.parametrize("axes", [1, 2])
def test_time_may_be_dates_and_durations(stamps, axes):
    dataset = read_dataset(SAID, tables=changed(t=stamps, q=swing(3)["q"].reshape((201, 1)[:axes])))
    np.testing.assert_allclose(np.diff(dataset.test[0].ts), 0.01, atol=1e-6)


def test_objects_are_what_they_are_whatever_comes_first():
    column = [np.int64(0), None, *swing(3)["u"][2:]]
    with pytest.warns(DataWarning, match="1 missing number of `u`"):
        us = read_dataset(SAID, tables=changed(u=column)).test[0].us[:, 0]
    assert us[-1] == swing(3)["u"][-1]


def test_masked_dates_and_words_are_missing():
    stamps = np.ma.array(np.datetime64("2025-01-01") + (1e6 * TS).astype("timedelta64[us]"), mask=np.arange(201) == 7)
    notes = np.ma.array(["fine"] * 201, mask=TS < 1)
    with pytest.warns(DataWarning, match="1 row without all numbers"):
        (recording,) = read_dataset(SAID, tables=changed(t=stamps, note=notes)).test
    assert recording.duration == pytest.approx(2.0, abs=1e-6)


def test_a_star_stands_for_recordings_in_memory_too():
    every = {f"{run}/{name}": column for run in ("a", "b") for name, column in swing(1).items()}
    said = {"space": "T1", "time": "*/t", "positions": ["*/q"], "inputs": ["*/u"], "train": {"files": ["*"]}}
    for kind in (dict, pl.DataFrame):
        assert [each.name for each in read_dataset(said, tables={"log": kind(every)}).train] == ["log-a", "log-b"]


def test_a_link_beside_it_is_no_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("swing2").symlink_to("swing1")
    assert len(read_dataset(SAID, tables=TABLES).train) == 2


def test_columns_that_are_not_wanted_may_be_anything():
    class Far:
        def __array__(self, *_, **__):
            raise RuntimeError("it is elsewhere")

    assert len(read_dataset(SAID, tables=changed(image=Far())).recordings) == 3
    with pytest.raises(DataError, match=r"`swing3`: column `q` must be an array of numbers: it is elsewhere"):
        read_dataset(SAID, tables=changed(q=Far()))


@pytest.mark.parametrize("hidden", [np.ma.masked_equal(swing(3)["q"], swing(3)["q"][50]), None], ids=["masked", "none"])
def test_numbers_that_are_hidden_are_missing(hidden):
    column = [*swing(3)["q"][:50], None, *swing(3)["q"][51:]] if hidden is None else hidden
    with pytest.warns(DataWarning, match=r"in `swing3`: 1 row without all numbers. `symoden.check_dataset` says what"):
        assert len(read_dataset(SAID, tables=changed(q=column)).test[0]) == 200


def test_a_table_may_be_in_two_parts_by_its_recordings():
    table = {name: np.concatenate([swing(1)[name], swing(2)[name]]) for name in ("q", "u")}
    table |= {"t": np.concatenate([TS, TS]), "run": np.array(["a"] * 201 + ["b"] * 201)}
    said = SAID | {"recording": "run", "train": {"files": ["log"], "recordings": ["a"]}, "test": {"files": ["log"]}}
    dataset = read_dataset(said, tables={"log": table})
    assert [each.name for each in dataset.recordings] == ["log-a", "log-b"]


def test_rows_in_common_are_named_by_the_table():
    said = SAID | {"test": {"files": ["swing2"]}}
    with pytest.raises(DataError, match=r"both have rows 0 to 200 of `swing2`\."):
        read_dataset(said, tables=TABLES)


def test_known_parts_may_be_functions():
    known = symoden.KnownParts(potential_energy=lambda q: 9.81 * (1.0 - np.cos(q[0])))
    assert read_dataset(SAID | {"known": known}, tables=TABLES).known is known


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"swing1.MAT": swing(1)}, r"without the ending of a file's; got `swing1.MAT`: leave out `.mat`\."),
        *(({name: swing(1)}, rf"`tables` must have names, .*; got {name!r}\.") for name in ("", "./a", "a/", "a/../b")),
        ({"swing1": swing(1)}, r"no table matches `swing3`; got `swing1`\. Did you mean `swing1`\?"),
        (TABLES | {"swing3": None}, r"`swing3`: a table must be a mapping of names to arrays, .*; got None\."),
        (TABLES | {"swing3": Frame(swing(3), names=["t", "q", "u", "q"])}, r"`swing3`: column `q` must be there once"),
        (TABLES | {"swing3": Frame(swing(3), names=["q", "u"])}, r"no column `t`; .* `reset_index\(\)` makes it one\."),
        (TABLES | {"swing3": TS}, r"`swing3`: a table must be a mapping .*; got an array of float64\."),
        (TABLES | {"swing3": {"t": TS, "q": TS}}, r"`swing3`: no column `u`; found `t, q`\."),
        (changed(q=TS[1:]), r"`swing3`: all variables must have the same number of samples"),
        (changed(q=[[1], [1, 2]]), r"`swing3`: column `q` must be an array of numbers: .* inhomogeneous"),
        (changed(q=["cut"] * 201), r"`swing3`: column `q`, row 0: must be a number or empty; got 'cut'"),
    ],
)
def test_what_is_no_table_is_refused_in_words(tables, message):
    with pytest.raises(DataError, match=message):
        read_dataset(SAID, tables=tables)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (SAID | {"position": ["q"]}, r"`description`: a description has no key `position`. Did you mean `positions`\?"),
        (
            SAID | {"train": ["swing1"]},
            r"`description`: \[train\] must be a table of keys, such as `files`; got \['swing1'\]",
        ),
        (SAID | {"dt": None}, r"`description`: `dt` must be a positive number of seconds; got None"),
    ],
)
def test_what_is_no_description_is_refused_in_words(said, message):
    with pytest.raises(DataError, match=message):
        read_dataset(said, tables=TABLES)


def test_a_check_in_memory_says_what_was_found():
    q = np.degrees(swing(3)["q"])
    q[50] = np.nan
    check = check_dataset(SAID | {"units": {"q": "deg"}}, tables=changed(q=q))
    assert not check.refused
    assert "- masked in swing3: `q` lacks 1 of 201 numbers, in 1 stretch, first at row 50." in str(check).splitlines()


def test_what_was_found_is_a_line_and_printed_it_is_words():
    check = check_dataset(SAID, tables=TABLES)
    assert repr(check) == f"DatasetCheck(3 recordings: {len(check.findings)} findings; print it to read them)"
