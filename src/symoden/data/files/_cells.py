"""Columns of a table: numbers, lists of numbers, or words."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from symoden.data._errors import AbsentError, DataError, listing

from ._layout import MARKS, NOTHING
from ._tables import place

_WHOLE: Final = re.compile(r"^([+-]?\d+)\.0*$")
_DATE: Final = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_ZONE: Final = re.compile(r"(Z|[+-]\d\d:?\d\d)$")
_CLOCK: Final = r"^([0-9]{1,2}):([0-5][0-9]):((?:[0-5][0-9]|60)(?:[.,][0-9]*)?)$"  # Time of day.
_DAY: Final = 86_400.0  # s
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


class _Words(NamedTuple):
    """Cells of a column that are neither numbers nor empty: their rows, and what the first one says."""

    name: str
    rows: np.ndarray
    first: str


def numbers(path: Path, frame: pl.DataFrame, names: Sequence[str], *, first_row: int) -> dict[str, np.ndarray]:
    """Take columns of numbers out of a table.

    Args:
        path: File, for messages.
        frame: The table, rows already selected.
        names: The columns.
        first_row: Row of the file that is the table's first row, for messages.

    Returns:
        The columns by name; NaN where a cell is empty or says that it is, by a word or by marks such as `---`. Dates
        with a time are seconds since 1970, UTC where they name no zone; times of day are seconds since the midnight
        before the first.

    Raises:
        DataError: If a column is absent or twice there, or a cell is no number.
    """
    columns = {name: _stripped(_column(path, frame, name)) for name in names}
    read: dict[str, np.ndarray] = {}
    words: list[_Words] = []
    for name, column in columns.items():
        read[name], is_word = _read(path, name, _seconds(column))
        if is_word.any():
            rows = np.flatnonzero(is_word)
            words.append(_Words(name, rows, str(column[int(rows[0])])))
    if words:
        _refuse(path, words, first_row)
    return read


def _stripped(column: pl.Series) -> pl.Series:
    """A column without blanks around its words."""
    return column.str.strip_chars() if column.dtype == pl.String else column


def _read(path: Path, name: str, column: pl.Series) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of a column, NaN where there is none, and which cells say something else."""
    if column.dtype == pl.String and re.match(_CLOCK, _first(column)):
        return _since_midnight(column)
    if column.dtype == pl.String:
        cast = column.cast(pl.Float64, strict=False)
        # A column of nothing but dashes has lost more than a number.
        is_missing = _is_missing if cast.is_not_null().any() else _is_empty
        is_word = cast.is_null() & ~is_missing(column)
    elif column.dtype.is_numeric() or column.dtype == pl.Boolean:
        cast = column.cast(pl.Float64)
        is_word = pl.repeat(value=False, n=len(column), eager=True)
    else:
        raise DataError(f"`{path}`: column `{name}` must hold numbers; got {column.dtype}.")
    return cast.fill_null(math.nan).to_numpy().astype(np.float64), is_word.to_numpy()


def holds_lists(column: pl.Series) -> bool:
    """Whether the cells of a column are lists."""
    return isinstance(column.dtype, pl.List | pl.Array)


def lists(path: Path, frame: pl.DataFrame, name: str) -> np.ndarray:
    """Take a column of lists of numbers out of a table.

    Args:
        path: File, for messages.
        frame: The table, rows already selected.
        name: The column.

    Returns:
        A column for each item (T, k); NaN where a cell or an item is empty.

    Raises:
        DataError: If lists differ in length, or hold anything but numbers.
    """
    column = frame[name]
    if isinstance(column.dtype, pl.Array):
        column = column.arr.to_list()
    inner = column.dtype.inner if isinstance(column.dtype, pl.List) else column.dtype
    if not (inner.is_numeric() or inner == pl.Boolean):
        raise DataError(f"`{path}`: column `{name}` must hold lists of numbers; got {column.dtype}.")
    lengths = column.list.len().drop_nulls().unique().sort().to_list()
    if len(lengths) != 1 or not lengths[0]:
        raise DataError(
            f"`{path}`: the lists of column `{name}` must be of one length, at least 1; got "
            f"{listing(map(str, lengths))}. Write a column for each number, or leave these rows out by `rows`."
        )
    items = [column.list.get(i).cast(pl.Float64).fill_null(math.nan).to_numpy() for i in range(lengths[0])]
    return np.stack(items, axis=1).astype(np.float64)


def texts(path: Path, frame: pl.DataFrame, name: str) -> np.ndarray:
    """Take a column of words, or of numbers that stand for words, out of a table.

    Args:
        path: File, for messages.
        frame: The table, rows already selected.
        name: The column.

    Returns:
        What its cells say, `3` for `3.0`; nothing where one is empty.

    Raises:
        DataError: If the column is absent or twice there, or holds neither numbers nor words.
    """
    column = _column(path, frame, name)
    if column.dtype.is_float():
        return np.array([label(value) for value in column.fill_null(math.nan).to_list()], str)
    if not (column.dtype.is_integer() or column.dtype in (pl.String, pl.Boolean, pl.Categorical, pl.Enum)):
        raise DataError(f"`{path}`: column `{name}` must hold numbers or words; got {column.dtype}.")
    words = column.cast(pl.String).fill_null("").str.strip_chars()
    empty = _says_nothing(words)
    return np.array(["" if none else label(word) for word, none in zip(words, empty, strict=True)], str)


def label(value: str | float) -> str:
    """What names a recording: a word as it is, a whole number without a point, nothing for a number that is none.

    Args:
        value: The word or number.

    Returns:
        The name.
    """
    if isinstance(value, str):
        return _WHOLE.sub(r"\1", value)
    if math.isnan(value):
        return ""
    return str(int(value)) if float(value).is_integer() else str(value)


def _column(path: Path, frame: pl.DataFrame, name: str) -> pl.Series:
    """A column that is there once."""
    if name not in frame.columns and (bare := name.lstrip("#% ")) in frame.columns and bare:
        name = bare  # A mark of comments before the names is no part of the first.
    if name not in frame.columns:
        numbered = frame.columns == [str(i + 1) for i in range(frame.width)]
        hint = " No line names the columns: their numbers do, from 1 on." if numbered else ""
        raise AbsentError(path, name, frame.columns, hint=hint)
    if f"{name} (again)" in frame.columns:
        raise DataError(f"`{path}`: column `{name}` must be there once; got it twice. Rename one of them.")
    return frame[name]


def _seconds(column: pl.Series) -> pl.Series:
    """Dates with a time, also ISO 8601's as text, as seconds since 1970, durations as seconds; another as it is."""
    if column.dtype == pl.String:
        first = _first(column)
        if not _DATE.match(first):
            return column
        try:
            column = column.str.to_datetime(time_unit="ns", time_zone="UTC" if _ZONE.search(first) else None)
        except pl.exceptions.PolarsError:
            return column  # Its words will be named.
    if column.dtype == pl.Duration:
        return column.dt.total_nanoseconds().cast(pl.Float64) / 1e9
    if column.dtype != pl.Datetime:
        return column
    return column.dt.epoch("ns").cast(pl.Float64) / 1e9


def _since_midnight(column: pl.Series) -> tuple[np.ndarray, np.ndarray]:
    """Times of day as seconds since the midnight before the first, NaN where there is none; which cells are others."""
    fields = column.str.replace(",", ".", literal=True).str.extract_groups(_CLOCK).struct.unnest()
    hours, minutes, seconds = (fields.to_series(i).cast(pl.Float64) for i in range(3))
    is_word = hours.is_null() & ~(_says_nothing(column) | _is_missing(column))
    clock = (hours * 3600 + minutes * 60 + seconds).fill_null(math.nan).to_numpy(writable=True)
    there = np.flatnonzero(np.isfinite(clock))
    days, jumps = np.zeros(len(there)), np.diff(clock[there], prepend=clock[there[:1]])
    for k in np.flatnonzero(np.abs(jumps) > _DAY / 2):  # Past midnight; and back, where rows are out of order.
        days[k:] = max(0.0, days[k] - np.sign(jumps[k]))
    clock[there] += _DAY * days
    return clock, is_word.to_numpy()


def _first(column: pl.Series) -> str:
    """The first cell of a column of texts that says something."""
    return next(iter(column.filter(~(_says_nothing(column) | _is_missing(column))).head(1)), "")


def _says_nothing(column: pl.Series) -> pl.Series:
    """Which cells of a column of texts are empty, or NaN."""
    return _is_empty(column) | (column.str.to_lowercase() == "nan").fill_null(value=True)


def _is_empty(column: pl.Series) -> pl.Series:
    """Which cells of a column of texts say nothing, or that nothing is there."""
    return column.str.to_lowercase().is_in(NOTHING).fill_null(value=True)


def _is_missing(column: pl.Series) -> pl.Series:
    """The same, or are made of marks that stand for a missing number."""
    return _is_empty(column) | column.str.contains(MARKS).fill_null(value=True)


def _refuse(path: Path, words: Sequence[_Words], first_row: int) -> None:
    """Refuse columns that have words among their numbers."""
    first = min(words, key=lambda each: each.rows[0])
    count, last = sum(len(each.rows) for each in words), max(each.rows[-1] for each in words)
    where, end = (place(path, first_row + int(row)) for row in (first.rows[0], last))
    told = f", the first of {count} such cells up to {end}" if count > 1 else ""
    if len(words) > 1:
        told += f": {', '.join(f'{len(each.rows)} in `{each.name}`' for each in words)}"
    raise DataError(
        f"`{path}`: column `{first.name}`, {where}: must be a number or empty; got {first.first!r}{told}. "
        f"{_advice(first.first, several=count > 1)}"
    )


def _advice(word: str, *, several: bool) -> str:
    """What to do about words among numbers."""
    if _DECIMAL_COMMA.fullmatch(word):
        return (
            "Decimal commas are read where semicolons or tabs separate the columns and no number has a point: "
            "write the file again so, or with decimal points (1.5 instead of 1,5)."
        )
    if re.match(r"[0-9]+:", word):
        return "Times of day are read where all of the column are like 10:04:01.3."
    if _DATE.match(word):
        return "Dates are read where all of the column are of one form of ISO 8601, such as 2025-10-09T08:53:20.25Z."
    what = "them" if several else "it"
    return f"Correct {what}, or select rows without {what} by `rows`."


def known_numbers(path: Path, frame: pl.DataFrame, name: str) -> np.ndarray:
    """Read the numbers that a column has, whatever else it has.

    Args:
        path: File of the table, for messages.
        frame: The table.
        name: Name of the column.

    Returns:
        The finite ones, in order; none where it has words.
    """
    try:
        column = numbers(path, frame, [name], first_row=0)[name]
    except DataError:
        return np.zeros(0)
    return column[np.isfinite(column)]
