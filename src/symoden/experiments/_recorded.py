"""Recordings, and what a model makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from symoden.data import Trajectory
from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics

from ._bands import BandedPath, Bands, judged_windows
from ._batches import Stretch
from ._evaluate import predict
from ._windows import OVERLAP


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedPaths:
    """A recording and rollouts along it.

    Attributes:
        name: Name of the recording.
        ts: Time stamps [s].
        measured: Measured coordinates.
        whole: One rollout from the first sample.
        windows: Rollouts of 1 s with their bands, each from a measured state; none without bands.
    """

    name: str
    ts: Float[np.ndarray, " T"]
    measured: Float[np.ndarray, "T n"]
    whole: Float[np.ndarray, "T n"]
    windows: tuple[BandedPath, ...]


def recorded_paths(
    model: AbstractDynamics,
    recordings: Sequence[Trajectory],
    *,
    hold: str,
    solver: AbstractSolver,
    bands: Bands | None = None,
) -> tuple[RecordedPaths, ...]:
    """Roll out recordings from their first states, and second by second.

    Args:
        model: Learned model or analytic system.
        recordings: Recordings of any lengths.
        hold: What an input is between samples, a key of `HOLDS`.
        solver: What advances rollouts.
        bands: Makes the windows.

    Returns:
        What was predicted of each.
    """
    whole = predict(model, recordings, hold=hold, solver=solver)
    windows: list[list[BandedPath]] = [[] for _ in recordings]
    if bands is not None:
        edges = [judged_windows(each, bands.horizon)[::OVERLAP] for each in recordings]
        cut = [(k, *window) for k, of_one in enumerate(edges) for window in of_one]
        stretches = [Stretch(trajectory=recordings[k], start=start, stop=stop) for k, start, stop in cut]
        for (k, _, _), path in zip(cut, bands.predict(stretches), strict=True):
            windows[k].append(path)
    return tuple(
        RecordedPaths(name=each.name, ts=each.ts, measured=each.q, whole=path.q, windows=tuple(banded))
        for each, path, banded in zip(recordings, whole, windows, strict=True)
    )
