"""Results as a Markdown page, with its figures beside it."""

import statistics
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from symoden.experiments import PAPER_ORDER, TASKS, BlockErrors, CellResult, Row, SweepCurve, is_own, sweeps
from symoden.storage import write_atomically

from ._captions import KINDS, READ_BLOCKS, READ_DOTS, READ_ERRORS, READ_SWEEPS
from ._table import _line, _plain, table_markdown

_IMAGES: Final = Path("images/results")


def write_page(
    page: Path,
    results: Sequence[CellResult],
    rows: Sequence[Row],
    figures: Mapping[str, Path],
    facts: Mapping[str, str],
) -> None:
    """Write a page of results, and copy its figures beside it.

    Args:
        page: The Markdown file; the figures go into `images/results/` beside it.
        results: Results of all cells.
        rows: Rows of their table.
        figures: PNG files by the names that `draw_results` gives; others are left out.
        facts: What else there is to say on how the results came about, by name.

    Raises:
        StorageError: If a file cannot be written.
    """
    shown = {name: path for name, path in figures.items() if path.suffix == ".png"}
    for name, path in shown.items():
        write_atomically(page.parent / _IMAGES / f"{name}.png", path.read_bytes())
    own = [row for row in rows if is_own(row)]
    parts = ["# Results", _made(results, facts), "## Errors", READ_ERRORS, table_markdown(own)]
    if "errors" in shown:
        parts += [READ_DOTS, _image("errors", "Errors of all models")]
    if blocks := _block_table(results):
        parts += ["## Errors of M⁻¹, V, g and D", READ_BLOCKS, blocks]
    for kind, (heading, reading) in KINDS.items():
        names = [name for name in shown if name.startswith(f"{kind}-")]
        table = _sweep_tables(rows) if kind == "sweep" else ""
        if names or table:
            parts += [f"## {heading}", *([READ_SWEEPS, table] if table else []), *([reading] if names else [])]
            for name in names:
                which = name.removeprefix(f"{kind}-")
                parts += [f"**{which}**", _image(name, f"{heading}, {which}")]
    write_atomically(page, ("\n\n".join(part.strip("\n") for part in parts) + "\n").encode())


def _made(results: Sequence[CellResult], facts: Mapping[str, str]) -> str:
    """What was run, and on what."""
    failed = [result.cell.name for result in results if result.error is not None]
    made = {"trained models": str(len(results) - len(failed))}
    if failed:
        made["failed"] = ", ".join(f"`{name}`" for name in failed)
    return "\n".join(f"- {name}: {value}" for name, value in (made | dict(facts)).items())


def _image(name: str, words: str) -> str:
    """A figure, linked relative to the page."""
    return f"![{words}]({(_IMAGES / name).as_posix()}.png)"


def _block_table(results: Sequence[CellResult]) -> str:
    """Errors of blocks over seeds; empty without any."""

    def same(result: CellResult) -> tuple[int, str, str, int]:
        cell = result.cell
        return list(TASKS).index(cell.task), cell.space or "", cell.preset, PAPER_ORDER.index(cell.model)

    columns: dict[str, Callable[[BlockErrors], float]] = {
        "M⁻¹": lambda blocks: blocks.inverse_mass,
        "V": lambda blocks: blocks.potential,
        "g": lambda blocks: blocks.actuation,
        "D": lambda blocks: blocks.dissipation,
        "D, median": lambda blocks: blocks.dissipation_median,
    }
    lines = [
        _line(["task", "space", "model", "preset", "seeds", *columns]),
        _line(["---"] * 4 + ["---:"] * (1 + len(columns))),
    ]
    head = len(lines)
    own = [r for r in results if r.blocks is not None and r.cell.trajectories is None and not r.cell.noise]
    for _, group in groupby(sorted(own, key=same), key=same):
        seeds = list(group)
        found, cell = [result.blocks for result in seeds if result.blocks is not None], seeds[0].cell
        numbers = [_over_seeds([of(blocks) for blocks in found]) for of in columns.values()]
        space = cell.space or TASKS[cell.task].space
        lines.append(_line([cell.task, space, cell.model, cell.preset, str(len(found)), *numbers]))
    return "\n".join(lines) if len(lines) > head else ""


def _over_seeds(errors: Sequence[float]) -> str:
    """The median, and of several the worst."""
    worst = f" ({_plain(max(errors))})" if len(errors) > 1 else ""
    return f"{_plain(statistics.median_low(errors))}{worst}"


def _sweep_tables(rows: Sequence[Row]) -> str:
    """Prediction errors of every sweep, a model in each line; empty without any."""
    parts = []
    for sweep in sweeps(rows):
        values = sorted({float(value) for curve in sweep.curves.values() for value in curve.values})
        lines = [
            f"**{sweep.name}, preset {sweep.preset}: {sweep.quantity}**\n",
            _line(["model", *(f"{value:g}" for value in values)]),
            _line(["---"] + ["---:"] * len(values)),
        ]
        lines += [_line([kind, *_swept(curve, values)]) for kind, curve in sweep.curves.items()]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _swept(curve: SweepCurve, values: Sequence[float]) -> list[str]:
    """Errors of one kind of model at values, some of which it may lack."""
    cells = dict.fromkeys(values, "-")
    for value, *errors in zip(curve.values, curve.median, curve.least, curve.greatest, strict=True):
        median, least, greatest = (_plain(float(error)) for error in errors)
        cells[float(value)] = median if least == greatest else f"{median} ({least} to {greatest})"
    return list(cells.values())
