"""`symoden reproduce`."""

import datetime
import importlib.util
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path

from symoden.experiments import Cell, CellResult, Row, cells, check_cell, holds_run, read_results, table_rows
from symoden.report import flat_row, table_title, write_tables
from symoden.storage import exclusive
from symoden.training import TrainingError
from symoden.wording import number

from ._arguments import Reproduce
from ._figure import save_figure
from ._jobs import run_cells
from ._live import show_cells
from ._output import print_json, print_table

_DPI = 110
_SHORT = 10
_MARKDOWN = (".md", ".markdown")


def run(command: Reproduce) -> None:
    """Run the cells that are not finished, and write tables and figures of all that there are.

    Args:
        command: What to do.

    Raises:
        ValueError: If a setting is out of range.
        TrainingError: If a cell failed.
    """
    out = command.out
    if out.exists() and not out.is_dir():
        raise ValueError(f"`--out` must be a folder; `{out}` is a file.")
    if holds_run(out):
        raise ValueError(f"`--out` must be a folder of cells, or a new one; `{out}` holds a run. Name another folder.")
    if command.page is not None and command.page.is_dir():
        raise ValueError(f"`--page` must be a file; `{command.page}` is a folder. Name a Markdown file in it.")
    if command.page is not None and command.page.suffix.lower() not in _MARKDOWN:
        raise ValueError(f"`--page` must end in {' or '.join(_MARKDOWN)}; got `{command.page}`.")
    if command.jobs < 1:
        raise ValueError(f"`--jobs` must be at least 1; got {command.jobs}.")
    every = cells(
        command.tasks,
        command.models,
        command.preset,
        command.seeds,
        trajectories=command.trajectories,
        noise=command.noise,
    )
    with exclusive(out):
        _run(command, every)


def _run(command: Reproduce, every: Sequence[Cell]) -> None:
    """Run these cells, in a folder where no other command writes."""
    out = command.out
    found = {result.cell.name: result for result in read_results(out)}
    for result in found.values():
        check_cell(out, result.cell)  # One table must not mix settings.
    known = [result for result in (check_cell(out, cell) for cell in every) if result is not None]
    finished = {result.cell for result in known}

    def keep(result: CellResult) -> None:
        found[result.cell.name] = result
        write_tables(out, _listed(found))

    with show_cells(every, known) as watch:
        todo = [cell for cell in every if cell not in finished]
        run_cells(out, todo, jobs=command.jobs, watch=watch, keep=keep)
    results = _listed(found)
    write_tables(out, results)
    figures = _draw(out, results) if command.figures else {}
    if command.page is not None:
        _write_page(command, command.page, results, figures)
    failed = [cell for cell in every if found[cell.name].error is not None]
    _report(command, results, [cell.name for cell in failed])
    if failed:
        names = ", ".join(cell.name for cell in failed)
        again = "give the same command again"
        if any(check_cell(out, cell) is not None for cell in failed):
            again = f"remove its folder in `{out / 'cells'}` and give the same command again"
        raise TrainingError(f"{len(failed)} of {len(every)} cells failed: {names}. To try one again, {again}.")


def _listed(found: Mapping[str, CellResult]) -> list[CellResult]:
    """Results by the names of their cells."""
    return [found[name] for name in sorted(found)]


def _draw(out: Path, results: Sequence[CellResult]) -> dict[str, Path]:
    """Draw and save the figures; the PNG file of each."""
    if importlib.util.find_spec("matplotlib") is None:
        print('no figures: they need matplotlib. Install "symoden[plot]".', file=sys.stderr)
        return {}
    from symoden.report import draw_results

    paths = {}
    for name, figure in draw_results(out, results).items():
        paths[name] = out / "figures" / f"{name}.png"
        for path in (paths[name], paths[name].with_suffix(".pdf")):
            save_figure(figure, path, dpi=_DPI)
    return paths


def _write_page(command: Reproduce, page: Path, results: Sequence[CellResult], figures: Mapping[str, Path]) -> None:
    """Write the Markdown page."""
    from symoden.experiments import cell_folder, holds_run, machine_facts, read_run
    from symoden.report import write_page

    folders = [cell_folder(command.out, result.cell) for result in results]
    commits = {read_run(folder).commit or "not known" for folder in folders if holds_run(folder)}
    minutes = sum(result.seconds or 0.0 for result in results) / 60
    facts = {
        "last command": _words(command),
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "training time": f"{minutes:.0f} minutes in all",
        "commits that trained them": ", ".join(sorted(commit[:_SHORT] for commit in commits)),
    }
    write_page(page, results, table_rows(results), figures, facts | machine_facts())


def _words(command: Reproduce) -> str:
    """The command as it could be given again."""
    words = ["symoden", "reproduce"]
    for setting in fields(command):
        value = getattr(command, setting.name)
        if setting.name == "general" or value == setting.default:
            continue
        if setting.name == "figures":
            words.append("--no-figures")
            continue
        values = value if isinstance(value, tuple) else (value,)
        words += [f"--{setting.name}", *map(str, values)]
    return shlex.join(words)


def _report(command: Reproduce, results: Sequence[CellResult], failed: Sequence[str]) -> None:
    """Print what came of it."""
    rows = table_rows(results)
    if command.general.json:
        listed = [flat_row(row) for row in rows]
        print_json({"out": str(command.out), "cells": len(results), "failed": list(failed), "rows": listed})
        return
    print_table(
        "test and prediction error of the median seed, the paper's, and how many times smaller ours are",
        ("cells", "model", "seeds", "test", "the paper", "ratio", "prediction", "the paper", "ratio"),
        [(table_title(row), row.model, row.seeds, *_texts(row)) for row in rows],
    )
    page = "" if command.page is None else f", the page is {command.page}"
    print(f"tables and models are in {command.out}{page}")


def _texts(row: Row) -> list[str]:
    """Errors of a row."""
    texts = []
    for errors in (row.test, row.prediction):
        paper = None if errors is None else errors.paper
        texts += [
            number(None if errors is None else errors.median),
            number(None if paper is None else paper.mean),
            number(None if errors is None else errors.ratio),
        ]
    return texts
