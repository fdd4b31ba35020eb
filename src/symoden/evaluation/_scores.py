"""Position errors of a model on measured recordings."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data import Dataset, Trajectory, first_samples, least_lively
from symoden.integrate import HOLDS, AbstractSolver
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space

from ._batches import Stretch
from ._predict import Prediction, paths, predict
from ._windows import horizon_of, short_windows

_RESTS: Final = 0.1  # Share of the range of the length that goes furthest, below which another one rests.


@dataclass(frozen=True, kw_only=True)
class WindowScore:
    """Position RMSE of rollouts over windows of a recording, in the data's units; infinite where most diverge.

    Attributes:
        horizon_s: Length of a window [s].
        median: Median over the windows; NaN if the recording is too short for one.
        mean: Mean over the windows.
    """

    horizon_s: float
    median: float
    mean: float


@dataclass(frozen=True)
class MotionScore:
    """Errors while positions move or are predicted to: most windows of a recording may be at rest and stay there.

    Attributes:
        error: Median over the windows of the position RMSE, each counting by how far the positions move in it or by
            how far they are predicted to be off, if that is more; NaN if the recording is too short for one.
        motion: Median of how far they move, likewise.
        coasting: Median of how far off it is to go on at the window's first velocity, likewise; NaN of momenta.
    """

    error: float = np.nan
    motion: float = np.nan
    coasting: float = np.nan


@dataclass(frozen=True, kw_only=True)
class RecordingScore:
    """How well a recording is predicted.

    Attributes:
        name: Name of the recording.
        split: Its part: train, validation or test.
        samples: Number of its samples.
        window_rmse: Errors over short windows, each from a measured state.
        rollout_rmse: Position RMSE of one rollout from the start of the recording, found from its `initial_samples`;
            infinite if it diverges.
        astray: Of that rollout, the RMSE of the coordinate that is worst, relative to the range in which it moves in
            all recordings; the range of an angle is a turn or more.
        coordinates: The median over the windows for each coordinate by itself, for lengths and angles have no common
            unit.
        rollout_coordinates: Like `rollout_rmse`, for each coordinate by itself.
        motion: How far the positions move in such a window, what errors are to be compared with: root mean square of
            their distance from the window's first sample; NaN if there is no window.
        in_motion: Errors and motion of the windows that move.
        windows: Number of windows; 0 if the recording is too short for one.
        diverged: In how many of these the rollout diverges.
    """

    name: str
    split: str
    samples: int
    window_rmse: WindowScore
    rollout_rmse: float
    astray: float = np.nan
    coordinates: tuple[float, ...] = ()
    rollout_coordinates: tuple[float, ...] = ()
    motion: float = np.nan
    in_motion: MotionScore = MotionScore()
    windows: int = 0
    diverged: int = 0


def score_recordings(
    model: AbstractDynamics,
    dataset: Dataset,
    *,
    solver: AbstractSolver,
    splits: Sequence[str] = ("train", "validation", "test"),
) -> tuple[RecordingScore, ...]:
    """Score a model on measured recordings.

    Scoring starts after the `first_samples` of a recording. A window's first sample is where its rollout starts, so
    it is not scored. Windows are 1 s long, or shorter where all recordings of a part are (`horizon_of`).

    Args:
        model: Learned model or analytic system.
        dataset: Recordings.
        solver: What advances rollouts.
        splits: Parts to score.

    Returns:
        The scores, in the order of the recordings.
    """
    chosen = [(split, recording) for split in splits for recording in getattr(dataset, split)]
    recordings = [recording for _, recording in chosen]
    horizon = horizon_of(dataset)
    windows = [(i, *edges) for i, each in enumerate(recordings) for edges in short_windows(each, horizon)]
    stretches = [Stretch(trajectory=recordings[i], start=start, stop=stop) for i, start, stop in windows]
    rolled = paths(model, stretches, hold=HOLDS[dataset.hold], solver=solver)  # Not in their order.
    errors = {k: _mean_squares(path.q[1:], stretches[k].q[1:]) for k, path in rolled}
    rmse: list[list[np.ndarray]] = [[] for _ in recordings]
    moved: list[list[np.ndarray]] = [[] for _ in recordings]
    coasted: list[list[float]] = [[] for _ in recordings]
    for k, (i, start, stop) in enumerate(windows):
        recording, later = recordings[i], slice(start + 1, stop)
        way = recording.q[later] - recording.q[start]
        rmse[i].append(errors[k])
        moved[i].append(np.mean(way**2, axis=0))
        coast = recording.rates[start] * (recording.ts[later] - recording.ts[start])[:, None]
        coasted[i].append(np.nan if dataset.momenta else float(np.mean((way - coast) ** 2)))
    whole = predict(model, recordings, hold=dataset.hold, solver=solver)
    ranges = _ranges(dataset)
    return tuple(
        dataclasses.replace(
            _recording_score(split, recording, horizon, squares, motion, coasting, path),
            astray=float(np.max(np.sqrt(_whole_squares(path, recording)) / ranges)),
        )
        for (split, recording), squares, motion, coasting, path in zip(chosen, rmse, moved, coasted, whole, strict=True)
    )


def _whole_squares(path: Prediction, recording: Trajectory) -> Float[np.ndarray, " n"]:
    """Mean squares of the errors of the rollout of a whole recording."""
    scored = slice(first_samples(recording), None)
    return _mean_squares(path.q[scored], recording.q[scored])


def _ranges(dataset: Dataset) -> Float[np.ndarray, " n"]:
    """Ranges in which coordinates move in all recordings."""
    every, is_angle = dataset.recordings, np.array(Space.parse(dataset.space).is_angle)
    # Where an angle counts from may differ by turns from recording to recording.
    turned = np.max([np.ptp(each.q, axis=0) for each in every], axis=0)
    went = np.where(is_angle, turned, np.ptp(np.concatenate([each.q for each in every]), axis=0))
    # Chaotic motion goes over the top once more or less: of an arm's swing-up it was a turn and a half.
    least = np.where(is_angle, 2 * np.pi, least_lively(went, is_angle, idle=_RESTS))
    return np.maximum(np.maximum(went, least), np.finfo(float).tiny)


def _recording_score(
    split: str,
    recording: Trajectory,
    horizon: float,
    squares: Sequence[Float[np.ndarray, " n"]],
    motion: Sequence[Float[np.ndarray, " n"]],
    coasting: Sequence[float],
    path: Prediction,
) -> RecordingScore:
    """Score of one recording, from the mean squares of its windows' errors and motions and its whole rollout."""
    n = recording.q.shape[1]
    each = np.sqrt(np.asarray(squares).reshape(-1, n))
    errors = np.sqrt(np.mean(np.square(each), axis=1))
    known = len(errors) > 0
    whole = _whole_squares(path, recording)
    moved = np.sqrt([np.mean(square) for square in motion])
    # What rests, and is predicted to go somewhere, counts as well; what diverges as much as all that moves.
    weights = np.maximum(moved, np.minimum(errors, moved.max(initial=0.0))) + np.finfo(float).tiny
    return RecordingScore(
        name=recording.name,
        split=split,
        samples=len(recording),
        window_rmse=WindowScore(
            horizon_s=horizon,
            median=float(np.median(errors)) if known else np.nan,
            mean=float(np.mean(errors)) if known else np.nan,
        ),
        rollout_rmse=float(np.sqrt(np.mean(whole))),
        coordinates=tuple(np.median(each, axis=0).tolist()) if known else (np.nan,) * n,
        rollout_coordinates=tuple(np.sqrt(whole).tolist()),
        motion=float(np.sqrt(np.mean(motion))) if known else np.nan,
        in_motion=MotionScore(*(_middle(each, weights) for each in (errors, moved, np.sqrt(coasting))))
        if known
        else MotionScore(),
        windows=len(errors),
        diverged=int(np.sum(~np.isfinite(errors))),
    )


def _middle(values: Float[np.ndarray, " k"], weights: Float[np.ndarray, " k"]) -> float:
    """Median of weighted values."""
    return float(np.quantile(values, 0.5, weights=weights, method="inverted_cdf"))


def _mean_squares(predicted: Float[np.ndarray, "T n"], measured: Float[np.ndarray, "T n"]) -> Float[np.ndarray, " n"]:
    """Mean squared difference of every coordinate; infinite for all of them where a rollout diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.mean((predicted - measured) ** 2, axis=0)
    return squares if np.isfinite(squares).all() else np.full_like(squares, np.inf)
