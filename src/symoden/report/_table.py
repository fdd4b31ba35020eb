"""The table of results as JSON, CSV, Markdown and LaTeX; it needs no matplotlib."""

import csv
import io
import json
import math
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from symoden.experiments import TASKS, CellResult, Row, SeedErrors, result_as_json, table_rows
from symoden.storage import write_atomically

_ERRORS: Final = ("train", "test", "prediction")
_SHOWN: Final = ("model", "parameters", *(part for name in _ERRORS for part in (name, "the paper", "ratio")), "seconds")
_ESCAPES: Final = {"\\": r"\textbackslash{}"} | {letter: f"\\{letter}" for letter in "#$%&_{}"}
_ESCAPES.update({"~": r"\textasciitilde{}", "^": r"\textasciicircum{}"})
_PAPER_TASKS: Final = tuple(name for name, task in TASKS.items() if task.paper)


def write_tables(folder: Path, results: Sequence[CellResult]) -> None:
    """Write `table.json`, `table.csv`, `table.md` and `table.tex`, each whole or not at all.

    Args:
        folder: Folder of all results.
        results: What they hold.

    Raises:
        StorageError: If a file cannot be written.
    """
    rows = table_rows(results)
    listed = [result_as_json(result) for result in results]
    texts = {
        "json": json.dumps(listed, indent=2, allow_nan=False) + "\n",
        "csv": table_csv(rows),
        "md": table_markdown(rows),
        "tex": table_latex(rows),
    }
    for suffix, text in texts.items():
        write_atomically(folder / f"table.{suffix}", text.encode())


def flat_row(row: Row) -> dict[str, str | int | float | None]:
    """A row as columns.

    Args:
        row: The row.

    Returns:
        Values by the names of their columns; what is absent is None.
    """
    names = ("task", "space", "model", "preset", "trajectories", "noise", "parameters", "seeds", "failed")
    columns: dict[str, str | int | float | None] = {name: getattr(row, name) for name in names}
    for name in _ERRORS:
        columns |= _flat_errors(name, getattr(row, name))
    return columns | {"seconds": row.seconds}


def table_csv(rows: Sequence[Row]) -> str:
    """The table as CSV, a flat row for each row, in full precision.

    Args:
        rows: Rows.

    Returns:
        The text; empty cells for what is absent, `inf` where rollouts diverged.
    """
    text = io.StringIO()
    columns = [flat_row(row) for row in rows]
    writer = csv.DictWriter(text, fieldnames=list(columns[0]) if columns else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(columns)
    return text.getvalue()


def table_markdown(rows: Sequence[Row]) -> str:
    """The table as Markdown, one for each task.

    Args:
        rows: Rows.

    Returns:
        The text; empty without rows.
    """
    parts = []
    for title, group in _groups(rows):
        lines = [f"**{title}**", "", _line(_SHOWN), _line(["---"] + ["---:"] * (len(_SHOWN) - 1))]
        lines += [_line(_cells(row, _plain)) for row in group]
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def table_latex(rows: Sequence[Row]) -> str:
    """The table as one LaTeX `tabular`.

    Args:
        rows: Rows.

    Returns:
        The text; it needs no package.
    """
    head = " & ".join(_escaped(name) for name in _SHOWN)
    lines = [rf"\begin{{tabular}}{{l{'r' * (len(_SHOWN) - 1)}}}", r"\hline", rf"{head} \\"]
    for title, group in _groups(rows):
        lines += [r"\hline", rf"\multicolumn{{{len(_SHOWN)}}}{{l}}{{{_escaped(title)}}} \\", r"\hline"]
        lines += [rf"{' & '.join(_cells(row, _mathematics))} \\" for row in group]
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


def table_title(row: Row) -> str:
    """What a row shares with its group, in words.

    Args:
        row: The row.

    Returns:
        Its task, preset and what is unusual about its data.
    """
    number = f"Task {_PAPER_TASKS.index(row.task) + 1}: " if row.task in _PAPER_TASKS else ""
    told = "" if row.space is None else f", told the space {row.space}"
    count = "" if row.trajectories is None else f", {row.trajectories} training trajectories"
    noise = f", noise {row.noise:g}" if row.noise else ""
    return f"{number}{row.task}{told}, preset {row.preset}{count}{noise}"


def _groups(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Rows under their titles."""
    return [(title, list(group)) for title, group in groupby(rows, key=table_title)]


def _flat_errors(name: str, errors: SeedErrors | None) -> dict[str, str | int | float | None]:
    """Columns of one error."""
    columns = ("median", "least", "greatest", "mean", "std", "paper_mean", "paper_std", "ratio")
    if errors is None:
        return {f"{name}_{column}": None for column in columns}
    paper = errors.paper or (None, None)
    values = (errors.median, errors.least, errors.greatest, *errors.spread, *paper, errors.ratio)
    return {f"{name}_{column}": value for column, value in zip(columns, values, strict=True)}


def _cells(row: Row, text: Callable[[float], str]) -> list[str]:
    """Cells of a row, numbers being written by a function."""
    failed = f" ({row.failed} failed)" if row.failed else ""
    cells = [f"{row.model}{failed}", "-" if row.parameters is None else str(row.parameters)]
    for name in _ERRORS:
        errors: SeedErrors | None = getattr(row, name)
        cells += ["-"] * 3 if errors is None else _error_cells(errors, row.seeds, text)
    return [*cells, "-" if row.seconds is None else f"{row.seconds:.0f}"]


def _error_cells(errors: SeedErrors, seeds: int, text: Callable[[float], str]) -> list[str]:
    """Our error, the paper's and their ratio; over several seeds ours is the median's, with the range."""

    def spread(mean: float, std: float) -> str:
        plus_minus = "±" if text is _plain else r"$\pm$"
        return f"{text(mean)} {plus_minus} {text(std)}" if math.isfinite(mean) else text(mean)

    between = f" ({text(errors.least)} to {text(errors.greatest)})" if seeds > 1 else ""
    ours = spread(*errors.spread) + between
    paper = "-" if errors.paper is None else spread(*errors.paper)
    return [ours, paper, "-" if errors.ratio is None else text(errors.ratio)]


def _line(cells: Sequence[str]) -> str:
    """A line of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def _digits(value: float) -> tuple[str, int]:
    """A number in three digits, very large and small ones in two, and the power of ten to multiply it by."""
    if value == 0 or 1e-2 <= abs(value) < 999.5:
        return f"{value:.3g}", 0
    digits, _, power = f"{value:.1e}".partition("e")
    return digits, int(power)


def _plain(value: float) -> str:
    """A number as plain text."""
    if not math.isfinite(value):
        return "diverged"
    digits, power = _digits(value)
    return f"{digits}e{power}" if power else digits


def _mathematics(value: float) -> str:
    """A number as LaTeX."""
    if not math.isfinite(value):
        return "diverged"
    digits, power = _digits(value)
    return rf"${digits}\cdot 10^{{{power}}}$" if power else digits


def _escaped(text: str) -> str:
    """Text whose letters mean nothing to LaTeX."""
    return "".join(_ESCAPES.get(letter, letter) for letter in text)
