"""Results on standard output: tables for people, one JSON object for programs."""

import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

from symoden.storage import write_atomically
from symoden.wording import number

_WIDE = 200
_BETWEEN = 3  # Characters between columns, at most.


class TableText(NamedTuple):
    """A table.

    Attributes:
        title: Line above it.
        columns: Heads of the columns.
        rows: Cells.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]


def console(*, stderr: bool = False) -> Console:
    """Console that wraps nothing where no terminal has a width, and takes no text for markup.

    Args:
        stderr: Whether to write to standard error.

    Returns:
        The console.
    """
    made = Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not made.is_terminal:
        made.width = _WIDE
    return made


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table, the first column to the left and numbers to the right.

    What is too wide goes on in more tables, each with the first column.

    Args:
        title: Line above it.
        columns: Heads of the columns.
        rows: Cells, in the order of the columns.
    """
    out = console()
    lines = [list(columns), *([number(x) if isinstance(x, float) else str(x) for x in row] for row in rows)]
    widths = [max(map(cell_len, column)) + _BETWEEN for column in zip(*lines, strict=True)]
    print(f"\n{title}", flush=True)
    for some in _that_fit(widths, out.width):
        table = Table(box=box.SIMPLE_HEAD if out.is_terminal else None, pad_edge=False)
        for i in some:
            table.add_column(columns[i], justify="left" if i == 0 else "right", no_wrap=True)
        for line in lines[1:]:
            table.add_row(*(line[i] for i in some))
        out.print(table)


def _that_fit(widths: Sequence[int], most: int) -> list[list[int]]:
    """Columns of as few tables as are needed, the first column in each."""
    tables, total = [[0]], widths[0]
    for i, width in enumerate(widths[1:], start=1):
        if total + width > most and len(tables[-1]) > 1:
            tables.append([0])
            total = widths[0]
        tables[-1].append(i)
        total += width
    return tables


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object on one line.

    Args:
        value: The object; what is not finite becomes null.
    """
    print(json.dumps(_plain(value), allow_nan=False), flush=True)


def _plain(value: Any) -> Any:  # noqa: ANN401 - JSON
    """What JSON can express."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def check_npz(path: Path) -> None:
    """Refuse a file of results that could be one of something else, before anything takes time.

    Args:
        path: The file.

    Raises:
        ValueError: If its name ends otherwise.
    """
    if path.suffix.lower() != ".npz":
        raise ValueError(f"`--out` must end in .npz; got `{path}`.")


def save_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an NPZ file whole or not at all.

    Args:
        path: The file.
        arrays: Arrays by name.
    """
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())
