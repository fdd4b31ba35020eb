"""Moments at which something moves the machine that neither its inputs nor what was learned explains."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.data import DataError, Dataset, Trajectory, least_motion, whole_name, windows, without_poor_ends
from symoden.mechanics import AbstractDynamics

from ._config import Span, TrainingConfig
from ._data import Data, hold_out, regression_data
from ._flatten import cast
from ._levenberg_stage import LevenbergStage
from ._objective import Batch
from ._residuals import evaluate_residuals
from ._stages import AbstractStage
from ._state import TrainingState

_USUAL: Final = 0.9  # Quantile of what a model leaves unexplained: two to three times the median.
_FAR: Final = 8.0  # Times that: where it is much, machines without disturbances have 4.5 at most, pushes 10 to 500.
_MUCH: Final = 0.5  # Of what velocities change by in a window: less does no harm.
_ENOUGH: Final = 20  # Windows that tell what is usual.
_SELDOM: Final = 0.05  # Share of the windows: more, and it is the model that explains too little.
_STRIDES: Final = 4  # Of a window, from one to the next.


@dataclass(frozen=True, eq=False)
class Screening:
    """Looks for disturbances once a model is good enough to tell, and before much time is spent on more.

    Attributes:
        stages: Indices of the stages after which it looks.
        data: Windows of the weak form.
        dataset: What was recorded, before anything was held or left out.
        config: Settings, with what is left out already.
    """

    stages: tuple[int, ...]
    data: Data
    dataset: Dataset
    config: TrainingConfig

    def after(self, stage: int, state: TrainingState) -> tuple[Span, ...]:
        """Look for more, if it is time.

        Args:
            stage: Index of the stage that has ended.
            state: State of training then.

        Returns:
            All that is to be left out, if there is more than before; nothing where too little would be left.
        """
        if stage not in self.stages:
            return ()
        known = self.config.left_out or ()
        recordings = tuple(map(without_poor_ends, (*self.dataset.train, *self.dataset.validation)))
        more = find_disturbances(state.best, self.data, recordings, known)
        if not more:
            return ()
        config = dataclasses.replace(self.config, left_out=(*known, *more))
        try:
            hold_out(self.dataset, config)
        except DataError:
            return ()
        return config.left_out or ()


def screening_of(
    dataset: Dataset,
    held: Dataset,
    dynamics: AbstractDynamics,
    stages: Sequence[AbstractStage],
    config: TrainingConfig,
) -> Screening | None:
    """What looks for disturbances, where that can be.

    Args:
        dataset: Recordings as a whole.
        held: What is used of them, with its validation part.
        dynamics: Untrained model, of which there is a weak form.
        stages: What training goes through.
        config: Settings.

    Returns:
        It; none where no priors are learned, so that hardly a model is good enough to tell, where recordings are too
        short, or several have the same name.
    """
    first: dict[bool, int] = {}
    for k, each in enumerate(stages):
        if isinstance(each, LevenbergStage) and each.learns:
            first.setdefault(each.regresses, k)
    names = [each.name for each in (*dataset.train, *dataset.validation)]
    if not first or not config.scaled_loss or len(set(names)) < len(names):
        return None
    data = regression_data(held, dynamics, config)
    return None if data is None else Screening(tuple(first.values()), data, dataset, config)


def find_disturbances(
    model: AbstractDynamics, data: Data, recordings: Sequence[Trajectory], left_out: Sequence[Span] = ()
) -> list[Span]:
    """Find where recordings move far otherwise than a model says, for a moment.

    By the equations of motion in weak form, from the states that were measured along a short window: a rollout that
    goes astray tells nothing of when it began to. A window is disturbed if far more of a coordinate's change of
    velocity is unexplained than is usual where it moves, and much. Where that is so often, the model is at fault, and
    nothing is found.

    Args:
        model: A model that was fitted to the recordings.
        data: Windows of the weak form, for what is usual.
        recordings: Where to look.
        left_out: Where not to: spans of them.

    Returns:
        Spans of the recordings that are disturbed, by name and in their own time [s].
    """
    model = cast(model, data.train.q.dtype)

    def residuals(batch: Batch) -> Float[np.ndarray, "B n"]:
        return np.asarray(evaluate_residuals(model, data.objective, batch))[:, 0]

    bound = _bound(residuals(data.train), data, least_motion(recordings))
    horizon = data.train.ts.shape[1] - 1
    stride = max(1, horizon // _STRIDES)
    found, total, disturbed = [], 0, 0
    for recording in recordings:
        if len(recording) <= horizon:
            continue
        every = windows([recording], horizon, stride=stride)
        starts = np.arange(len(every)) * stride
        known = _overlaps(recording, starts, horizon, left_out)
        far = (np.abs(residuals(Batch.of(every, data.train.q.dtype))) > bound).any(axis=1) & ~known
        total, disturbed = total + int(np.sum(~known)), disturbed + int(np.sum(far))
        found.extend(_spans(recording, starts[far], horizon))
    return found if disturbed <= _SELDOM * total else []


def _bound(residuals: Float[np.ndarray, "B n"], data: Data, least: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """What nothing undisturbed leaves of each coordinate's change of velocity.

    A joint that mostly rests is no measure of what a model leaves of it when it moves.

    Returns:
        The bounds, relative as residuals are; infinite where they are not known.
    """
    q, rates = (np.asarray(each) for each in (data.train.q, data.train.rates))
    moves = np.ptp(q, axis=1) > least
    changes = np.mean((rates[:, 1:] - rates[:, :1]) ** 2, axis=1) * np.asarray(data.objective.weights) ** 2
    bound = np.full(len(least), np.inf)
    for i in np.flatnonzero(np.sum(moves, axis=0) >= _ENOUGH):
        rows = moves[:, i]
        if np.isfinite(residuals[rows, i]).all():
            usual = float(np.quantile(np.abs(residuals[rows, i]), _USUAL))
            bound[i] = max(_FAR * usual, _MUCH * float(np.sqrt(np.mean(changes[rows, i]))))
    return bound


def _overlaps(recording: Trajectory, starts: np.ndarray, horizon: int, spans: Sequence[Span]) -> Bool[np.ndarray, " B"]:
    """Which windows of a recording have something of spans."""
    first, last = recording.ts[starts], recording.ts[starts + horizon]
    name_of = whole_name(recording.name)
    inside = [(first <= end) & (last >= start) for name, start, end in spans if name == name_of]
    return np.any([np.zeros(len(starts), bool), *inside], axis=0)


def _spans(recording: Trajectory, starts: np.ndarray, horizon: int) -> Iterator[Span]:
    """Spans that hold what disturbs windows: from the middle of the first one in a row to that of the last, and more.

    Yields:
        One for each row of windows that follow each other.
    """
    for row in np.split(starts, np.flatnonzero(np.diff(starts) > horizon) + 1):
        if len(row):
            # Under a bump, what is at its ends hardly counts.
            first, last = row[0] + horizon // 4, row[-1] + horizon - horizon // 4
            yield whole_name(recording.name), float(recording.ts[first]), float(recording.ts[last])
