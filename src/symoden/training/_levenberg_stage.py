"""Levenberg-Marquardt as a stage of training."""

import functools
import math
from dataclasses import dataclass, replace
from typing import Final, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.blocks import FRICTION, count_parameters, kinds_in_use
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics

from ._beginnings import AbstractBeginning, Best
from ._config import TrainingConfig
from ._data import Data
from ._flatten import Flattening, cast, drawn
from ._left_out import Contender, by_left_out
from ._level import expected_level, weigh
from ._levenberg_marquardt import LevenbergState, LevenbergStep, Prior, levenberg_marquardt_step
from ._objective import AbstractObjective, Batch
from ._relevance import Relevance, free_scale, remembered
from ._residuals import evaluate_loss, integration_error
from ._stages import EXACT, EXPLAINED, AbstractStage, Clock, never
from ._state import Report, TrainingState
from ._verdicts import FOUND, LOST, Skipped, Verdict, by_price, by_rollouts, by_validation
from ._weak_form import WeakForm
from ._weighing import Errors, Weighing

_STALLED: Final = 1e-3  # Relative decrease of the loss in a step that counts as none.
_MOST_SUBSTEPS: Final = 16
_STATES: Final = 64  # Of those that windows start from: where the scale of the inertia is looked at.
_FALLING: Final = 0.02  # One that is more than noise that is fitted, or loss that is given for evidence and back.
_EVIDENT: Final = 1.0  # Gain of the evidence's logarithm that is worth a mention (Kass & Raftery, 1995, Bayes factors).


@final
@dataclass(frozen=True)
class LevenbergStage(AbstractStage):
    """Levenberg-Marquardt in double precision: reaches the bottom.

    Integration is refined as the errors fall: where its own error is no longer small beside the residuals, the number
    of RK4 steps in a sampling interval doubles.

    Attributes:
        data: Windows that hardly overlap, in double precision.
        config: Settings.
        name: What reports call it.
        steps: Largest number of steps.
        corrections: Which kinds of corrections are free, as flags. Those that a stage before has set free and kept are
            free in any case.
        margin: What comes of the stage is kept if it is better than what was before by more than so many standard
            errors of the difference in validation; below zero, unless it is worse by that many. Such a stage is
            skipped where nothing is left to explain. None keeps the best model.
        errors: What errors count in its steps; what judges it counts all alike, as predictions do.
        learns: Learn the priors too, from narrow ones on for corrections that were not kept before. Else they fade with
            the loss.
        widens: Priors are as wide as at first.
        frees: It sets something free: nothing is done where that is free already, and steps go on as long as they fit
            the data clearly better, unless validation says that all is lost.
        unless: Kinds of corrections, as flags; where one of them is free the stage has nothing to do.
        begins: What it begins with, and has to improve on.
        plain: The largest number of steps before priors are learned.
        rollouts: Windows on which the best model has found no basin, as far as a scaled loss tells: else the stage has
            nothing to do. What comes of it is kept if rollouts there are better.
        after: Only where the best model comes from this stage or a later one, by their indices.
        rivals: What it makes is not kept, but what the next one must improve on: the best model knows what judges it.
    """

    data: Data
    config: TrainingConfig
    name: str
    steps: int
    corrections: int = 0
    margin: float | None = None
    errors: Errors = Errors.ALIKE
    learns: bool = False
    widens: bool = False
    frees: bool = False
    unless: int = 0
    begins: AbstractBeginning = Best()  # noqa: RUF009 - it is frozen
    plain: int = 0
    rollouts: Data | None = None
    after: int = 0
    rivals: bool = False

    def applies(self, state: TrainingState) -> bool:
        """Whether the stages before have left the stage something to do."""
        free = self._free(state.best, state.best)
        hindered = state.origin < self.after or self.unless & kinds_in_use(state.best)
        if hindered or not count_parameters(state.best, corrections=free) or not self.begins.applies(state):
            return False
        if self.margin is not None and not self.begins.untrained and not math.isfinite(state.best_loss):
            return False  # There is nothing to improve on, nor to judge by.
        if self.rollouts is not None:
            return state.best_loss >= FOUND
        return not (self.begins.untrained and self._needless(state))

    def anew(self, fresh: AbstractDynamics) -> "LevenbergStage":
        """The same where it begins with the best model; else from another draw of weights."""
        return replace(self, begins=self.begins.anew(fresh))

    def start(self, state: TrainingState) -> TrainingState:
        """Begin from the best model so far, in double precision."""
        dtype = self.data.train.q.dtype
        best = cast(self.begins.model(state, lambda each: self._loss(each, state.substeps, self.data.choosing)), dtype)
        weighing = Weighing.alike(best.space, state.weighing)
        loss = state.best_loss
        explained = self.margin is not None and self._is_below(EXPLAINED, loss)
        if explained or self.begins.rivalled:  # In these windows, too?
            held = cast(state.best, dtype) if self.begins.closes else best
            loss = evaluate_loss(held, self.objective(state.substeps, weighing), self.data.choosing)
        if not self._needless(state._replace(best_loss=loss)):
            weighing, loss = self._weighed(best, state)
        fresh = Relevance.start(best, self.config.prior)
        priors = fresh if self.widens else remembered(self.begins.memory(state), fresh)
        priors = priors.opened(self.config.prior) if self.margin is None else priors
        if self.learns:  # Beside the residuals of these windows.
            kept = self._free(best, state.best) if self.begins.untrained else kinds_in_use(best)
            priors = priors.forgotten().narrowed(best, kept, self.corrections)
        priors = self.begins.priors(priors)
        incumbent = self.begins.incumbent(state)
        before, rival = cast(incumbent.model, dtype), cast(incumbent.rival, dtype)
        return state._replace(
            step=0,
            model=best,
            weighing=weighing,
            best=best,
            incumbent=incumbent._replace(model=before, memory=remembered(incumbent.memory, fresh), rival=rival),
            best_loss=loss,
            origin=state.stage,
            memory=priors,
            damping=self.config.damping,
            stale=0,
        )

    def advance(self, state: TrainingState, is_over: Clock = never) -> tuple[TrainingState, Report]:
        """Take one step."""
        if state.step == 0 and (why := self._needless(state) or self._nothing_new(state)):
            state = self._undone(state)
            loss = state.best_loss
            return state, Report(loss, loss, finished=True, outcome=why, verdict=Skipped(why))
        substeps = self._refined(state)
        objective = self.objective(substeps, state.weighing)
        if substeps != state.substeps:  # What was best may have fitted the errors of integration.
            state = state._replace(best_loss=evaluate_loss(state.best, objective, self.data.choosing))
            state = state._replace(memory=state.memory.unrecorded(), stale=0) if self.learns else state
        restore, theta = self._flattened(state.model, state.incumbent.model)
        before = LevenbergState(theta, state.damping)
        mean = drawn(state.incumbent.model, restore.corrections) if self.frees else 0.0
        after, step = self.step(
            before, restore, self.data.train, substeps=substeps, weighing=state.weighing, priors=state.memory, mean=mean
        )
        model = restore(after.theta)
        validation = self.data.validation_loss(model, objective)
        judged = step.after if validation is None or self.data.in_turn else validation
        state = state._replace(step=state.step + 1, model=model, damping=after.damping, substeps=substeps)
        if self.learns and state.step > self.plain:
            state = self._learned(state, step, np.asarray(theta, float), restore.corrections)
        else:
            state = self._chosen(state, step, judged)
        ended, outcome = self._ended(state)
        state, verdict = self._concluded(self._last(state), is_over) if ended else (state, None)
        return state, Report(step.after, validation, ended, outcome, verdict)

    def settled(self, state: TrainingState) -> tuple[TrainingState, Verdict | None]:
        """With what came of it so far, the priors as they are by now, if that is to be kept."""
        # What some recordings alone have made, or nothing has, or what many refits would have to judge.
        if not state.step or self.begins.rivalled or self._refits:
            return self._undone(state), None
        return self._concluded(self._last(state))

    def rated(self, state: TrainingState) -> TrainingState:
        """The last state of another stage, with its best model's loss here and integration as fine as it needs."""
        weighing = Weighing.alike(state.best.space)
        state = state._replace(model=cast(state.best, self.data.train.q.dtype), weighing=weighing)
        while (finer := self._refined(state)) != state.substeps:
            state = state._replace(substeps=finer)
        return state._replace(best_loss=self._loss(state.model, state.substeps, self.data.held_out))

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
            restore: Makes the model from flat parameters, those that this stage sets free.
            batch: Windows to fit.
            substeps: RK4 steps in each sampling interval.
            weighing: What errors count.
            priors: Priors of the parameters.
            mean: Their mean.

        Returns:
            The state after the step, and what the step did.
        """
        model = restore(state.theta)
        pin = free_scale(model, restore, state.theta, self.data.train.q[:_STATES, 0]) if self.learns else None
        prior = Prior(
            priors.precisions(model, restore.corrections),
            mean,
            float(priors.variance) or None if self.learns else None,
            float(weighing.effect),
        )
        objective = self.objective(substeps, weighing)
        with np.errstate(over="ignore", invalid="ignore"):  # Where rollouts diverge; no such step is accepted.
            return levenberg_marquardt_step(state, restore, objective, batch, prior=prior, pin=pin)

    def gains(self, step: LevenbergStep, judged: float, least: float) -> bool:
        """Whether a step is a reason to take more of them.

        Args:
            step: What it did.
            judged: Loss of its model by which models are chosen.
            least: That of the best one so far.

        Returns:
            Whether it is.
        """
        if self.rivals:  # Validation was fitted to before.
            return step.falls_by(_FALLING)
        # A network takes a dozen steps to find its shape, in which validation goes up and down.
        lost = judged > LOST * least
        return (judged < least and step.falls_by(_STALLED)) or (self.frees and not lost and step.falls_by(_FALLING))

    def _weighed(self, best: AbstractDynamics, state: TrainingState) -> tuple[Weighing, float]:
        """What the errors of the model count that the stage begins with; and its loss."""
        kept = kinds_in_use(best)
        kept = kept if count_parameters(best, corrections=kept) else self.corrections
        # The level by what is free already: what the stage sets free has fitted nothing yet.
        restore, theta = Flattening.of(best, corrections=kept, dtype=self.data.train.q.dtype)
        where = self.data.objective, RK4(jnp.asarray(state.substeps)), self.data.train
        level = expected_level(restore, theta, *where)
        weighing = Weighing.alike(best.space, state.weighing)._replace(level=jnp.asarray(level, float))
        loss = evaluate_loss(best, self.objective(state.substeps, weighing), self.data.choosing)
        found = self.errors is Errors.AS_FOUND and not state.weighing.refused
        if (found or self.errors is Errors.WHITENED) and not self._is_below(EXPLAINED, loss):
            weighing = weigh(*self._flattened(best, state.best), *where, weighing)
            loss = evaluate_loss(best, self.objective(state.substeps, weighing), self.data.choosing)
        return weighing, loss

    def _flattened(self, model: AbstractDynamics, before: AbstractDynamics) -> tuple[Flattening, Float[Array, " P"]]:
        """What is free of a model; if it began anew, also what was free of the best one before."""
        return Flattening.of(model, corrections=self._free(model, before), dtype=self.data.train.q.dtype)

    def _free(self, model: AbstractDynamics, before: AbstractDynamics) -> int:
        """Which kinds of corrections that are, as flags."""
        return self.corrections | self.begins.free(model, before)

    def _loss(self, model: AbstractDynamics, substeps: int, windows: Batch) -> float:
        """Loss on windows, all errors counting alike."""
        model = cast(model, self.data.train.q.dtype)
        return evaluate_loss(model, self.objective(substeps, Weighing.alike(model.space)), windows)

    def _needless(self, state: TrainingState) -> str:
        """Why the stage has nothing to do, if so."""
        if self.margin is not None and self._is_below(EXPLAINED, state.best_loss):
            return "nothing left to explain"
        if self.frees and not self.begins.leaner and not self.corrections & ~kinds_in_use(state.best):
            return "free already"
        if self.begins.rivalled and self.config.scaled_loss and not state.best_loss < FOUND:
            return "what half of the recordings taught does not predict the others, which were to judge"
        return ""

    def _chosen(self, state: TrainingState, step: LevenbergStep, judged: float) -> TrainingState:
        """Keep the better one of the model now and the best so far; priors are learned from that one on."""
        least = state.best_loss
        state = state._replace(stale=0 if self.gains(step, judged, least) else state.stale + 1)
        state = state._replace(best=state.model, best_loss=judged) if judged < least else state
        if self.learns and (state.stale >= self.config.patience or state.step == self.plain):
            return state._replace(step=self.plain, model=state.best, damping=self.config.damping, stale=0)
        return state

    def _last(self, state: TrainingState) -> TrainingState:
        """What came of the steps: where priors are learned their last model, else the best one."""
        if not self.learns:
            return state
        loss = evaluate_loss(state.model, self.objective(state.substeps, state.weighing), self.data.choosing)
        return state._replace(best=state.model, best_loss=loss)

    def _nothing_new(self, state: TrainingState) -> str:
        """Why there is nothing new in the errors that are to be whitened, if so."""
        alike = self.errors is Errors.WHITENED and not state.weighing.is_whitened
        return "errors are independent, or too few" if alike else ""

    def _learned(
        self, state: TrainingState, step: LevenbergStep, theta: Float[np.ndarray, " P"], corrections: int
    ) -> TrainingState:
        """Learn the priors from a step from θ; it has gained something if the evidence or the fit says so."""
        record = state.memory.evidence
        priors = state.memory.learn(step.equations, theta, state.model, corrections)
        evident = bool(priors.evidence > record + _EVIDENT)
        priors = priors if evident else priors._replace(evidence=record)
        return state._replace(memory=priors, stale=0 if evident or step.falls_by(_FALLING) else state.stale + 1)

    def _concluded(self, state: TrainingState, is_over: Clock = never) -> tuple[TrainingState, Verdict | None]:
        """State at the end of the stage, with what came of it or as it was before; and the verdict."""
        if self.rivals:
            undone = self._undone(state)
            return undone._replace(incumbent=undone.incumbent._replace(rival=state.model)), None
        verdict = self._judged(state, is_over)
        return state if verdict is None or verdict.kept else self._undone(state), verdict

    @property
    def _refits(self) -> bool:
        """Whether windows left out in turn judge: without anything new, both would be fitted to the same end."""
        return self.data.in_turn and (self.frees or self.learns or self.begins.closes)

    def _judged(self, state: TrainingState, is_over: Clock) -> Verdict | None:
        """The verdict on what came of the stage, if it has to gain something, and there is something to judge by."""
        best, before = state.best, state.incumbent.rival
        if self.rollouts is not None:
            return by_rollouts(self.rollouts, best, before)
        if self.margin is None or self.data.validation is None:
            return None
        plain = state._replace(weighing=state.weighing.unwhitened())
        objective = self.objective(state.substeps, plain.weighing)
        if self.begins.closes and (dear := by_price(self.data, best, before, objective, wanted=self.margin)):
            return dear
        if self._refits:
            ours = self._contender(state, best, self._free(best, before), state.memory)
            rival = plain if self.errors is Errors.WHITENED else state
            theirs = self._contender(rival, before, kinds_in_use(before), state.incumbent.memory)
            verdict = by_left_out(self.data, ours, theirs, objective, wanted=self.margin, is_over=is_over)
        else:
            verdict = by_validation(self.data, best, before, objective, last=state.model, wanted=self.margin)
        if self.begins.leaner:
            ours, theirs = (evaluate_loss(each, objective, self.data.train) for each in (best, before))
            verdict = verdict._replace(fitted=(ours, theirs))
        freed_too = self.learns and FRICTION & kinds_in_use(best) & ~kinds_in_use(state.incumbent.model)
        return verdict._replace(frees_friction=bool(freed_too), closes=self.begins.closes)

    def _contender(
        self, state: TrainingState, model: AbstractDynamics, corrections: int, priors: Relevance
    ) -> Contender:
        """A model that can be fitted to other windows."""
        step = functools.partial(self.step, substeps=state.substeps, weighing=state.weighing, priors=priors)
        return Contender(model, corrections, step, self.steps, self.config.damping)

    def _undone(self, state: TrainingState) -> TrainingState:
        """State with the best model from before the stage."""
        best, memory, origin, weighing, _ = state.incumbent
        weighing = weighing.refusing() if state.step and self.errors is Errors.WHITENED else weighing
        loss = evaluate_loss(best, self.objective(state.substeps, state.weighing), self.data.choosing)
        return state._replace(best=best, best_loss=loss, memory=memory, origin=origin, weighing=weighing)

    def _ended(self, state: TrainingState) -> tuple[bool, str]:
        """Whether the stage is over, and why."""
        # More need not be set free long before a model is exact.
        if self._is_below(EXACT if self.margin is None else EXPLAINED, state.best_loss):
            return True, "nothing left to explain"
        if state.stale >= self.config.patience:
            return True, "converged"
        return (True, "all steps taken") if state.step >= self.steps else (False, "")

    @property
    def regresses(self) -> bool:
        """Whether nothing is rolled out."""
        return isinstance(self.data.objective, WeakForm)

    def _is_below(self, bound: float, loss: float) -> bool:
        """Whether the loss is below a bound that is relative to the motion, as the loss is only if it is scaled."""
        return self.config.scaled_loss and loss < bound

    def objective(self, substeps: int, weighing: Weighing) -> AbstractObjective:
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
        """Number of RK4 steps that is stable and keeps the integration's error below a tenth of the residuals."""
        if self.config.lm_substeps is not None:
            return self.config.lm_substeps
        if self.regresses or state.substeps >= _MOST_SUBSTEPS:
            return state.substeps
        coarse = self.objective(state.substeps, state.weighing)
        sample = self.data.train.take(slice(None, None, max(1, self.data.train.ts.shape[0] // 64)))
        error = integration_error(state.model, coarse, self.objective(2 * state.substeps, state.weighing), sample)
        loss = evaluate_loss(state.model, coarse, sample)
        fine = math.isfinite(loss) and error <= 0.01 * loss
        return state.substeps if fine else 2 * state.substeps
