"""How errors change with the number of training trajectories and with noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ._cells import data_name
from ._table import PAPER_ORDER, Row, SeedErrors
from ._tasks import own_trajectories


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepCurve:
    """Prediction errors of one kind of model.

    Attributes:
        values: What is varied, increasing.
        median: Median over the seeds of the mean over trajectories; NaN where every seed failed.
        least: Least over the seeds.
        greatest: Greatest over the seeds.
    """

    values: Float[np.ndarray, " K"]
    median: Float[np.ndarray, " K"]
    least: Float[np.ndarray, " K"]
    greatest: Float[np.ndarray, " K"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """Prediction errors over one quantity that was varied, all else being the task's own.

    Attributes:
        name: The task, then the space if it is not the task's own.
        preset: Name of the settings.
        quantity: What is varied, with its unit.
        curves: Errors by kind of model, in the paper's order.
        own: What the quantity is in the paper.
    """

    name: str
    preset: str
    quantity: str
    curves: Mapping[str, SweepCurve]
    own: float


def is_own(row: Row) -> bool:
    """Whether a row has what its task has: all training trajectories, free of noise.

    Args:
        row: A row.

    Returns:
        Whether it does.
    """
    return row.trajectories is None and not row.noise


def sweeps(rows: Sequence[Row]) -> tuple[Sweep, ...]:
    """Find the quantities that were varied.

    Args:
        rows: Rows of the table.

    Returns:
        For each task, space and preset at most two: over trajectories, and over noise; each has at least two values.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row_name(row), row.preset), []).append(row)
    found = (sweep for (name, preset), group in groups.items() for sweep in _of(name, preset, group))
    return tuple(sweep for sweep in found if len({x for curve in sweep.curves.values() for x in curve.values}) > 1)


def row_name(row: Row) -> str:
    """The task, then the space if it is not the task's own.

    Args:
        row: A row.

    Returns:
        A name that can be one of a file.
    """
    return data_name(row.task, row.space)


def _of(name: str, preset: str, rows: Sequence[Row]) -> tuple[Sweep, Sweep]:
    """Both sweeps of a task, however few values they have."""
    own = own_trajectories(rows[0].task)
    # What was asked for outright comes first, so that the task's own replaces it.
    ordered = sorted(rows, key=lambda row: row.trajectories is None)
    counts = [(row, float(row.trajectories or own)) for row in ordered if not row.noise]
    noises = [(row, row.noise) for row in ordered if row.trajectories in {None, own}]
    quantities = (("training trajectories [1]", counts, float(own)), ("standard deviation of noise [SI]", noises, 0.0))
    both = [
        Sweep(name=name, preset=preset, quantity=quantity, curves=_curves(values), own=usual)
        for quantity, values, usual in quantities
    ]
    return both[0], both[1]


def _curves(values: Sequence[tuple[Row, float]]) -> dict[str, SweepCurve]:
    """One curve for each kind of model."""
    found: dict[str, dict[float, SeedErrors | None]] = {kind: {} for kind in PAPER_ORDER}
    for row, x in values:
        found[row.model][x] = row.prediction
    return {kind: _curve(errors) for kind, errors in found.items() if errors}


def _curve(errors: Mapping[float, SeedErrors | None]) -> SweepCurve:
    """Sort the errors by what was varied."""
    ordered = sorted(errors)
    known = [errors[x] for x in ordered]
    median, least, greatest = (
        np.array([np.nan if error is None else getattr(error, name) for error in known])
        for name in ("median", "least", "greatest")
    )
    return SweepCurve(values=np.array(ordered), median=median, least=least, greatest=greatest)
