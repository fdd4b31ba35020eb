"""Reading tables: text, also compressed, and Parquet."""

import csv
import functools
import gzip
import itertools
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from ._decimals import with_points
from ._errors import COPY, DataError
from ._limits import LARGEST, refuse_large

TEXTS: Final = (".csv", ".txt", ".tsv", ".dat")
"""Endings of the names of tables of text, `.gz` apart."""
_COMMENTS: Final = ("#", "%")
_DECLARATION: Final = re.compile(r'"?sep=.?"?', re.IGNORECASE)  # Of the separator, for spreadsheets.
_QUOTED: Final = 60  # Characters of a line in a message.
_PREAMBLE: Final = 2000  # Lines in which the rows of a table begin.
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_NO_UNIT = re.compile(r"[][(){}\s*/·.^²³0-9-]+")
_UNIT = re.compile(  # What a line under the names is made of, if it is one of units.
    r"[mµu]?s|ns|min|h|secs?|seconds?|[mcku]?m|m?rad|deg(ree)?s?|°|rev|rpm|[mk]?n|m?nm|[mk]?v|m?a|k?w|k?hz|j|k?g|k?pa|bar|"
    r"c|k|counts?|ticks?|%",
    re.IGNORECASE,
)
_BEGINNING: Final = 2**20  # Bytes in which the rows of a table begin.
NOTHING: Final = ("", "na", "n/a", "null", "none")
"""What tables write where a sample is missing; NaN is a number."""
_BROKEN_GZIP = (EOFError, gzip.BadGzipFile, zlib.error)


class Layout(NamedTuple):
    """Where the rows of a table of text begin, and what its columns are called.

    Attributes:
        names: Of the columns; where no line names them, their numbers from 1 on.
        separator: What separates cells; a blank stands for any number of them.
        line: Line of the first row, counted from 1.
        start: Where that line begins in the text.
    """

    names: tuple[str, ...]
    separator: str
    line: int
    start: int

    def count(self, line: str) -> int:
        """Number of cells of a line."""
        return len(line.split()) if self.separator == " " else line.count(self.separator) + 1


def read_csv(path: Path) -> pl.DataFrame:
    """Read a table of text, separated by commas, semicolons, tabs or blanks.

    A line of names comes first. Comments before it (`#`, `%`) and a line of units after it are left out; the last
    comment names the columns where no other line does, as NumPy writes it. Where no commas separate the columns,
    decimal commas become points.

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
        frame = read(body.encode())
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        trimmed = _without_surplus(path, body, layout, separator)
        if trimmed == body:  # Something else is wrong, such as a quotation without end.
            reason = str(error).splitlines()[0]
            raise DataError(f"`{path}`: must be a table of text; reading stopped at: {reason}.") from error
        frame = read(trimmed.encode())
    if separator != "," and "," in body:
        frame = with_points(frame)
    return frame.rename(_unique(names))


def _without_surplus(path: Path, body: str, layout: Layout, separator: str) -> str:
    """The rows of a table without the empty cells at the end of lines that have more cells than there are columns."""
    named = len(layout.names)

    def trimmed(row: int, line: str) -> str:
        cells = _cells(line, separator)
        if any(cells[named:]):
            raise DataError(
                f"`{path}`: every line must have a cell for each of the {named} columns; got {len(cells)} in line "
                f"{layout.line + row} (row {row}): {line.strip()[:_QUOTED]!r}."
                + (
                    " Where commas are decimal marks, semicolons or tabs must separate cells."
                    if separator == ","
                    else ""
                )
            )
        return functools.reduce(lambda text, _: text.rstrip(" \r").removesuffix(separator), cells[named:], line)

    return "\n".join(itertools.starmap(trimmed, enumerate(body.split("\n"))))


def find_layout(text: str) -> Layout:
    """Find out where the rows of a table begin, and what its columns are called.

    Args:
        text: The table, or its beginning.

    Returns:
        Its layout.
    """
    comments, lines = [], list(itertools.islice(_lines(text), _PREAMBLE))
    if lines and _DECLARATION.fullmatch(lines[0][2]):
        lines.pop(0)
    while lines and lines[0][2].startswith(_COMMENTS):
        comments.append(lines.pop(0)[2].lstrip("".join(_COMMENTS)).strip())
    after = [line for line in lines[1:] if not line[2].startswith(_COMMENTS)]
    if not lines:  # Comments alone.
        last = comments[-1] if comments else ""
        return Layout(tuple(_cells(last, _separator(last, ""))), _separator(last, ""), text.count("\n") + 2, len(text))
    number, start, first = lines[0]
    separator = _separator(first, after[0][2] if after else "")
    cells = _cells(first, separator)
    named = _named_above(comments, len(cells))
    if _is_row(cells) or (named and (_is_units(cells) or any(map(_is_number, cells)))):
        names = named or [str(i + 1) for i in range(len(cells))]
        above = _is_units(cells)
    else:
        names, above = cells, True
    if above:  # The names, or their units.
        number, start, first = after[0] if after else (number + 1, len(text), "")
        units = _cells(first, separator)
        if len(units) == len(names) and _is_units(units) and len(after) > 1:
            number, start, _ = after[1]
    return Layout(tuple(names), separator, number, start)


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
    return f"line {_first_line(path, _version(path)) + row} (row {row})"


@functools.lru_cache(maxsize=16)
def _first_line(path: Path, version: tuple[int, int]) -> int:
    """Line of the first row of a version of a file."""
    del version
    with _opened(path) as file:
        beginning = file.read(_BEGINNING).decode("utf-8-sig", errors="ignore")
    return find_layout(beginning).line


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
    return _contents(path).decode("utf-8-sig")


def _lines(text: str, start: int = 0) -> Iterator[tuple[int, int, str]]:
    """Lines that are not empty from one's beginning on: their numbers, where they begin, and what they say."""
    number = 1
    while start < len(text):
        after = _after(text, start)
        if text[start:after].strip():
            yield number, start, text[start:after].strip(" \r\n")
        number, start = number + 1, after


def _after(text: str, start: int) -> int:
    """Where the line after the one at a place begins."""
    end = text.find("\n", start)
    return len(text) if end < 0 else end + 1


def _cells(line: str, separator: str) -> list[str]:
    """Cells of a line."""
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error:  # A cell without end, or a stray carriage return: reading the rows will say so.
        return line.split(separator)


def _with_tabs(line: str, columns: int) -> str:
    """A line whose cells blanks separate; where one is missing nobody knows which, and all of them are."""
    cells = line.split()
    return "\t".join(cells if len(cells) >= columns else [""] * columns)


def _is_number(cell: str) -> bool:
    """Whether a cell is a number."""
    return _NUMBER.fullmatch(cell) is not None


def _is_row(cells: Sequence[str]) -> bool:
    """Whether a line is one of numbers; those that only count the columns, as of a table without names, are names."""
    said = [cell for cell in cells if cell.lower() not in (*NOTHING, "nan", "inf", "-inf")]
    counted = [str(i) for i in range(len(said) + 1)]
    return bool(said) and all(map(_is_number, said)) and said not in (counted[:-1], counted[1:])


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a line has a unit for every column, or nothing or a dash."""
    words = [word for cell in cells for word in _NO_UNIT.split(cell) if word]
    return bool(words) and all(map(_UNIT.fullmatch, words))


def _named_above(comments: Sequence[str], columns: int) -> list[str]:
    """Names that the last comment with as many words as there are columns gives them; none if there is no such."""
    for comment in reversed(comments):
        cells = _cells(comment, _separator(comment, comment))
        if len(cells) == columns and not _is_units(cells) and not _is_row(cells):
            return cells
    return []


def _is_cut(text: str, layout: Layout) -> bool:
    """Whether a table ends in the middle of a line: without its end, and with fewer cells than there are columns."""
    _, end, last = text.rpartition("\n")
    return bool(end and last.strip()) and layout.count(last) < len(layout.names)


def _separator(line: str, after: str) -> str:
    """What separates the cells of a table; blanks alone where lines agree on their number."""
    for found in ";\t":  # Beside decimal commas there may be less of them.
        if any(found in text and _is_row(_cells(text, found)) for text in (line, after)):
            return found
        if 0 < line.count(found) == after.count(found):
            return found
    found, words = max(",;\t", key=line.count), line.split()
    agree = len(words) > 1 and (len(words) == len(after.split()) or _is_row(words))
    return " " if agree and not line.count(found) else found


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
