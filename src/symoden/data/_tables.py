"""Reading tables: CSV, also compressed, and Parquet."""

import csv
import gzip
import math
import re
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import polars as pl

from ._errors import COPY, DataError, missing, place
from ._limits import LARGEST, refuse_large

_NOTHING = ("", "na", "n/a", "null", "none")  # what tables write where a sample is missing; NaN is a number
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_BROKEN_GZIP = (EOFError, gzip.BadGzipFile, zlib.error)


def read_csv(path: Path) -> pl.DataFrame:
    """Read a table of text, its first line naming the columns; separated by commas, semicolons or tabs.

    Args:
        path: File; its name ends in `.gz` if it is compressed.

    Returns:
        The columns as they are written, still text.

    Raises:
        DataError: If the file is empty, broken or no table.
    """
    try:
        text = _text(path)
    except (*_BROKEN_GZIP, UnicodeDecodeError) as error:
        reason = f"{error}. {'Save it as one.' if isinstance(error, UnicodeDecodeError) else COPY}"
        raise DataError(f"`{path}`: must be a complete CSV file in UTF-8; reading stopped at: {reason}") from error
    header, _, body = text.strip().partition("\n")
    if not header:
        raise DataError(f"`{path}`: is empty; it must have a line of column names and a line for each sample.")
    separator = _separator(header)
    cells = next(csv.reader([header.removeprefix("#").strip()], delimiter=separator, skipinitialspace=True))
    names = [cell.strip() for cell in cells]
    if _is_cut(text, header):  # Its numbers may be cut as well.
        body = body[: body.rfind("\n") + 1] + separator * (len(names) - 1)
    schema = {str(i): pl.String for i in range(len(names))}
    if not body:
        return pl.DataFrame(schema=schema).rename(_unique(names))
    try:
        frame = pl.read_csv(body.encode(), has_header=False, separator=separator, schema=schema)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).splitlines()[0]
        raise DataError(
            f"`{path}`: every line must have the {len(names)} cells that the first line names; reading stopped at: "
            f"{reason}."
        ) from error
    return frame.rename(_unique(names))


def cut_row(path: Path) -> int | None:
    """Row of the last line of a table of text, if the file ends in the middle of it.

    Args:
        path: File that `read_csv` reads.

    Returns:
        The row, counted from 0; nothing if the last line is whole.
    """
    text = _text(path)
    header, _, body = text.strip().partition("\n")
    return body.count("\n") if _is_cut(text, header) else None


def short_rows(path: Path) -> tuple[int, Mapping[int, int]]:
    """Find lines of a table of text with fewer cells than the first line names; empty ones do not count.

    Args:
        path: File that `read_csv` reads.

    Returns:
        The number of cells that the first line names, and how many each such row has, counted from 0.
    """
    header, _, body = _text(path).strip().partition("\n")
    separator = _separator(header)
    named = header.count(separator) + 1
    cells = {row: line.count(separator) + 1 for row, line in enumerate(body.split("\n")) if line.strip()}
    return named, {row: count for row, count in cells.items() if count < named}


def _text(path: Path) -> str:
    """Contents of a table of text."""
    return _contents(path).decode("utf-8-sig")


def _is_cut(text: str, header: str) -> bool:
    """Whether a table ends in the middle of a line: without its end, and with fewer cells than the first line."""
    separator = _separator(header)
    _, end, last = text.rpartition("\n")
    return bool(end and last.strip()) and last.count(separator) < header.count(separator)


def _separator(header: str) -> str:
    """What separates the cells of a table."""
    return max(",;\t", key=header.count)


def read_parquet(path: Path) -> pl.DataFrame:
    """Read a Parquet file.

    Args:
        path: File.

    Returns:
        All its columns.

    Raises:
        DataError: If the file is broken.
    """
    refuse_large(path, path.stat().st_size, "the file")
    try:
        return pl.read_parquet(path, glob=False)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"`{path}`: must be a complete Parquet file; reading stopped at: {reason}. {COPY}") from error


def numbers(path: Path, frame: pl.DataFrame, name: str, *, first_row: int) -> np.ndarray:
    """Take a column of numbers out of a table.

    Args:
        path: File, for messages.
        frame: The table, rows already selected.
        name: The column.
        first_row: Row of the file that is the table's first row, for messages.

    Returns:
        The column; NaN where a cell is empty or says that it is.

    Raises:
        DataError: If the column is absent or twice there, or a cell is no number.
    """
    if name not in frame.columns:
        raise DataError(missing(path, name, frame.columns))
    if f"{name} (again)" in frame.columns:
        raise DataError(f"`{path}`: column `{name}` must be there once; got it twice. Rename one of them.")
    column = frame[name]
    if column.dtype == pl.String:
        column = column.str.strip_chars()
        cast = column.cast(pl.Float64, strict=False)
        empty = column.str.to_lowercase().is_in(_NOTHING).fill_null(value=True)
        _refuse_text(path, name, column, cast.is_null() & ~empty, first_row)
    elif column.dtype.is_numeric() or column.dtype == pl.Boolean:
        cast = column.cast(pl.Float64)
    else:
        raise DataError(f"`{path}`: column `{name}` must hold numbers; got {column.dtype}.")
    return cast.fill_null(math.nan).to_numpy().astype(np.float64)


def _refuse_text(path: Path, name: str, column: pl.Series, bad: pl.Series, first_row: int) -> None:
    """Refuse a column that has words among its numbers."""
    row = bad.arg_max() if bad.any() else None
    if row is not None:
        where = place(path, first_row + row)
        advice = "Correct it, or select rows without it by `rows`."
        if _DECIMAL_COMMA.fullmatch(column[row]):
            advice = "Decimal commas are not read: write the file again with decimal points (1.5 instead of 1,5)."
        raise DataError(f"`{path}`: column `{name}`, {where}: must be a number or empty; got {column[row]!r}. {advice}")


def _contents(path: Path) -> bytes:
    """Bytes of a file, decompressed, up to the limit."""
    with gzip.open(path, "rb") if path.suffix.lower() == ".gz" else path.open("rb") as file:
        contents = file.read(LARGEST + 1)
    refuse_large(path, len(contents), "the file")
    return contents


def _unique(names: Iterable[str]) -> dict[str, str]:
    """From polars' numbers to the names of the columns, a repeated name being marked."""
    unique: dict[str, str] = {}
    for i, name in enumerate(names):
        free = name
        while free in unique.values():
            free += " (again)"
        unique[str(i)] = free
    return unique
