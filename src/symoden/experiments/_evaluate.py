"""Scores of a model: the paper's errors on a task, position errors on measured recordings."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from symoden.blocks import without_silent
from symoden.data import Dataset, Trajectory, least_lively
from symoden.integrate import HOLDS, RK4, AbstractSolver, Hold, Rollout
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.training import FEWEST_SUBSTEPS, find_first_state

from ._batches import Segment, Stretch, entire, in_batches, roll_out
from ._paper import MeanStd
from ._sources import Source
from ._windows import horizon_of, short_windows

_RESTS: Final = 0.1  # Share of the range of the length that goes furthest, below which another one rests.


@dataclass(frozen=True, kw_only=True)
class TaskScore:
    """The paper's errors: for each trajectory the sum of the squared errors of one rollout from its first point.

    Attributes:
        train: Over the training trajectories.
        test: Over the test trajectories.
        prediction: Over the longer trajectories without input.
        diverged: How many trajectories of each part have no finite error.
    """

    train: MeanStd
    test: MeanStd
    prediction: MeanStd
    diverged: dict[str, int] = field(default_factory=dict)


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
    motion: float = np.nan
    in_motion: MotionScore = MotionScore()
    windows: int = 0
    diverged: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Rollout from the first state of a recording, as measured or as found.

    Attributes:
        q: Coordinates; angles without jumps of 2π, whatever the model.
        rates: Velocities or momenta.
        observations: Embedded coordinates as the model has them, then the rates.
    """

    q: Float[np.ndarray, "T n"]
    rates: Float[np.ndarray, "T n"]
    observations: Float[np.ndarray, "T o"]


def score_task(model: AbstractDynamics, source: Source, *, solver: AbstractSolver) -> TaskScore:
    """Score a model by the paper's metrics, in the task's own observation space whatever the model was told.

    Args:
        model: Learned model or analytic system.
        source: A task.
        solver: What advances rollouts.

    Returns:
        The errors; a rollout that diverges makes its error NaN or infinite.

    Raises:
        ValueError: If the source is no task.
    """
    if source.task is None:
        raise ValueError(f"The paper's errors are those of a task; got the data set `{source.name}`.")
    space = Space.parse(source.task.space)
    parts = (source.dataset.train, source.dataset.test, source.prediction)
    every = [recording for part in parts for recording in part]
    predictions = predict(model, every, hold=source.dataset.hold, solver=solver)
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.array([squared_error(model, space, *pair) for pair in zip(every, predictions, strict=True)])
        each = np.split(errors, np.cumsum([len(part) for part in parts])[:-1])
        train, test, prediction = (MeanStd(float(part.mean()), float(part.std())) for part in each)
    lost = [int(np.sum(~np.isfinite(part))) for part in each]
    diverged: dict[str, int] = dict(zip(("train", "test", "prediction"), lost, strict=True))
    return TaskScore(train=train, test=test, prediction=prediction, diverged=diverged)


def score_recordings(
    model: AbstractDynamics,
    dataset: Dataset,
    *,
    solver: AbstractSolver,
    splits: Sequence[str] = ("train", "validation", "test"),
) -> tuple[RecordingScore, ...]:
    """Score a model on measured recordings.

    Scoring starts after the `initial_samples` of a recording. A window's first sample is where its rollout starts, so
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
    rmse: list[list[np.ndarray]] = [[] for _ in recordings]
    moved: list[list[np.ndarray]] = [[] for _ in recordings]
    coasted: list[list[float]] = [[] for _ in recordings]
    for i, start, stop in windows:
        recording, later = recordings[i], slice(start + 1, stop)
        way = recording.q[later] - recording.q[start]
        moved[i].append(np.mean(way**2, axis=0))
        coast = recording.rates[start] * (recording.ts[later] - recording.ts[start])[:, None]
        coasted[i].append(np.nan if dataset.momenta else float(np.mean((way - coast) ** 2)))
    for k, path in paths(model, stretches, hold=HOLDS[dataset.hold], solver=solver):
        rmse[windows[k][0]].append(_mean_squares(path.q[1:], stretches[k].q[1:]))
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
    return _mean_squares(path.q[recording.initial_samples :], recording.q[recording.initial_samples :])


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
        rollout_rmse=float(np.sqrt(np.mean(_whole_squares(path, recording)))),
        coordinates=tuple(np.median(each, axis=0).tolist()) if known else (np.nan,) * n,
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


def predict(
    model: AbstractDynamics,
    trajectories: Sequence[Trajectory],
    *,
    hold: str = "zero",
    solver: AbstractSolver | None = None,
) -> list[Prediction]:
    """Roll out recordings from their first states under their inputs.

    The first state is the measured one; where there are more `initial_samples`, it is found from these
    (`find_first_state`), unless the rollout from there diverges.

    Args:
        model: Learned model or analytic system.
        trajectories: Recordings of any lengths.
        hold: What an input is between samples, a key of `HOLDS`, as the data set says.
        solver: What advances rollouts; four RK4 steps in a sampling interval if absent.

    Returns:
        One prediction for each recording.

    Raises:
        ValueError: If `hold` is no key of `HOLDS`.

    Example:
        >>> from symoden.systems import Pendulum
        >>> ts = np.linspace(0.0, 1.0, 21)
        >>> rest = Trajectory(name="rest", ts=ts, q=np.zeros((21, 1)), rates=np.zeros((21, 1)), us=np.zeros((21, 1)))
        >>> (path,) = predict(Pendulum(), [rest])
        >>> float(abs(path.q - rest.q).max())
        0.0
    """
    if hold not in HOLDS:
        raise ValueError(f"`hold` must be {' or '.join(map(repr, HOLDS))}; got {hold!r}.")
    chosen, solver = HOLDS[hold], RK4(FEWEST_SUBSTEPS) if solver is None else solver
    begun = [_begun(model, trajectory, chosen, solver) for trajectory in trajectories]
    found = dict(paths(model, entire(begun), hold=chosen, solver=solver))
    astray = [
        i
        for i, trajectory in enumerate(trajectories)
        if begun[i] is not trajectory and not np.isfinite(found[i].observations).all()
    ]
    for k, path in paths(model, entire([trajectories[i] for i in astray]), hold=chosen, solver=solver):
        found[astray[k]] = path
    return [found[i] for i in range(len(trajectories))]


def _begun(model: AbstractDynamics, recording: Trajectory, hold: Hold, solver: AbstractSolver) -> Trajectory:
    """A recording that begins in the state that its initial samples tell; the same one where it has one such sample."""
    if recording.initial_samples == 1:
        return recording
    first = find_first_state(model, recording, hold=hold, solver=solver)
    q, rates = (
        np.concatenate([x[None], rest[1:]]) for x, rest in zip(first, (recording.q, recording.rates), strict=True)
    )
    return dataclasses.replace(recording, q=q, rates=rates)


def paths(
    model: AbstractDynamics, stretches: Sequence[Stretch], *, hold: Hold, solver: AbstractSolver
) -> Iterator[tuple[int, Prediction]]:
    """Roll out stretches of recordings, each from its first state.

    Args:
        model: Learned model or analytic system.
        stretches: Stretches of any lengths.
        hold: How inputs act between samples.
        solver: What advances rollouts.

    Yields:
        The index of a stretch, and its rollout; not in order.
    """
    lean = without_silent(model)
    for i, path in in_batches(lambda batch: _rollouts(lean, batch, solver, hold), stretches):
        samples = len(stretches[i])
        yield i, Prediction(q=path.q[:samples], rates=path.rates[:samples], observations=path.observations[:samples])


@eqx.filter_jit
def _rollouts(model: AbstractDynamics, batch: Segment, solver: AbstractSolver, hold: Hold) -> Rollout:
    """Roll out a batch of segments."""
    return jax.vmap(lambda segment: roll_out(model, segment, solver=solver, hold=hold))(batch)


def squared_error(model: AbstractDynamics, space: Space, measured: Trajectory, predicted: Prediction) -> float:
    """Sum of squared errors over samples and the observation channels of a space.

    Args:
        model: What predicted.
        space: Space of the channels.
        measured: The truth.
        predicted: The rollout.

    Returns:
        The sum; not finite if the rollout diverged.
    """
    seen = (
        predicted.observations
        if model.space.is_angle == space.is_angle
        else _observed(space, predicted.q, predicted.rates)
    )
    return float(np.sum((seen - _observed(space, measured.q, measured.rates)) ** 2))


def _observed(space: Space, q: Float[np.ndarray, "T n"], rates: Float[np.ndarray, "T n"]) -> Float[np.ndarray, "T o"]:
    """Embedded coordinates, then the rates."""
    angles = q[:, space.angles]
    return np.concatenate([q[:, space.lengths], np.cos(angles), np.sin(angles), rates], axis=1)


def _mean_squares(predicted: Float[np.ndarray, "T n"], measured: Float[np.ndarray, "T n"]) -> Float[np.ndarray, " n"]:
    """Mean squared difference of every coordinate; infinite for all of them where a rollout diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.mean((predicted - measured) ** 2, axis=0)
    return squares if np.isfinite(squares).all() else np.full_like(squares, np.inf)
