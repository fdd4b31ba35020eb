"""Adam as a stage of training."""

import functools
import math
from dataclasses import dataclass, replace
from typing import Final, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from symoden.blocks import kinds_in_use, trainable, without_silent
from symoden.mechanics import AbstractDynamics

from ._adam import MOST_STEPS, Adam, AdamState, Sampler, adam_steps
from ._config import TrainingConfig
from ._data import Data
from ._flatten import Flattening, cast
from ._relevance import Relevance
from ._residuals import evaluate_loss
from ._stages import AbstractStage, Clock, never
from ._state import Incumbent, Report, TrainingState
from ._verdicts import FOUND

_FEW_STEPS: Final = 20  # Where nothing is chosen, as by the paper, whose networks take half a second a step.
DIVERGED: Final = "diverged; the best model before was kept"


@final
@dataclass(frozen=True)
class AdamStage(AbstractStage):
    """Adam in single precision: finds the basin. The best model of the stages before is kept unless this is better.

    Attributes:
        data: Overlapping windows, in the precision to train in.
        config: Settings.
        name: What reports call it.
        steps: Number of steps.
        fresh: The untrained model to start from.
        yields: Do nothing where a stage before has found the basin, as far as a scaled loss tells.
    """

    data: Data
    config: TrainingConfig
    name: str
    steps: int
    fresh: AbstractDynamics
    yields: bool = False

    def anew(self, fresh: AbstractDynamics) -> "AdamStage":
        """The same from another draw of weights."""
        return replace(self, fresh=fresh)

    def start(self, state: TrainingState) -> TrainingState:
        """Begin with fresh weights and an empty memory."""
        dtype = self.data.train.q.dtype
        model = cast(self.fresh, dtype)
        lean = without_silent(model)
        memory = self._optimizer.init(eqx.filter(lean, trainable(lean, corrections=self._kinds)))
        best, loss, known = cast(state.best, dtype), state.best_loss, state.memory
        if isinstance(known, Relevance):  # A regression's loss is no rollout's.
            loss = evaluate_loss(best, self.data.objective, self.data.choosing)
        else:
            known = Relevance.start(best, self.config.prior)
        incumbent = Incumbent(best, known, state.origin, state.weighing, rival=best)
        return state._replace(step=0, model=model, best=best, best_loss=loss, incumbent=incumbent, memory=memory)

    def advance(self, state: TrainingState, is_over: Clock = never) -> tuple[TrainingState, Report]:
        """Take some steps in one compiled call, hundreds where the best of these calls is kept."""
        del is_over
        known = self.yields and self.config.scaled_loss and state.best_loss < FOUND
        if known and state.step == 0:
            state = state._replace(model=state.best, memory=state.incumbent.memory)
            return state, Report(state.best_loss, state.best_loss, finished=True, outcome="found already")
        restore, theta = Flattening.of(state.model, corrections=self._kinds, dtype=self.data.train.q.dtype)
        lean = without_silent(state.model)
        free, fixed = eqx.partition(lean, trainable(lean, corrections=self._kinds))
        steps = min(MOST_STEPS if self.config.keep_best else _FEW_STEPS, self.steps - state.step)
        before = AdamState(free, state.memory, jnp.asarray(state.step))
        after, losses = adam_steps(
            before, fixed, self.data.objective, self._sampler, self._optimizer, jnp.asarray(steps)
        )
        model = restore(Flattening.of(eqx.combine(after.free, fixed), corrections=self._kinds, dtype=theta.dtype)[1])
        validation = self.data.validation_loss(model, self.data.objective)
        state = state._replace(step=state.step + steps, model=model, memory=after.optimizer)
        finite = np.asarray(losses)[np.isfinite(losses)]  # The others were skipped, or not taken.
        loss = float(np.mean(finite)) if finite.size else math.inf
        if not math.isfinite(loss):
            return state._replace(model=state.best), Report(loss, validation, finished=True, outcome=DIVERGED)
        judged = loss if validation is None else validation
        if judged < state.best_loss or not self.config.keep_best:
            state = state._replace(best=model, best_loss=judged, origin=state.stage)
        finished = state.step >= self.steps
        return state, Report(loss, validation, finished=finished, outcome="all steps taken" if finished else "")

    def settled(self, state: TrainingState) -> tuple[TrainingState, None]:
        """As it is."""
        return state, None

    @functools.cached_property
    def _kinds(self) -> int:
        """Corrections that do not begin at zero, and so are trained."""
        return kinds_in_use(self.fresh)

    @functools.cached_property
    def _optimizer(self) -> Adam:
        return Adam.of(self.config, self.data.train.q.dtype)

    @functools.cached_property
    def _sampler(self) -> Sampler:
        windows = self.data.train
        size = min(self.config.batch_size, windows.ts.shape[0])
        return Sampler(windows, jnp.asarray(self.config.seed), size, self.config.shuffle)
