"""Moments at which something moves the machine that neither its inputs nor what was learned explains."""

import dataclasses
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from symoden.blocks import kinds_in_use
from symoden.data import (
    DataError,
    Dataset,
    Trajectory,
    least_motion,
    usual_step,
    whole_name,
    windows,
    without_poor_ends,
)
from symoden.integrate import HOLDS, Hold
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space

from ._config import Span, TrainingConfig
from ._data import Data, hold_out, regression_data
from ._flatten import cast
from ._left_out import Contender, without
from ._levenberg_stage import LevenbergStage
from ._objective import AbstractObjective, Batch
from ._relevance import Relevance, remembered
from ._residuals import evaluate_residuals
from ._stages import AbstractStage, Clock, never
from ._state import TrainingState
from ._weak_form import WeakForm, has_weak_form
from ._weighing import Errors, Weighing

_USUAL: Final = 0.9  # Quantile of what a model leaves unexplained: two to three times the median.
_FAR: Final = 8.0  # Times that: where it is much, machines without disturbances have 4.5 at most, pushes 10 to 500.
_MUCH: Final = 0.5  # Of what velocities change by in a window: less does no harm.
_ENOUGH: Final = 20  # Windows that tell what is usual.
_SELDOM: Final = 0.05  # Share of the windows: more, and it is the model that explains too little.
_OFTEN: Final = 0.25  # Share of those of one recording that no model was fitted to: it is another machine, or load.
_ALIKE: Final = 2.5  # Times longer or shorter, what is usual in windows is so in others: twice the rate is common.
_HOLE: Final = 2.5  # Times the usual step: what inputs were where rows are lost was not logged.
_STRIDES: Final = 4  # Of a window, from one to the next.
_EVENT: Final = _STRIDES + 1  # Windows that a short one is in.
_TRIMMED: Final = 0.1  # Share of the windows that a fit goes without which they must not bend.
_ROUNDS: Final = 2
_STEPS: Final = 8  # Of each.
_BENT: Final = 2.0  # Times better it then explains the usual window: 1.2 at most where nothing had bent the model.
_FINE: Final = 0.01  # Of what velocities change by: what is explained so well need not be explained better.


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

    def after(self, stage: int, state: TrainingState, is_over: Clock = never) -> tuple[Span, ...]:
        """Look for more, if it is time.

        Args:
            stage: Index of the stage that has ended.
            state: State of training then.
            is_over: Whether the time is over.

        Returns:
            All that is to be left out, if there is more than before; nothing where too little would be left.

        Raises:
            OutOfTime: If the time is over before that is known.
        """
        if stage not in self.stages:
            return ()
        known = self.config.left_out or ()
        recordings = tuple(map(without_poor_ends, (*self.dataset.train, *self.dataset.validation)))
        more = disturbed_spans(state.best, self.data, recordings, known)
        if not more and (model := self._unbent(state, is_over)) is not None:
            more = disturbed_spans(model, self.data, recordings, known, bent=True)
        if not more:
            return ()
        config = dataclasses.replace(self.config, left_out=(*known, *more))
        try:
            hold_out(self.dataset, config)
        except DataError:
            return ()
        return config.left_out or ()

    def _unbent(self, state: TrainingState, is_over: Clock) -> AbstractDynamics | None:
        """Fit the best model by least trimmed squares.

        A force that holds on for long looks like friction or weight to a fit that has to explain it as well. So the
        model is fitted again without the windows that it explains least, and once more without those it then does.

        Returns:
            The model; None where it explains most windows hardly better so: the others had not bent it.

        References:
            Rousseeuw (1984), *Least median of squares regression*; Rousseeuw & Van Driessen (2006), *Computing LTS
            regression for large data sets*: steps like these, but that a window counts by its worst coordinate here,
            and that priors have a say.
        """
        model, windows = cast(state.best, self.data.train.q.dtype), self.data.train
        trimmed = int(_TRIMMED * windows.ts.shape[0])
        left, before = self._left(model)
        if trimmed < 1 or not before.max() > _BENT * _FINE:
            return None
        priors = remembered(state.memory, Relevance.start(model, self.config.prior))
        weighing = Weighing.alike(model.space)
        stage = LevenbergStage(self.data, self.config, "trimmed", _STEPS)
        step = functools.partial(stage.step, substeps=state.substeps, weighing=weighing, priors=priors)
        whole = Contender(model, kinds_in_use(model), step, _ROUNDS * _STEPS, self.config.damping)
        usual = before
        for _ in range(_ROUNDS):
            worst = np.argsort((left / usual).max(axis=1))[-trimmed:]
            model = whole._replace(model=model, steps=_STEPS).refitted(without(windows, worst), is_over)
            left, usual = self._left(model)
            if not (before / usual).max() > _BENT:
                return None
        # As many steps with all windows: it may not have been at the bottom.
        _, without_trimming = self._left(whole.refitted(windows, is_over))
        return model if (without_trimming / usual).max() > _BENT else None

    def _left(self, model: AbstractDynamics) -> tuple[Float[np.ndarray, "B n"], Float[np.ndarray, " n"]]:
        """What a model leaves of the changes of velocities in windows, and in the usual one, if that is much."""
        left = np.abs(_residuals(model, self.data.objective, self.data.train))
        return left, np.maximum(np.median(left, axis=0), _FINE)


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
    after: dict[bool, int] = {}  # The first that learns priors; where errors count in both ways, the second.
    for k, each in enumerate(stages):
        if isinstance(each, LevenbergStage) and each.learns:
            after[each.regresses] = k if each.errors is Errors.WHITENED else after.get(each.regresses, k)
    names = [each.name for each in (*dataset.train, *dataset.validation)]
    if not after or not config.scaled_loss or len(set(names)) < len(names):
        return None
    data = regression_data(held, dynamics, config)
    return None if data is None else Screening(tuple(after.values()), data, dataset, config)


def find_disturbances(
    model: AbstractDynamics,
    recordings: Sequence[Trajectory],
    dataset: Dataset,
    config: TrainingConfig | None = None,
    *,
    hold: str | None = None,
) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Find where recordings that a model was not trained on move far otherwise than it says, for a moment.

    By what is usual of those that it was trained on, in the same way as training looks for what to leave out. It is
    what inputs do not tell (a push, a stop, a wrong sample), or what training has not seen.

    Args:
        model: What `fit` found, or another mechanical one.
        recordings: Others of the same mechanism.
        dataset: What it was fitted to.
        config: With which settings; those of `FitResult.config`, which have what training left out, or that is usual.
        hold: What an input of these recordings is between samples, a key of `HOLDS`; as in `dataset`, if absent.

    Returns:
        Of each recording the spans, begin and end in its own time [s]. None where there is no telling: of models
        without M, V, g and D on velocities, of momenta, of recordings shorter than a window, of windows 2.5 times
        longer or shorter than in training, of coordinates that hardly move there. None either where more than a
        quarter of a recording is so, and more than one short event makes: it is another machine, or load.

    Raises:
        ValueError: If there is no such `hold`.
        DataError: If the recordings have other coordinates or inputs than `dataset`, and as `hold_out` does.

    Example:
        >>> import dataclasses
        >>> import numpy as np
        >>> from symoden import Dataset, Trajectory
        >>> from symoden.systems import Pendulum
        >>> ts, pace = np.linspace(0.0, 9.99, 1000), np.sqrt(15.0)
        >>> q, v = 0.01 * np.cos(pace * ts), -0.01 * pace * np.sin(pace * ts)
        >>> swing = Trajectory(name="swing", ts=ts, q=q[:, None], rates=v[:, None], us=np.zeros((1000, 1)))
        >>> knocked = dataclasses.replace(swing, rates=swing.rates + 0.5 * (ts == ts[500])[:, None])
        >>> none, (span,) = find_disturbances(
        ...     Pendulum(), [swing, knocked], Dataset(name="swings", space="T1", train=(swing,))
        ... )
        >>> none, bool(span[0] < ts[500] < span[1])
        ((), True)
    """
    config = TrainingConfig() if config is None else config
    hold = dataset.hold if hold is None else hold
    if hold not in HOLDS:
        raise ValueError(f"`hold` must be one of {', '.join(HOLDS)}; got {hold!r}.")
    recordings = tuple(map(without_poor_ends, recordings))
    _refuse_others(recordings, dataset)
    none = tuple(() for _ in recordings)
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        if not has_weak_form(model):
            return none
        held = hold_out(dataset, config)
        data = regression_data(held, model, config)
        if data is None:
            return none
        usual = _Usual.of(model, data, (*held.train, *held.validation)).elsewhere(data, HOLDS[hold])
        looked = [usual.look(each) for each in recordings]
    return tuple(each.spans if each.is_momentary else () for each in looked)


def _refuse_others(recordings: Sequence[Trajectory], dataset: Dataset) -> None:
    """Refuse recordings of another mechanism."""
    wanted = Space.parse(dataset.space).size, dataset.inputs
    for each in recordings:
        if (got := (each.q.shape[1], each.us.shape[1])) != wanted:
            raise DataError(
                f"`{each.name}` must have coordinates and inputs as `{dataset.name}`, {wanted[0]} and {wanted[1]}; got "
                f"{got[0]} and {got[1]}. Choose recordings of the same mechanism."
            )


def disturbed_spans(
    model: AbstractDynamics,
    data: Data,
    recordings: Sequence[Trajectory],
    left_out: Sequence[Span] = (),
    *,
    bent: bool = False,
) -> list[Span]:
    """Find where recordings that a model was fitted to move far otherwise than it says, for a moment.

    Where that is so often, the model is at fault, and nothing is found.

    Args:
        model: The model.
        data: Windows of the weak form, for what is usual.
        recordings: Where to look.
        left_out: Where not to: spans of them.
        bent: Whether it was fitted without as many windows as may be disturbed, for these had bent it. Of a recording
            of which that is much of it nothing is found: it is another machine, or load.

    Returns:
        Spans of the recordings that are disturbed, by name and in their own time [s].
    """
    usual = _Usual.of(model, data, recordings)
    looked = [usual.look(each, left_out=left_out) for each in recordings]
    if bent:
        looked = [each if each.is_momentary else each._replace(spans=(), disturbed=0) for each in looked]
    if sum(each.disturbed for each in looked) > (_TRIMMED if bent else _SELDOM) * sum(each.windows for each in looked):
        return []
    return [
        (whole_name(recording.name), *span)
        for recording, each in zip(recordings, looked, strict=True)
        for span in each.spans
    ]


class _Looked(NamedTuple):
    """What was found in a recording: spans, and how many of its windows are disturbed."""

    spans: tuple[tuple[float, float], ...] = ()
    disturbed: int = 0
    windows: int = 0

    @property
    def is_momentary(self) -> bool:
        """Whether they are not much of the recording, or no more than one short event makes."""
        return self.disturbed <= max(_EVENT, _OFTEN * self.windows)


@dataclass(frozen=True, eq=False)
class _Usual:
    """What a model usually leaves unexplained of its recordings.

    By the equations of motion in weak form, from the states that were measured along a short window: a rollout that
    goes astray tells nothing of when it began to. A window is disturbed if far more of a coordinate's change of
    velocity is unexplained than is usual where it moves, and much.
    """

    model: AbstractDynamics
    objective: AbstractObjective
    horizon: int
    bound: Float[np.ndarray, " n"]
    lengths: tuple[float, float] = (0.0, math.inf)

    @classmethod
    def of(cls, model: AbstractDynamics, data: Data, recordings: Sequence[Trajectory]) -> "_Usual":
        """By windows of recordings, of which the motion of joints that rest is told apart from noise."""
        model = cast(model, data.train.q.dtype)
        bound = _bound(_residuals(model, data.objective, data.train), data, least_motion(recordings))
        return cls(model, data.objective, data.train.ts.shape[1] - 1, bound)

    def elsewhere(self, data: Data, hold: Hold) -> "_Usual":
        """The same for recordings that have another `hold`, and maybe gaps or another rate."""
        usual = float(np.median(np.ptp(np.asarray(data.train.ts), axis=1)))
        objective = WeakForm(data.objective.weights, hold)
        return dataclasses.replace(self, objective=objective, lengths=(usual / _ALIKE, usual * _ALIKE))

    def look(self, recording: Trajectory, left_out: Sequence[Span] = ()) -> _Looked:
        """Look at a recording, but not at spans of it."""
        if len(recording) <= self.horizon:
            return _Looked()
        stride = max(1, self.horizon // _STRIDES)
        every = windows([recording], self.horizon, stride=stride)
        starts = np.arange(len(every)) * stride
        lengths = recording.ts[starts + self.horizon] - recording.ts[starts]
        unlike = (lengths < self.lengths[0]) | (lengths > self.lengths[1])
        known = unlike | _have_holes(recording, starts, self.horizon)
        known |= _overlaps(recording, starts, self.horizon, left_out)
        residuals = _residuals(self.model, self.objective, Batch.of(every, np.float64))
        far = (np.abs(residuals) > self.bound).any(axis=1) & ~known
        spans = tuple(_spans(recording, starts[far], self.horizon))
        return _Looked(spans, int(np.sum(far)), int(np.sum(~known)))


def _residuals(model: AbstractDynamics, objective: AbstractObjective, batch: Batch) -> Float[np.ndarray, "B n"]:
    """What is left of each coordinate's change of velocity in windows, relative."""
    return np.asarray(evaluate_residuals(model, objective, batch))[:, 0]


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


def _have_holes(recording: Trajectory, starts: np.ndarray, horizon: int) -> Bool[np.ndarray, " B"]:
    """Which windows of a recording lack rows, fewer than make a gap."""
    steps = np.diff(recording.ts)
    before = np.concatenate([[0], np.cumsum(steps > _HOLE * usual_step(steps))])
    return before[starts + horizon] > before[starts]


def _overlaps(recording: Trajectory, starts: np.ndarray, horizon: int, spans: Sequence[Span]) -> Bool[np.ndarray, " B"]:
    """Which windows of a recording have something of spans."""
    first, last = recording.ts[starts], recording.ts[starts + horizon]
    name_of = whole_name(recording.name)
    inside = [(first <= end) & (last >= start) for name, start, end in spans if name == name_of]
    return np.any([np.zeros(len(starts), bool), *inside], axis=0)


def _spans(recording: Trajectory, starts: np.ndarray, horizon: int) -> Iterator[tuple[float, float]]:
    """Spans that hold what disturbs windows: from the middle of the first one in a row to that of the last, and more.

    Yields:
        One for each row of windows that follow each other.
    """
    for row in np.split(starts, np.flatnonzero(np.diff(starts) > horizon) + 1):
        if len(row):
            # Under a bump, what is at its ends hardly counts.
            first, last = row[0] + horizon // 4, row[-1] + horizon - horizon // 4
            yield float(recording.ts[first]), float(recording.ts[last])
