"""The two stages of training, each advancing one state by one checkpointable stride."""

import abc
import functools
import math
from dataclasses import dataclass
from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Float

from symoden.blocks import RUNGS, trainable, without_silent
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics

from ._adam import AdamState, Sampler, adam_steps
from ._config import TrainingConfig
from ._flatten import Flattening, cast
from ._level import expected_level, weigh
from ._levenberg_marquardt import LevenbergState, LevenbergStep, Prior, levenberg_marquardt_step
from ._objective import Batch, Objective
from ._relevance import Relevance, free_scale
from ._residuals import evaluate_loss, evaluate_residuals, integration_error
from ._state import Incumbent, Report, TrainingState
from ._weighing import Weighing

DIVERGED = "diverged; the best model before was kept"

_CHUNK = 200
_MOST_SUBSTEPS = 16
EXPLAINED = 1e-6  # Mean squared residual, relative to the motion, below which no block need grow.
EXACT = 1e-11  # The same below which no measurement could tell the model from the truth.
_STATES = 64  # Of those that windows start from: where the scale of the inertia is looked at.
_SETTLED = 0.003  # Relative change of the number of effective parameters in a step that counts as none.
_CLEAR = 2.0  # Standard errors that decide what is asked last: ask often enough, and chance says yes.
STALLED = 1e-3  # Relative decrease of the loss in a step that counts as none.


class Data(NamedTuple):
    """Windows of one stage and how they are compared.

    Attributes:
        train: Windows to fit.
        validation: Windows to choose by; None to go by the training windows.
        objective: Weights, solver and hold.
    """

    train: Batch
    validation: Batch | None
    objective: Objective

    def validation_loss(self, model: AbstractDynamics, objective: Objective) -> float | None:
        """Loss on the validation windows, if there are any."""
        return None if self.validation is None else evaluate_loss(model, objective, self.validation)

    def compare(self, model: AbstractDynamics, other: AbstractDynamics, objective: Objective) -> float:
        """By how many standard errors the validation loss of a model is above that of another; 0 if that is not known.

        Of two models that the data do not tell apart the simpler one is to be preferred (the rule of one standard error
        of Breiman et al., 1984).

        Returns:
            Mean of the differences, window against window, relative to its standard error.
        """
        if self.validation is None or self.validation.ts.shape[0] == 1:
            return 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            here, there = (
                np.mean(np.asarray(evaluate_residuals(each, objective, self.validation), float) ** 2, axis=(1, 2))
                for each in (model, other)
            )
        if not np.isfinite(here).all():
            return math.inf
        if not np.isfinite(there).all():
            return -math.inf
        error = float(np.std(here - there, ddof=1)) / math.sqrt(len(here))
        return float(np.mean(here - there)) / max(error, float(np.finfo(float).tiny))


class AbstractStage(abc.ABC):
    """One stage of training."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """What reports call it."""

    @property
    @abc.abstractmethod
    def steps(self) -> int:
        """Largest number of steps."""

    @abc.abstractmethod
    def start(self, state: TrainingState) -> TrainingState:
        """State at the beginning of this stage, from the end of the one before."""

    @abc.abstractmethod
    def advance(self, state: TrainingState) -> tuple[TrainingState, Report]:
        """Take one stride."""


@final
@dataclass(frozen=True)
class AdamStage(AbstractStage):
    """Adam in single precision: finds the basin.

    Attributes:
        data: Overlapping windows, in the precision to train in.
        config: Settings.
        fresh: The untrained model to start from.
        optimizer: What updates the parameters. Made once and shared, since JAX recognises a compiled function by the
            identity of the functions it was made from.
        candidate: Which of the restarts this is; the best model of those before is kept if it is better.
    """

    data: Data
    config: TrainingConfig
    fresh: AbstractDynamics
    optimizer: optax.GradientTransformation
    candidate: int = 0

    @property
    def name(self) -> str:
        """What reports call it."""
        return f"adam {self.candidate + 1} of {self.config.restarts}" if self.config.restarts > 1 else "adam"

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.config.adam_steps

    def start(self, state: TrainingState) -> TrainingState:
        """Begin with fresh weights and an empty memory."""
        dtype = self.data.train.q.dtype
        model = cast(self.fresh, dtype)
        lean = without_silent(model)
        memory = self.optimizer.init(eqx.filter(lean, trainable(lean, corrections=0)))
        best = cast(state.best, dtype)
        incumbent = Incumbent(best, None, state.origin, state.weighing)
        return state._replace(step=0, model=model, best=best, incumbent=incumbent, memory=memory)

    def advance(self, state: TrainingState) -> tuple[TrainingState, Report]:
        """Take up to some hundred steps in one compiled call."""
        restore, theta = Flattening.of(state.model, corrections=0, dtype=self.data.train.q.dtype)
        lean = without_silent(state.model)
        free, fixed = eqx.partition(lean, trainable(lean, corrections=0))
        steps = min(_CHUNK, self.steps - state.step)
        before = AdamState(free, state.memory, jnp.asarray(state.step))
        after, losses = adam_steps(before, fixed, self.data.objective, self._sampler, self.optimizer, steps=steps)
        model = restore(Flattening.of(eqx.combine(after.free, fixed), corrections=0, dtype=theta.dtype)[1])
        validation = self.data.validation_loss(model, self.data.objective)
        state = state._replace(step=state.step + steps, model=model, memory=after.optimizer)
        finite = np.asarray(losses)[np.isfinite(losses)]  # The others were skipped.
        loss = float(np.mean(finite)) if finite.size else math.inf
        if not math.isfinite(loss):
            return state._replace(model=state.best), Report(loss, validation, finished=True, outcome=DIVERGED)
        judged = loss if validation is None else validation
        if judged < state.best_loss or not self.config.keep_best:
            state = state._replace(best=model, best_loss=judged, origin=state.stage)
        finished = state.step >= self.steps
        return state, Report(loss, validation, finished=finished, outcome="all steps taken" if finished else "")

    @functools.cached_property
    def _sampler(self) -> Sampler:
        windows = self.data.train
        size = min(self.config.batch_size, windows.ts.shape[0])
        return Sampler(windows, jnp.asarray(self.config.seed), size, self.config.shuffle)


@final
@dataclass(frozen=True)
class LevenbergStage(AbstractStage):
    """Levenberg-Marquardt in double precision: reaches the bottom.

    Integration is refined as the errors fall: where its own error is no longer small beside the residuals, the number
    of RK4 steps in a sampling interval doubles.

    Attributes:
        data: Windows that hardly overlap, in double precision.
        config: Settings.
        corrections: Up to which rung corrections are free: none, those of friction, all. A stage that frees some is
            skipped where nothing is left to explain.
        relevance: Learn the priors too. What comes of it is kept unless validation speaks against it.
        refit: What is free was free before, and priors were learned. Now they fade with the loss.
        longer: These are longer windows than those before; priors are as wide as at first.
    """

    data: Data
    config: TrainingConfig
    corrections: int = 0
    relevance: bool = False
    refit: bool = False
    longer: bool = False

    @property
    def name(self) -> str:
        """What reports call it."""
        if self.longer:
            return "longer windows"
        if self.refit:
            return "refit"
        return "relevance" if self.relevance else ("levenberg-marquardt", "friction", "growth")[self.corrections]

    @property
    def steps(self) -> int:
        """Largest number of steps."""
        if self.relevance:
            return self.config.relevance_steps
        return self.config.growth_steps if self._is_optional else self.config.lm_steps

    def start(self, state: TrainingState) -> TrainingState:
        """Begin from the best model so far, in double precision."""
        best = cast(state.best, self.data.train.q.dtype)
        restore, theta = Flattening.of(best, corrections=self.corrections, dtype=self.data.train.q.dtype)
        solver = RK4(jnp.asarray(state.substeps))
        where = restore, theta, self.data.objective, solver, self.data.train
        weighing = Weighing.plain(self.data.objective.weights.size, expected_level(*where))
        loss = evaluate_loss(best, self.objective(state.substeps, weighing), self._judged)
        # What a block has not learned yet is no noise: it must count in full where friction or networks are set free.
        if (self.relevance or self.refit or self.longer) and not self._is_below(EXPLAINED, loss):
            weighing = weigh(*where, weighing)
            loss = evaluate_loss(best, self.objective(state.substeps, weighing), self._judged)
        # Longer windows tell of parameters that shorter ones do not, and whose priors were narrowed.
        fresh = Relevance.start(best, self.config.prior)
        known = state.memory if isinstance(state.memory, Relevance) else fresh
        priors = fresh if self.longer else known
        return state._replace(
            step=0,
            model=best,
            weighing=weighing,
            best=best,
            incumbent=Incumbent(best, known, state.origin, state.weighing),
            best_loss=loss,
            origin=state.stage,
            memory=priors,
            damping=self.config.damping,
            stale=0,
        )

    def advance(self, state: TrainingState) -> tuple[TrainingState, Report]:
        """Take one step."""
        if state.step == 0 and self._is_optional and self._is_below(EXPLAINED, state.best_loss):
            report = Report(state.best_loss, state.best_loss, finished=True, outcome="nothing left to explain")
            return self._defended(state, kept=False), report
        substeps = self._refined(state)
        objective = self.objective(substeps, state.weighing)
        if substeps != state.substeps:  # What was best may have fitted the errors of integration.
            state = state._replace(best_loss=evaluate_loss(state.best, objective, self._judged))
        restore, theta = Flattening.of(state.model, corrections=self.corrections, dtype=self.data.train.q.dtype)
        before = LevenbergState(theta, state.damping)
        after, step = self.step(
            before, restore, self.data.train, substeps=substeps, weighing=state.weighing, priors=state.memory
        )
        model = restore(after.theta)
        validation = self.data.validation_loss(model, objective)
        judged = step.after if validation is None else validation
        state = state._replace(step=state.step + 1, model=model, damping=after.damping, substeps=substeps)
        if self.relevance:
            state, ended, outcome = self._learned(state, step, np.asarray(theta, float), judged)
            return state, Report(step.after, validation, ended, outcome)
        better = judged < state.best_loss
        falling = step.accepted and step.after < (1 - STALLED) * step.before
        state = state._replace(
            best=model if better else state.best,
            best_loss=judged if better else state.best_loss,
            stale=0 if better and falling else state.stale + 1,
        )
        ended, outcome = self._ended(state)
        if ended and self._is_optional and self.data.validation is not None:
            gain = -self.data.compare(state.best, state.incumbent.model, objective)
            state = self._defended(state, kept=gain > (-self._doubt if self.longer else self._doubt))
        return state, Report(step.after, validation, ended, outcome)

    def step(
        self,
        state: LevenbergState,
        restore: Flattening,
        batch: Batch,
        *,
        substeps: int,
        weighing: Weighing,
        priors: Relevance,
        mean: float | Float[np.ndarray, " P"] = 0.0,
    ) -> tuple[LevenbergState, LevenbergStep]:
        """One step of Levenberg-Marquardt.

        Args:
            state: Where to start.
            restore: Makes the model from flat parameters, those up to this stage's rung.
            batch: Windows to fit.
            substeps: RK4 steps in each sampling interval.
            weighing: What errors count.
            priors: Priors of the parameters.
            mean: Their mean.

        Returns:
            The state after the step, and what the step did.
        """
        model = restore(state.theta)
        pin = free_scale(model, restore, state.theta, self.data.train.q[:_STATES, 0]) if self.relevance else None
        return levenberg_marquardt_step(
            state,
            restore,
            self.objective(substeps, weighing),
            batch,
            prior=Prior(
                priors.precisions(model, self.corrections),
                mean,
                float(priors.variance) or None if self.relevance else None,  # Else it fades with the loss.
                float(weighing.effect),
            ),
            pin=pin,
        )

    def _learned(
        self, state: TrainingState, step: LevenbergStep, theta: Float[np.ndarray, " P"], judged: float
    ) -> tuple[TrainingState, bool, str]:
        """Learn the priors from a step from θ; after the last one, choose between what came of it and what was."""
        at = state.model, self.corrections
        priors = state.memory.learn(step.equations, theta, *at)
        change = math.inf
        if state.memory.variance > 0:
            change = priors.effective(step.equations, *at) / state.memory.effective(step.equations, *at) - 1
        state = state._replace(memory=priors, stale=state.stale + 1 if abs(change) < _SETTLED else 0)
        ended, outcome = self._ended(state)
        if ended:
            objective = self.objective(state.substeps, state.weighing)
            worse = self.data.compare(state.model, state.incumbent.model, objective)
            state = self._defended(state._replace(best=state.model, best_loss=judged), kept=worse <= self._doubt)
        return state, ended, outcome

    def _defended(self, state: TrainingState, *, kept: bool) -> TrainingState:
        """State at the end of the stage: as it is, or as it was before."""
        if kept:
            return state
        best, memory, origin, weighing = state.incumbent
        loss = evaluate_loss(best, self.objective(state.substeps, state.weighing), self._judged)
        return state._replace(best=best, best_loss=loss, memory=memory, origin=origin, weighing=weighing)

    def _ended(self, state: TrainingState) -> tuple[bool, str]:
        """Whether the stage is over, and why."""
        if self._is_below(self._enough, state.best_loss):
            return True, "nothing left to explain"
        if state.stale >= self.config.patience:
            return True, "converged"
        finished = state.step >= self.steps
        return finished, "all steps taken" if finished else ""

    @property
    def _judged(self) -> Batch:
        """Windows that models are chosen by."""
        return self.data.train if self.data.validation is None else self.data.validation

    @property
    def _enough(self) -> float:
        """Loss below which nothing is left to do: more need not be set free long before a model is exact."""
        return EXPLAINED if self._is_optional else EXACT

    @property
    def _is_optional(self) -> bool:
        """Whether there is nothing to do where nothing is left to explain."""
        return bool(self.corrections) or self.relevance or self.refit or self.longer

    @property
    def _doubt(self) -> float:
        """Standard errors of a difference in validation that may be chance."""
        return _CLEAR if self.refit or self.longer or self.corrections == RUNGS else 1.0

    def _is_below(self, bound: float, loss: float) -> bool:
        """Whether the loss is below a bound that is relative to the motion, as the loss is only if it is scaled."""
        return self.config.scaled_loss and loss < bound

    def objective(self, substeps: int, weighing: Weighing) -> Objective:
        """How rollouts are compared with windows.

        Args:
            substeps: RK4 steps in each sampling interval.
            weighing: What errors count.

        Returns:
            The objective.
        """
        # A number of substeps that is an array needs no new compilation when it changes.
        return self.data.objective.refined(RK4(jnp.asarray(substeps)), weighing)

    def _refined(self, state: TrainingState) -> int:
        """Number of RK4 steps that keeps the integration's error below a tenth of the residuals."""
        if self.config.lm_substeps is not None:
            return self.config.lm_substeps
        coarse = self.objective(state.substeps, state.weighing)
        sample = self.data.train.take(slice(None, None, max(1, self.data.train.ts.shape[0] // 64)))
        error = integration_error(state.model, coarse, self.objective(2 * state.substeps, state.weighing), sample)
        loss = evaluate_loss(state.model, coarse, sample)
        fine = math.isfinite(loss) and error <= 0.01 * loss
        finer = not fine and state.substeps < _MOST_SUBSTEPS
        return 2 * state.substeps if finer else state.substeps
