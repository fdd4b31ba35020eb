"""Where the rows of a table of text begin, and what its columns are called."""

import csv
import itertools
import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

NOTHING: Final = ("", "na", "n/a", "#n/a", "null", "none")
"""What tables write where a sample is missing; NaN is a number."""
MARKS: Final = r"^[-*?.#_]+$"
"""The same, where a cell has nothing but such marks: `---`, `***`, `?`."""
_NO_NUMBERS: Final = (*NOTHING, "nan", "inf", "-inf")
_COMMENTS: Final = ("#", "%")
_DECLARATION: Final = re.compile(r'"?sep=.?"?', re.IGNORECASE)  # Of the separator, for spreadsheets.
_PREAMBLE: Final = 2000  # Lines in which the rows of a table begin.
_NUMBER = re.compile(r"[+−-]?(\d+[.,]?\d*|[.,]\d+)([eE][+−-]?\d+)?")
_NO_UNIT = re.compile(r"[][(){}\s*/·.^²³0-9-]+")
_PROSE: Final = 200  # Lines before the names.
_ALIKE: Final = 3  # Rows one after another that tell where a table begins.
_STAMP: Final = re.compile(r"[0-9]{1,2}:[0-9]{2}:[0-9]{2}|[0-9]{4}-[0-9]{2}-[0-9]{2}")
_UNIT = re.compile(  # What a line under the names is made of, if it is one of units.
    r"[mµu]?s|ns|min|h|secs?|seconds?|[mcku]?m|m?rad|deg(ree)?s?|°|rev|rpm|[mk]?n|m?nm|[mk]?v|m?a|k?w|k?hz|j|k?g|k?pa|bar|"
    r"c|k|counts?|ticks?|%",
    re.IGNORECASE,
)


class Layout(NamedTuple):
    """Where the rows of a table of text begin, and what its columns are called.

    Attributes:
        names: Of the columns; where no line names them, their numbers from 1 on.
        separator: What separates cells; a blank stands for any number of them.
        line: Line of the first row, counted from 1.
        start: Where that line begins in the text.
        units: What a line under the names says of each column, as it is written; none where there is no such line.
    """

    names: tuple[str, ...]
    separator: str
    line: int
    start: int
    units: tuple[str, ...] = ()

    def count(self, line: str) -> int:
        """Number of cells of a line."""
        return len(line.split()) if self.separator == " " else line.count(self.separator) + 1


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
    lines = _without_prose([line for line in lines if not line[2].startswith(_COMMENTS)])
    after = lines[1:]
    if not lines:  # Comments alone.
        last = comments[-1] if comments else ""
        return Layout(
            tuple(cells_of(last, _separator(last, ""))), _separator(last, ""), text.count("\n") + 2, len(text)
        )
    number, start, first = lines[0]
    separator = _separator(first, after[0][2] if after else "")
    cells = cells_of(first, separator)
    if separator == " " and after and not _is_row(cells):
        cells = _named(first, separator, len(after[0][2].split()))
    named = _named_above(comments, len(cells))
    if _is_row(cells) or (named and (_is_units(cells) or any(map(_is_number, cells)))):
        names = named or [str(i + 1) for i in range(len(cells))]
        above = _is_units(cells)
    else:
        names, above = cells, True
    said: tuple[str, ...] = ()
    if above:  # The names, or their units.
        number, start, first = after[0] if after else (number + 1, len(text), "")
        units = cells_of(first, separator)
        if len(units) == len(names) and _is_units(units) and len(after) > 1:
            number, start, _ = after[1]
            said = tuple(units)
    return Layout(tuple(names), separator, number, start, said)


def _without_prose(lines: list[tuple[int, int, str]]) -> list[tuple[int, int, str]]:
    """Lines from the names of the columns on: a program may have said something before.

    Rows are looked for first; names are the lowest line above them that has as many words. Where the first line is
    such, or what stands above the rows may be names that do not fit them, nothing is left out: messages will say so.

    Returns:
        The lines.
    """
    for k in range(2, min(len(lines) - _ALIKE, _PROSE) + 1):
        separator = _separator(lines[k][2], lines[k + 1][2])
        rows = [_filled(cells_of(text, separator)) for _, _, text in lines[k : k + _ALIKE]]
        columns = len(rows[0])
        if columns < 2 or not all(len(cells) == columns and all(map(_is_value, cells)) for cells in rows):
            continue
        above = [_filled(_named(text, separator, columns)) for _, _, text in lines[:k]]
        named = [len(cells) >= columns and not any(cell and _is_value(cell) for cell in cells) for cells in above]
        if named[0] or (not any(named) and len(above[-1]) > 1):
            return lines
        if not any(named):
            return lines[k:]
        first = k - 1 - named[::-1].index(True)
        while separator != " " and named[first - 1]:  # Units that nobody knows; of blanks any sentence has many.
            first -= 1
        return lines[first:]
    return lines


def _filled(cells: Sequence[str]) -> list[str]:
    """Cells up to the last one that is not empty."""
    return list(cells[: max((i for i, cell in enumerate(cells, start=1) if cell), default=0)])


def _is_value(cell: str) -> bool:
    """Whether a cell is a number, a date, a time of day, or says that nothing is there."""
    return _is_no_number(cell) or _is_number(cell) or _STAMP.match(cell) is not None


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


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of a line.

    Args:
        line: The line.
        separator: What separates them; a blank stands for any number.

    Returns:
        The cells.
    """
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error:  # A cell without end, or a stray carriage return: reading the rows will say so.
        return line.split(separator)


def _apart(line: str) -> list[str]:
    """Cells of several words each, with two blanks or more between them."""
    return re.split(r"\s{2,}", line.strip())


def _named(line: str, separator: str, columns: int) -> list[str]:
    """Cells of a line that may name columns: of several words each, if they are as many as the columns only then."""
    cells = cells_of(line, separator)
    return cells if separator != " " or len(cells) == columns or len(_apart(line)) != columns else _apart(line)


def _is_no_number(cell: str) -> bool:
    """Whether a cell says that nothing is there, or no finite number."""
    return cell.lower() in _NO_NUMBERS or re.match(MARKS, cell) is not None


def _is_number(cell: str) -> bool:
    """Whether a cell is a number."""
    return _NUMBER.fullmatch(cell) is not None


def _numbers_of(cells: Sequence[str]) -> list[str]:
    """Numbers of a line that has no words; none of another one."""
    said = [cell for cell in cells if not _is_no_number(cell)]
    return said if all(map(_is_number, said)) else []


def _is_row(cells: Sequence[str]) -> bool:
    """Whether a line is one of numbers; those that only count the columns, as of a table without names, are names."""
    said = _numbers_of(cells)
    counted = [str(i) for i in range(len(said) + 1)]
    return bool(said) and said not in (counted[:-1], counted[1:])


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a line has a unit for every column, or nothing or a dash."""
    words = [word for cell in cells for word in _NO_UNIT.split(cell) if word]
    return bool(words) and all(map(_UNIT.fullmatch, words))


def _named_above(comments: Sequence[str], columns: int) -> list[str]:
    """Names that the last comment with as many words as there are columns gives them; none if there is no such."""
    for comment in reversed(comments):
        cells = _named(comment, _separator(comment, comment), columns)
        if len(cells) == columns and not _is_units(cells) and not _is_row(cells):
            return cells
    return []


def _separator(line: str, after: str) -> str:
    """What separates the cells of a table; blanks alone where lines agree on their number."""
    for found in ";\t|":  # Beside decimal commas there may be less of them.
        if any(found in text and _is_row(cells_of(text, found)) for text in (line, after)):
            return found
        if 0 < line.count(found) == after.count(found):
            return found
    found, words = max(",;\t", key=line.count), line.split()
    agree = len(words) > 1 and (len(after.split()) in {len(words), len(_apart(line))} or _is_row(words))
    return " " if agree and not line.count(found) else found
