"""Reading tables: text, also compressed, and Parquet."""

import functools
import gzip
import itertools
import re
import zlib
from collections.abc import Iterable, Mapping
from io import BufferedReader
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from symoden.data._errors import COPY, DataError

from ._decimals import with_hyphens, with_points
from ._layout import Layout, cells_of, find_layout
from ._limits import LARGEST, refuse_large

TEXTS: Final = (".csv", ".txt", ".tsv", ".dat")
"""Endings of the names of tables of text, `.gz` apart."""
_QUOTED: Final = 60  # Characters of a line in a message.
_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
_MATRIX: Final = re.compile(
    r"^[ \t]*(\w+[ \t]*=[ \t]*)?\[(?=\s*[-+]?(?:[0-9.]|nan\b|inf\b)[^\n;\]]*;?[ \t]*\r?$)", re.MULTILINE | re.IGNORECASE
)
_ROW_ENDS: Final = re.compile(r";?[ \t]*\][ \t]*;?(?=\s*\Z)|;[ \t]*(?=\r?$)", re.MULTILINE)
_BEGINNING: Final = 20_000  # Characters in which a matrix begins.
_FEW_CUT: Final = 0.05  # Share of a column's cells after which lines end too early.
_SHORT: Final = 10  # Rows; of more a single one may be cut.
_BY_CHANCE: Final = 3  # Cut lines that may all end in the same column.
_FIRST: Final = 3  # Lines that tell whether columns lack names.
_BROKEN_GZIP = (EOFError, gzip.BadGzipFile, zlib.error)


def read_csv(path: Path) -> pl.DataFrame:
    """Read a table of text, separated by commas, semicolons, tabs, bars or blanks.

    A line of names comes first. Comments before it (`#`, `%`), whatever a program said before the table, and a line of
    units after the names are left out; the last comment names the columns where no other line does, as NumPy writes it.
    Where no commas separate the columns, decimal commas become points; the sign of minus becomes a hyphen.

    Args:
        path: File; its name ends in `.gz` if it is compressed.

    Returns:
        The columns as they are written, still text.

    Raises:
        DataError: If the file is empty, broken or no table.
    """
    try:
        text = _text(path)
    except (*_BROKEN_GZIP, UnicodeError) as error:
        cut = not isinstance(error, UnicodeDecodeError) or error.end == len(error.object)
        reason = f"{error}. {COPY if cut else 'Save it as one.'}"
        raise DataError(f"`{path}`: must be a complete CSV file in UTF-8; reading stopped at: {reason}") from error
    if not text.strip():
        raise DataError(f"`{path}`: is empty; it must have a line of column names and a line for each sample.")
    layout = find_layout(text)
    names, separator, body = layout.names, layout.separator, text[layout.start :].rstrip()
    if separator == " ":
        separator, body = "\t", "\n".join(_with_tabs(line, len(names)) for line in body.split("\n"))
    if body and _is_cut(text, layout):  # Its numbers may be cut as well.
        body = body[: body.rfind("\n") + 1] + separator * (len(names) - 1)
    schema = {str(i): pl.String for i in range(len(names))}
    if not body:
        return pl.DataFrame(schema=schema).rename(_unique(names))
    read = functools.partial(pl.read_csv, has_header=False, separator=separator, schema=schema)
    try:
        frame = read(_counted(body, separator, len(names)).encode())
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        trimmed = _without_surplus(path, body, layout, separator)
        if trimmed == body:  # Something else is wrong, such as a quotation without end.
            reason = str(error).splitlines()[0]
            raise DataError(f"`{path}`: must be a table of text; reading stopped at: {reason}.") from error
        frame = read(_counted(trimmed, separator, len(names)).encode())
    frame = _without_cut_cells(frame, body, layout)
    if "−" in body:
        frame = with_hyphens(frame)
    if separator != "," and "," in body:
        frame = with_points(frame)
    return frame.rename(_unique(names))


def _counted(body: str, separator: str, columns: int) -> str:
    """A table whose first line, by which columns are counted, has a cell for each: it may be cut."""
    first = body.partition("\n")[0].rstrip("\r")
    return first + separator * (columns - 1 - first.count(separator)) + body[len(first) :]


def _without_surplus(path: Path, body: str, layout: Layout, separator: str) -> str:
    """The rows of a table without the empty cells at the end of lines that have more cells than there are columns."""
    named = len(layout.names)

    def trimmed(row: int, line: str) -> str:
        cells = cells_of(line, separator)
        if any(cells[named:]):
            raise DataError(
                f"`{path}`: every line must have a cell for each of the {named} columns; got {len(cells)} in line "
                f"{layout.line + row} (row {row}): {line.strip()[:_QUOTED]!r}.{_why_surplus(body, layout, len(cells))}"
            )
        return functools.reduce(lambda text, _: text.rstrip(" \r").removesuffix(separator), cells[named:], line)

    return "\n".join(itertools.starmap(trimmed, enumerate(body.split("\n"))))


def _why_surplus(body: str, layout: Layout, count: int) -> str:
    """Why a line may have so many cells, and what to do: if names are missing, each of the first lines has as many."""
    first = [line for line in itertools.islice(body.split("\n"), _FIRST) if line.strip()]
    comma = layout.separator == ","
    tells_numbers = not comma or any("." in line for line in first)  # Else commas may be decimal marks.
    if tells_numbers and all(layout.count(line) == count for line in first):
        return (
            f" Names seem to be missing: write one for each of the {count} columns into the line of names, or delete "
            f"that line; then columns are called 1 to {count}."
        )
    return " Where commas are decimal marks, semicolons or tabs must separate cells." if comma else ""


def _without_cut_cells(frame: pl.DataFrame, body: str, layout: Layout) -> pl.DataFrame:
    """A table without the last cell of each line that has too few: as the line was cut, so that cell may be.

    A time stamp that lost digits would be out of order, a position a leap. But what leaves out empty cells at the ends
    of lines cuts nothing: there several lines end, all in the same column, or many do.

    Returns:
        The table.
    """
    lacking = frame.to_series(-1).is_null()
    if layout.separator == " " or not lacking.any():
        return frame
    lines, ends = body.split("\n"), dict[int, list[int]]()
    for row in lacking.arg_true() if len(lines) == len(frame) else ():  # No cell goes over several.
        count = layout.count(lines[row])
        if lines[row].strip() and count < len(layout.names):
            ends.setdefault(count - 1, []).append(row)
    if len(ends) == 1 and len(*ends.values()) > _BY_CHANCE:
        return frame
    for column, rows in ends.items():
        cells = frame.to_series(column)
        if len(rows) <= max(len(frame) > _SHORT, _FEW_CUT * (len(frame) - cells.null_count())):
            frame = frame.with_columns(cells.scatter(rows, None))
    return frame


def place(path: Path, row: int) -> str:
    """Where a row of a file is: in text files also the line, counted from 1, all lines counted.

    Args:
        path: The file.
        row: The row, counted from 0.

    Returns:
        The words.
    """
    if not is_text(path):
        return f"row {row}"
    return f"line {_layout(path, _version(path)).line + row} (row {row})"


def units_below_names(path: Path) -> dict[str, str]:
    """Units that a line under the names of a table says.

    Args:
        path: The file; only tables of text have such lines.

    Returns:
        What it says of each column, as it is written; nothing where there is no such line.
    """
    if not is_text(path):
        return {}
    layout = _layout(path, _version(path))
    return dict(zip(layout.names, layout.units, strict=True)) if layout.units else {}


@functools.lru_cache(maxsize=16)
def _layout(path: Path, version: tuple[int, int]) -> Layout:
    """Where the rows of a version of a file begin, and what its columns are called."""
    del version
    return find_layout(_text(path))


def _version(path: Path) -> tuple[int, int]:
    """What differs once a file was written anew."""
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def is_text(path: Path) -> bool:
    """Whether a file's name says that it is a table of text."""
    return path.name.lower().removesuffix(".gz").endswith(TEXTS)


class Lines(NamedTuple):
    """Which lines of a table of text are no whole rows; these are counted from 0.

    Attributes:
        named: Number of columns.
        short: How many cells each row has that has fewer; empty ones do not count.
        cut: The last row, if the file ends in the middle of it.
    """

    named: int
    short: Mapping[int, int]
    cut: int | None


def find_short_lines(path: Path) -> Lines:
    """Find lines of a table of text with fewer cells than there are columns.

    Args:
        path: File that `read_csv` reads.

    Returns:
        These lines.
    """
    return _short_lines(path, _version(path))


@functools.lru_cache(maxsize=2)
def _short_lines(path: Path, version: tuple[int, int]) -> Lines:
    """Those of a version of a file: asked for by each of its recordings."""
    del version
    text = _text(path)
    layout = find_layout(text)
    named, body = len(layout.names), text[layout.start :].rstrip()
    cells = {row: layout.count(line) for row, line in enumerate(body.split("\n")) if line.strip()}
    short = {row: count for row, count in cells.items() if count < named}
    return Lines(named, short, body.count("\n") if _is_cut(text, layout) else None)


def _text(path: Path) -> str:
    """Contents of a table of text."""
    return _without_brackets(_decoded(_contents(path)))


def _without_brackets(text: str) -> str:
    """A matrix as MATLAB writes it, `[1 2; …]` with a row in each line, as lines of numbers."""
    if (begin := _MATRIX.search(text, 0, _BEGINNING)) is None:
        return text
    return text[: begin.start()] + _ROW_ENDS.sub("", text[begin.end() :])


def _decoded(contents: bytes) -> str:
    """Text of UTF-8, of UTF-16 that says so, as spreadsheets save "Unicode text", or of Windows' Western code page."""
    if contents.startswith(_UTF_16):
        return contents.decode("utf-16")
    try:
        return contents.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # No text, a file that ends within a character, or UTF-8 but for one place: that one is to be named.
        if b"\0" in contents or error.end == len(contents) or not contents[: error.start].isascii():
            raise
        try:
            return contents.decode("cp1252")
        except UnicodeDecodeError:
            raise error from None


def _with_tabs(line: str, columns: int) -> str:
    """A line whose cells blanks separate; where one is missing nobody knows which, and all of them are."""
    cells = line.split()
    return "\t".join(cells if len(cells) >= columns else [""] * columns)


def _is_cut(text: str, layout: Layout) -> bool:
    """Whether a table ends in the middle of a line: without its end, and with fewer cells than there are columns."""
    _, end, last = text.rpartition("\n")
    return bool(end and last.strip()) and layout.count(last) < len(layout.names)


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


def _opened(path: Path) -> gzip.GzipFile | BufferedReader:
    """A file's bytes, decompressed."""
    return gzip.open(path, "rb") if path.suffix.lower() == ".gz" else path.open("rb")


def _contents(path: Path) -> bytes:
    """Bytes of a file, decompressed, up to the limit."""
    with _opened(path) as file:
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
