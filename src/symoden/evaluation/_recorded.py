"""Recordings, and what a model makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from symoden.data import Trajectory, first_samples
from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics

from ._bands import BandedPath, Bands, judged_windows
from ._batches import Stretch
from ._predict import Prediction, predict, with_first_state
from ._windows import OVERLAP, instant_of


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedPaths:
    """A recording and rollouts along it.

    Attributes:
        name: Name of the recording.
        ts: Time stamps [s].
        measured: Measured coordinates.
        whole: One rollout from the first sample.
        windows: Rollouts of 1 s with their bands, each from a measured state; none without bands.
        scored_from: First row that is scored: by those before it the rollout's start is found.
    """

    name: str
    ts: Float[np.ndarray, " T"]
    measured: Float[np.ndarray, "T n"]
    whole: Float[np.ndarray, "T n"]
    windows: tuple[BandedPath, ...]
    scored_from: int = 0


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
    windows = [[] for _ in recordings] if bands is None else _banded_windows(bands, recordings)
    return tuple(
        RecordedPaths(
            name=each.name,
            ts=each.ts,
            measured=each.q,
            whole=path.q,
            windows=tuple(window for _, window in banded),
            scored_from=first_samples(each),
        )
        for each, path, banded in zip(recordings, whole, windows, strict=True)
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class BandsAlong:
    """Bands along a recording, sample by sample; NaN where there are none.

    Attributes:
        half_width: Half of the band of the rollout from the first sample, over the first `Bands.horizon`: nothing tells
            how far rollouts are off later.
        windows: Rollouts of that length one after the other, each from a measured state; NaN after the last whole one.
        windows_half_width: Half of their bands; NaN also where they diverge.
        coverage: Share of the measured positions that lie in the bands of these windows, their first samples left out;
            NaN without such positions.
    """

    half_width: Float[np.ndarray, "T n"]
    windows: Float[np.ndarray, "T n"]
    windows_half_width: Float[np.ndarray, "T n"]
    coverage: float


def bands_along(
    bands: Bands, recordings: Sequence[Trajectory], predictions: Sequence[Prediction]
) -> tuple[BandsAlong, ...]:
    """Find the bands of rollouts along recordings, over the windows that `recorded_paths` has.

    Args:
        bands: What makes the bands.
        recordings: Recordings of any lengths.
        predictions: What `predict` made of them.

    Returns:
        The bands along each recording.
    """
    begun = [_beginning(*pair, bands.horizon) for pair in zip(recordings, predictions, strict=True)]
    return tuple(
        _along(recording, beginning, windows)
        for recording, beginning, windows in zip(
            recordings, bands.predict(begun), _banded_windows(bands, recordings), strict=True
        )
    )


def _banded_windows(bands: Bands, recordings: Sequence[Trajectory]) -> list[list[tuple[int, BandedPath]]]:
    """Windows of each recording that follow one another, each with its first sample."""
    edges = [judged_windows(each, bands.horizon)[::OVERLAP] for each in recordings]
    cut = [(k, *window) for k, of_one in enumerate(edges) for window in of_one]
    stretches = [Stretch(trajectory=recordings[k], start=start, stop=stop) for k, start, stop in cut]
    found: list[list[tuple[int, BandedPath]]] = [[] for _ in recordings]
    for (k, start, _), path in zip(cut, bands.predict(stretches), strict=True):
        found[k].append((start, path))
    return found


def _beginning(recording: Trajectory, prediction: Prediction, horizon: float) -> Stretch:
    """The first window of a rollout, from the state that it starts in: it may be another than the measured one."""
    begun = with_first_state(recording, prediction.q[0], prediction.rates[0])
    stop = int(np.searchsorted(recording.ts - recording.ts[0], horizon + instant_of(recording)))
    return Stretch(trajectory=begun, start=0, stop=max(stop, 2))


def _along(recording: Trajectory, beginning: BandedPath, windows: Sequence[tuple[int, BandedPath]]) -> BandsAlong:
    """Bands of one recording."""
    half_width, q, widths = (np.full(recording.q.shape, np.nan) for _ in range(3))
    half_width[: len(beginning.ts)] = beginning.half_width
    judged = np.zeros(len(recording), bool)
    for start, path in reversed(windows):  # Where one begins as another ends, the end says more.
        rows = slice(start, start + len(path.ts))
        q[rows], widths[rows] = path.q, path.half_width
        judged[start + 1 : rows.stop] = True
    for each in (half_width, widths):
        each[~np.isfinite(each)] = np.nan  # Of a rollout that diverges.
    inside = np.abs(q - recording.q)[judged] <= widths[judged]  # No band holds what diverges.
    return BandsAlong(
        half_width=half_width,
        windows=q,
        windows_half_width=widths,
        coverage=float(np.mean(inside)) if inside.size else np.nan,
    )
