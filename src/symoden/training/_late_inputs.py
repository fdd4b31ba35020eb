"""Inputs that act later than the log says, as those of motors, propellers, valves and networks do."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Float

from symoden.blocks import kinds_in_use
from symoden.data import Dataset, Trajectory
from symoden.data.signals import delay_inputs, lag_inputs, settling
from symoden.mechanics import AbstractDynamics

from ._data import levenberg_data
from ._lateness import Key, Lateness
from ._left_out import Contender
from ._level import LEAST_WINDOWS
from ._levenberg_stage import LevenbergStage
from ._relevance import Relevance
from ._stages import EXPLAINED, AbstractStage, Clock, never
from ._state import Report, TrainingState
from ._verdicts import CLEAR, Skipped, standard_errors, window_losses

_LEAST: Final = 1 / 32  # Of a window: what is sooner over hardly shows in one.
_LONGEST: Final = 1 / 2  # Of a window.
_STEPS: Final = 12  # Of each fit.
_NEAR: Final = 1.5  # Factor within which the best one is looked for.
_CLOSER: Final = 3  # Fits, each where the parabola through three before is lowest,
_CLOSE: Final = 0.02  # unless that is relatively so near to the best one before.
_WORST: Final = 100.0  # Times the least loss: one that is larger, or infinite, tells a parabola no more.
_LESS: Final = 0.7  # Share of the loss that is left: 0.01 to 0.5 where inputs are late, 0.9 and more where none are.
_UNLIKE: Final = 0.8  # Share of that of one time for all inputs, which one for each of them must leave.
_ROUNDS: Final = 2  # Of looking for the time of each input.


class _Late(NamedTuple):
    """What is left with inputs that act so late.

    Attributes:
        seconds: How late each of them acts [s].
        model: The model, fitted to that.
        losses: Of every window.
    """

    seconds: tuple[float, ...]
    model: AbstractDynamics
    losses: Float[np.ndarray, " W"]

    @property
    def loss(self) -> float:
        """Their mean."""
        return float(np.mean(self.losses))


_Refit: TypeAlias = Callable[[AbstractDynamics, tuple[float, ...]], _Late]
"""Fits a model again, with inputs that act so late."""


@final
@dataclass(frozen=True)
class LateInputs(AbstractStage):
    """Says whether inputs act late, by a lag of first order or a delay; the model stays as it is.

    What acts late and is taken for what acts at once bends all that is learned afterwards: friction's laws and V take
    up what they can of it. So it is asked of a model that is still simple. That is fitted again, with longer and longer
    lags, each from the fit before, as long as its errors fall. Regressions of accelerations do not tell lags, nor does
    a model that is bent already (`benchmarks/`).

    Attributes:
        dataset: Recordings, with their validation part.
        levenberg: The stage that found the model.
        laws: Friction's laws, as flags, if they can be set free.
        name: What reports call it.
        steps: One stride, which asks now and then whether the time is over.
    """

    dataset: Dataset
    levenberg: LevenbergStage
    laws: int = 0
    name: str = "late inputs"
    steps: int = 1

    def applies(self, state: TrainingState) -> bool:
        """Whether there is something to explain."""
        return bool(EXPLAINED <= state.best_loss < np.inf)

    def start(self, state: TrainingState) -> TrainingState:
        """The state of the stage before; where there was none, one of the same structure."""
        return state._replace(step=0) if isinstance(state.memory, Relevance) else self.levenberg.start(state)

    def advance(self, state: TrainingState, is_over: Clock = never) -> tuple[TrainingState, Report]:
        """Ask."""
        at_once = self._refitted(state, is_over, "input_lag", state.best, self._none)
        verdict = self._asked(at_once, functools.partial(self._refitted, state, is_over))
        return state._replace(step=1), Report(at_once.loss, None, finished=True, verdict=verdict)

    def settled(self, state: TrainingState) -> tuple[TrainingState, None]:
        """As it is."""
        return state, None

    @property
    def _none(self) -> tuple[float, ...]:
        """Inputs that act at once."""
        return (0.0,) * self.dataset.inputs

    def _asked(self, at_once: _Late, refit: Callable[..., _Late]) -> Lateness | Skipped:
        """What lags and delays would leave of the errors."""
        if len(at_once.losses) < LEAST_WINDOWS:
            return Skipped("too few windows to tell")
        if not 0 < at_once.loss < np.inf:
            return Skipped("its loss tells nothing")
        lagging, delayed = (functools.partial(refit, key) for key in ("input_lag", "input_delay"))
        lag = self._followed(at_once, lagging)
        if not (lateness := _told("input_lag", lag, at_once)).found:
            return lateness
        delay = self._followed(at_once, delayed)
        # Dry friction, too, makes a simple model late, and blurs which of both it is.
        lagging, delayed = (functools.partial(each, freed=self.laws) for each in (lagging, delayed))
        lag, delay = _refined(lag, lagging), _refined(delay, delayed)
        starts = at_once.model, min(lag, delay, key=_loss).model  # More steps alone are no gain.
        at_once = min((lagging(each, self._none) for each in starts), key=_loss)
        apart = varying(self.dataset)
        if lag.loss <= delay.loss:
            found, other = _told("input_lag", _each_apart(lag, lagging, apart), at_once), delay
        else:
            found, other = _told("input_delay", _each_apart(delay, delayed, apart), at_once), lag
        return found._replace(other=(other.seconds[0], other.loss))

    def _followed(self, at_once: _Late, refit: _Refit) -> _Late:
        """The time that leaves least, the same for all inputs, each twice as long as the one before."""
        spans = np.asarray(self.levenberg.data.train.ts)[:, [0, -1]]
        window = float(np.median(spans[:, 1] - spans[:, 0]))
        best, late, seconds = at_once, at_once, _LEAST * window
        while best is late and seconds <= _LONGEST * window:
            late = refit(best.model, (seconds,) * self.dataset.inputs)
            best = late if late.loss < best.loss or best is at_once else best
            seconds *= 2
        return best

    def _refitted(
        self,
        state: TrainingState,
        is_over: Clock,
        key: Key,
        model: AbstractDynamics,
        seconds: tuple[float, ...],
        *,
        freed: int = 0,
    ) -> _Late:
        """The model fitted to inputs that act so late."""
        data, config = self.levenberg.data, self.levenberg.config
        if any(seconds):  # Of validation recordings it may not be known what acted before.
            train = tuple(_acting(each, key, seconds, self.dataset.hold) for each in self.dataset.train)
            data = levenberg_data(dataclasses.replace(self.dataset, train=train), model, config)
        step = functools.partial(
            self.levenberg.step, substeps=state.substeps, weighing=state.weighing, priors=state.memory
        )
        steps = config.growth_steps if freed else _STEPS
        contender = Contender(model, kinds_in_use(model) | freed, step, steps, config.damping)
        fitted = contender.refitted(data.train, is_over)
        objective = self.levenberg.objective(state.substeps, state.weighing)
        return _Late(seconds, fitted, window_losses(fitted, objective, data.train))


def varying(dataset: Dataset) -> list[int]:
    """Inputs that change while something is recorded: nothing tells when others act.

    Args:
        dataset: Recordings.

    Returns:
        Their indices.
    """
    return [i for i in range(dataset.inputs) if any(np.ptp(each.us[:, i]) > 0 for each in dataset.train)]


def _acting(recording: Trajectory, key: Key, seconds: tuple[float, ...], hold: Literal["zero", "linear"]) -> Trajectory:
    """The recording of what acts, as if its first inputs had acted for long before: windows stay where they were."""
    before = 1.01 * (settling(seconds) if key == "input_lag" else max(seconds))
    first_twice = np.maximum(np.arange(-1, len(recording)), 0)
    longer = dataclasses.replace(
        recording,
        ts=np.append(recording.ts[0] - before, recording.ts),
        q=recording.q[first_twice],
        rates=recording.rates[first_twice],
        us=recording.us[first_twice],
    )
    late = {"input_lag": lag_inputs, "input_delay": delay_inputs}[key](longer, seconds, hold=hold)
    return dataclasses.replace(recording, us=late.us[-len(recording) :])  # Of inputs that are zero nothing is cut.


def _refined(about: _Late, refit: _Refit, which: Sequence[int] = ()) -> _Late:
    """The time that leaves least, from one that is right to a factor of two.

    Args:
        about: What that leaves.
        refit: Fits a model again.
        which: Inputs whose times are looked for; all, if none are given. They have the same.

    Returns:
        What it leaves.

    References:
        Brent (1973), *Algorithms for minimization without derivatives*, chapter 5: successive parabolic interpolation.
    """
    which = which or range(len(about.seconds))

    def at(seconds: float, model: AbstractDynamics) -> _Late:
        return refit(model, tuple(seconds if i in which else each for i, each in enumerate(about.seconds)))

    def of(late: _Late) -> float:
        return late.seconds[which[0]]

    tried = [at(of(about) * factor, about.model) for factor in (1 / _NEAR, 1.0, _NEAR)]
    for _ in range(_CLOSER):
        best = min(range(len(tried)), key=lambda k: tried[k].loss)
        if 0 < best < len(tried) - 1:
            near = tried[best - 1 : best + 2]
            seconds = _lowest([of(each) for each in near], [each.loss for each in near])
            if abs(seconds / of(tried[best]) - 1) < _CLOSE:
                break
        else:
            seconds = of(tried[best]) * (_NEAR if best else 1 / _NEAR)
        tried.append(at(seconds, tried[best].model))
        tried.sort(key=of)
    return min(tried, key=_loss)


def _each_apart(same: _Late, refit: _Refit, which: Sequence[int]) -> _Late:
    """The time of each input in turn, where that leaves much less than the same for all."""
    best = same
    for _ in range(_ROUNDS if len(which) > 1 else 0):
        before = best
        for i in which:
            if best.seconds[i]:
                none = refit(best.model, tuple(0.0 if k == i else each for k, each in enumerate(best.seconds)))
                best = min(none, _refined(best, refit, (i,)), best, key=_loss)
        if best.loss > _UNLIKE * before.loss:
            break
    return best if best.loss < _UNLIKE * same.loss else same


def _loss(late: _Late) -> float:
    """What is left."""
    return late.loss


def _lowest(seconds: list[float], losses: list[float]) -> float:
    """Where the parabola through the logarithms of three losses is lowest, the second of which is the least."""
    logs = np.log(np.fmax(np.finfo(float).tiny, np.fmin(losses, _WORST * losses[1])))
    bend, slope, _ = np.polyfit(np.subtract(seconds, seconds[1]), logs, 2)
    return seconds[1] - slope / (2 * bend) if bend > 0 else seconds[1]


def _told(key: Key, late: _Late, at_once: _Late) -> Lateness:
    """What is to be said of inputs that act late, beside those that act at once."""
    gained = -standard_errors(late.losses, at_once.losses)
    clear = gained > CLEAR and late.loss < _LESS * at_once.loss
    return Lateness(key, late.seconds, late.loss, at_once.loss, len(late.losses), gained, found=bool(clear))
