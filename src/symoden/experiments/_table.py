"""Rows of the paper's table: what came of the seeds of a cell, beside the paper's errors."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from symoden.models import Kind

from ._cells import Cell, CellResult
from ._paper import MeanStd, PaperErrors
from ._tasks import TASKS

PAPER_ORDER: Final[tuple[Kind, ...]] = ("naive", "geometric", "unstructured", "symoden", "dissipative")
"""Kinds of models in the order of the paper's Table 1."""


@dataclass(frozen=True, kw_only=True)
class SeedErrors:
    """One of the three errors over the seeds, each seed being a mean over trajectories.

    Attributes:
        median: The median seed's mean; of an even number of seeds the lower one of the two in the middle.
        least: The least mean.
        greatest: The greatest mean.
        spread: Mean and standard deviation over the trajectories of the median seed.
        paper: The paper's mean and standard deviation; None where the paper has none.
        ratio: The paper's mean relative to the median; None without the one, or if the other is not positive.
    """

    median: float
    least: float
    greatest: float
    spread: MeanStd
    paper: MeanStd | None
    ratio: float | None


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of the table: cells that differ in their seed alone.

    Attributes:
        task: Name of the task.
        space: Configuration space instead of the task's own, if any.
        model: Kind of model.
        preset: Name of the settings.
        trajectories: Number of training trajectories; the task's if None.
        noise: Standard deviation of the noise on the training recordings.
        parameters: Number of trained numbers; None if no seed could be trained.
        seeds: Number of seeds that could be trained.
        failed: Number of those that could not.
        train: Errors over the training trajectories; None if no seed could be trained.
        test: Over the test trajectories.
        prediction: Over the longer trajectories without input.
        seconds: Median time of training [s].
    """

    task: str
    space: str | None
    model: Kind
    preset: str
    trajectories: int | None
    noise: float
    parameters: int | None
    seeds: int
    failed: int
    train: SeedErrors | None
    test: SeedErrors | None
    prediction: SeedErrors | None
    seconds: float | None


def table_rows(results: Sequence[CellResult]) -> tuple[Row, ...]:
    """Gather results over their seeds.

    Args:
        results: Results of cells, in any order.

    Returns:
        The rows in the paper's order: by task, then preset, and then as in its table.
    """
    groups: dict[tuple, list[CellResult]] = {}
    for result in sorted(results, key=lambda result: _order(result.cell)):
        groups.setdefault(_order(result.cell), []).append(result)
    return tuple(_row(group) for group in groups.values())


def _order(cell: Cell) -> tuple:
    """Where the cell's row stands; equal for cells that differ in their seed alone."""
    variant = (cell.trajectories is not None, cell.trajectories or 0, cell.noise)
    task = (list(TASKS).index(cell.task), cell.space is not None, cell.space or "")
    return (*task, cell.preset, *variant, PAPER_ORDER.index(cell.model))


def _row(group: Sequence[CellResult]) -> Row:
    """The row of some seeds."""
    cell = group[0].cell
    done = [result for result in group if result.error is None]
    # The paper has neither fewer trajectories nor noise.
    comparable = cell.trajectories is None and not cell.noise
    paper = TASKS[cell.task].paper.get(cell.model) if comparable else None

    def errors(of: Callable[[CellResult | PaperErrors], MeanStd | None]) -> SeedErrors | None:
        values = [error for error in map(of, done) if error is not None]
        return _over_seeds(values, paper and of(paper)) if values else None

    seconds = [result.seconds for result in done if result.seconds is not None]
    return Row(
        task=cell.task,
        space=cell.space,
        model=cell.model,
        preset=cell.preset,
        trajectories=cell.trajectories,
        noise=cell.noise,
        parameters=next((result.parameters for result in done), None),
        seeds=len(done),
        failed=len(group) - len(done),
        train=errors(lambda one: one.train),
        test=errors(lambda one: one.test),
        prediction=errors(lambda one: one.prediction),
        seconds=statistics.median(seconds) if seconds else None,
    )


def _over_seeds(errors: Sequence[MeanStd], paper: MeanStd | None) -> SeedErrors:
    """Median and range of the seeds' means."""
    ordered = sorted(errors)
    middle = ordered[(len(ordered) - 1) // 2]
    return SeedErrors(
        median=middle.mean,
        least=ordered[0].mean,
        greatest=ordered[-1].mean,
        spread=middle,
        paper=paper,
        ratio=paper.mean / middle.mean if paper is not None and middle.mean > 0 else None,
    )
