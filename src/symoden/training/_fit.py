"""Fit a model to recordings: Adam finds the basin, Levenberg-Marquardt reaches the bottom."""

import dataclasses
import functools
import hashlib
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np

from symoden.blocks import ACTUATION, INERTIA, NETWORKS, POTENTIAL, kinds_in_use
from symoden.data import Dataset, DataWarning
from symoden.integrate import FEWEST_SUBSTEPS, RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import ModelConfig, save
from symoden.storage import StorageError
from symoden.wording import number, spans_in_words

from ._adam_stage import AdamStage
from ._config import TrainingConfig
from ._ensemble import FEWEST_MEMBERS, Ensemble, Pattern, check_members, train_members
from ._first_guess import as_heavy
from ._flatten import cast
from ._journal import MODEL, Journal
from ._laplace import infer_posterior
from ._levenberg_stage import LevenbergStage
from ._posterior import AbstractPosterior
from ._prepare import Prepared, prepare
from ._run import run
from ._stages import AbstractStage
from ._state import Findings, TrainingState
from ._stopwatch import Progress, Stopwatch, ignore

_ROUNDS: Final = 3  # What is small beside a push is seen once that is left out.
_STATES = 512  # Where V's slope is looked at.
_NOTHING = 1e3  # Loss relative to the motion, beyond which a model predicts nothing.


class TrainingError(RuntimeError):
    """Training came to nothing; the message says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class FitResult:
    """A trained model and how it came about.

    Attributes:
        model: The best model, by its validation loss and its size.
        outcome: How training ended, in words.
        completed: Whether every stage came to its end.
        loss: Its loss on the validation data (on the training data without them) in the longest windows that were, all
            errors counting alike; stages of training count them otherwise, in windows of their own.
        seconds: Time spent [s] by this run and, where it goes on from a checkpoint, by those before it; what these
            spent on members is not counted.
        config: Settings of training, with the spans of recordings that it left out.
        substeps: RK4 steps in a sampling interval that its rollouts need.
        ensemble: Models that were trained like it, if any were asked for.
        verdicts: For every stage that had to gain something whether it is kept, and by what, in words.
        hardly_judged: Those of them that so few windows of validation refused that these hardly tell.
        solver: Integrates rollouts as finely as they need.
    """

    model: AbstractDynamics
    outcome: str
    completed: bool
    loss: float
    seconds: float
    config: TrainingConfig
    substeps: int
    ensemble: Ensemble | None = None
    verdicts: dict[str, str] = field(default_factory=dict)
    hardly_judged: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """What came of training, in a line."""
        members = "" if self.ensemble is None else f", {len(self.ensemble.members)} members"
        return f"FitResult({self.outcome}: loss {number(self.loss)}, {self.seconds:.0f} s{members})"

    @property
    def solver(self) -> RK4:
        """What rollouts of the model are to be integrated by, as the command line does it."""
        return RK4(max(FEWEST_SUBSTEPS, self.substeps))

    def posterior(self, dataset: Dataset) -> AbstractPosterior:
        """What the data leave open about its parameters: by the models that were trained like it, if there are some.

        Args:
            dataset: What it was fitted to.

        Returns:
            The ensemble; without one, Laplace's approximation (`infer_posterior`), which may take a minute.

        Raises:
            ValueError: As `infer_posterior` does, such as of too few windows.
        """
        if self.ensemble is not None and len(self.ensemble.members) >= FEWEST_MEMBERS:
            return self.ensemble
        return infer_posterior(self.model, dataset, self.config, substeps=self.substeps)


def fit(
    dataset: Dataset,
    *,
    model: ModelConfig | None = None,
    config: TrainingConfig | None = None,
    folder: Path | str | None = None,
    resume: bool = False,
    members: int = 0,
    max_minutes: float | None = None,
    progress: Callable[[Progress], object] = ignore,
) -> FitResult:
    """Train a model on recordings.

    Everything runs in the precision that it needs, whatever JAX's global setting: Adam in single, Levenberg-Marquardt
    in double.

    Args:
        dataset: Recordings; its test part is not looked at.
        model: Settings of the model.
        config: Settings of training.
        folder: Where `metrics.jsonl`, `checkpoints/`, `model.safetensors` and `ensemble.safetensors` go; nothing is
            written without it.
        resume: Go on from the checkpoint in `folder`, if there is one; the weights then are those of an uninterrupted
            run, bit for bit.
        members: How many more models to train like it, from other initial weights on windows drawn with replacement:
            how they scatter says how certain it is. 0 trains none.
        max_minutes: Stop after this time, earlier runs not counted, with the best model so far. A stride that has begun
            ends first; the first of a stage compiles, which may take ten seconds.
        progress: Called after every stride. Where it raises `StopIteration`, training ends with the best model so far,
            as at the time limit; with a `folder`, `resume=True` goes on.

    Returns:
        The model and how training ended.

    Raises:
        TypeError: If `dataset`, `model` or `config` is something else.
        TrainingError: If no model was found whose mean squared errors are finite and below a thousand times the motion.
        ValueError: If members are wanted and training has no Levenberg-Marquardt, something is to be resumed and no
            folder is named, or `max_minutes` is not positive.
        DataError: If every recording is shorter than a window, nothing moves, or a given part cannot be a mechanism's.
        StorageError: If `folder` cannot be written, has a run that is not to be resumed, its checkpoint is damaged, or
            of other data or settings, or the model cannot be saved there, as one with Python functions cannot.

    Example:
        >>> import numpy as np
        >>> from symoden import Trajectory, Dataset
        >>> ts = np.linspace(0.0, 2.0, 41)
        >>> q, v = np.cos(ts)[:, None], -np.sin(ts)[:, None]
        >>> swing = Trajectory(name="swing", ts=ts, q=q, rates=v, us=np.zeros((41, 0)))
        >>> quick = TrainingConfig(adam_steps=50, lm_steps=2, growth_steps=0, relevance_steps=0)
        >>> result = fit(Dataset(name="spring", space="R1", train=(swing,)), config=quick)
        >>> result.outcome
        'all steps taken'
    """
    model, config = ModelConfig() if model is None else model, TrainingConfig() if config is None else config
    _refuse_other_types(dataset, model, config)
    check_members(members, config)
    folder = None if folder is None else Path(folder)
    told = repr((dataset.digest, model, dataclasses.replace(config, left_out=None)))  # What was found may be given now.
    origin = hashlib.sha256(told.encode()).hexdigest()
    rounds = _ROUNDS if config.left_out is None else 0
    journal = Journal(folder=folder, origin=origin, left_out=config.left_out or (), rounds=rounds)
    _refuse_overwriting(journal, resume=resume)
    precision = jnp.zeros(()).dtype  # The user's; inside, arrays have another.
    # Optax's schedules mix integers and floats, which a user's strict promotion would refuse.
    watch = Stopwatch(max_minutes, progress)
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        prepared, config, state, findings = _trained(dataset, model, config, journal, watch, members, resume=resume)
        stages, begun = prepared.stages, prepared.state.model
        completed, ensemble, outcome = state.stage == len(stages), None, findings.outcome
        state = _rated(stages, state, completed=completed)
        _refuse_lost(state, config, completed=completed)
        visited = np.concatenate([each.q for each in dataset.train])
        state = state._replace(best=as_heavy(state.best, begun, visited[:: 1 + len(visited) // _STATES]))
        best = cast(state.best, precision)
        if folder is not None:
            save(folder / MODEL, best)
        if members and completed:
            pattern = _pattern(stages, state, prepared.fresh, config)
            ensemble = train_members(pattern, members, path=journal.ensemble, resume=resume, watch=watch)
            completed = ensemble.is_complete(members)
            if not completed:
                outcome = watch.outcome(["members"])
            elif len(ensemble.members) < members:
                outcome = f"{len(ensemble.members)} of {ensemble.tried} members fitted as well as the model"
    if findings.advice:
        warnings.warn(f"`{dataset.name}`: {findings.advice}", DataWarning, stacklevel=2)
    return FitResult(
        model=best,
        outcome=outcome,
        completed=completed,
        loss=state.best_loss,
        seconds=watch.seconds,
        config=config,
        substeps=state.substeps,
        ensemble=ensemble,
        verdicts=findings.verdicts,
        hardly_judged=findings.hardly_judged,
    )


def _trained(
    dataset: Dataset,
    model: ModelConfig,
    config: TrainingConfig,
    journal: Journal,
    watch: Stopwatch,
    members: int,
    *,
    resume: bool,
) -> tuple[Prepared, TrainingConfig, TrainingState, Findings]:
    """Go through the stages, and anew without what disturbs recordings where that is found by the way.

    Returns:
        What training began with, the settings with what was left out, the last state, and what came of stages.
    """
    guessing = lambda step, most, loss: watch.report(Progress("first guess", step, most, loss, None, watch.seconds))
    if resume:
        journal = journal.going_on(config.left_out)
    before = None
    while True:
        config = dataclasses.replace(config, left_out=journal.left_out or config.left_out)
        saved, screened = journal.folder is not None, journal.rounds > 0
        prepared = prepare(dataset, model, config, guessing, saved=saved, screened=screened)
        counts = [stage.data.train.ts.shape[0] for stage in prepared.stages if isinstance(stage, LevenbergStage)]
        check_members(members, config, min(counts, default=0))
        stages, screening = prepared.stages, prepared.screening
        state, findings, disturbed = run(
            stages, prepared.state, journal, resume=resume, watch=watch, screening=screening
        )
        if not disturbed:
            break
        message = (
            f"`{dataset.name}`: left out of training is {spans_in_words(disturbed)}: there something moves "
            "the machine that neither its inputs nor the model explains, as a push, a stop or a wrong sample does. "
            "Training begins anew without; `train --keep-disturbed`, in Python `TrainingConfig(left_out=())`, keeps it."
        )
        warnings.warn(message, DataWarning, stacklevel=3)
        before = prepared, config, state, findings
        journal = dataclasses.replace(journal, left_out=disturbed, rounds=journal.rounds - 1)
        resume = False
    if before is not None and state.stage < len(stages) and state.stage <= before[2].stage:
        # Stopped before it is as good. What there is instead is not complete, whatever stage it was found after.
        outcome = findings.outcome
        prepared, config, state, findings = before
        findings = findings._replace(outcome=outcome)
        state = state._replace(stage=min(state.stage, len(prepared.stages) - 1))
    return prepared, config, state, findings


def _refuse_other_types(dataset: object, model: object, config: object) -> None:
    """Refuse anything but a data set and settings."""
    hints = {Dataset: "`read_dataset` reads a description of files.", ModelConfig: "It has settings of a new model."}
    for given, kind in ((dataset, Dataset), (model, ModelConfig), (config, TrainingConfig)):
        if not isinstance(given, kind):
            hint = hints.get(kind, f"Write `{kind.__name__}(…)`.")
            raise TypeError(f"Training must be given a `{kind.__name__}`; got {type(given).__name__}. {hint}")


def _refuse_overwriting(journal: Journal, *, resume: bool) -> None:
    """Refuse to begin where a run is, and to go on with none."""
    if journal.folder is None or journal.checkpoint is None:
        if resume:
            raise ValueError("Training can be resumed only in a `folder`; got none. Name that of the run.")
        return
    if not resume and (journal.checkpoint.exists() or (journal.folder / MODEL).exists()):
        goes_on = " `resume=True` goes on with it, or adds members." if journal.checkpoint.exists() else ""
        raise StorageError(f"`{journal.folder}` must hold no run; it has one. Name another folder.{goes_on}")


def _refuse_lost(state: TrainingState, config: TrainingConfig, *, completed: bool) -> None:
    """Refuse a best model that predicts nothing."""
    if not math.isfinite(state.best_loss) or (completed and config.scaled_loss and state.best_loss > _NOTHING):
        raise TrainingError(
            "Training must find a model whose errors are finite and not far larger than the motion; the best one "
            f"has a loss of {state.best_loss:.2g}, where predicting that nothing moves has one of 1. Check the units "
            "and the space of the data (`symoden data check`), or begin from other weights: another `--seed`; in "
            "Python another `seed` or a lower `learning_rate` of `TrainingConfig`."
        )


def _rated(stages: Sequence[AbstractStage], state: TrainingState, *, completed: bool) -> TrainingState:
    """The state of training, its best model rated by rollouts and all errors alike, in the longest windows that were.

    Stages count errors otherwise, and some are judged by recordings that others are fitted to.

    Returns:
        The state, with integration as fine as rollouts need.
    """
    rollouts = [(k, each) for k, each in enumerate(stages) if isinstance(each, LevenbergStage) and not each.regresses]
    if not rollouts:
        return state
    if state.stage < rollouts[0][0]:
        return rollouts[0][1].rated(state)
    gone = [stage for k, stage in rollouts if not stage.data.parted and (completed or k <= state.stage)]
    if not gone:
        return state
    rated = gone[-1].rated(state)
    return state._replace(best_loss=rated.best_loss, substeps=rated.substeps)


def _pattern(
    stages: Sequence[AbstractStage],
    state: TrainingState,
    fresh: Callable[..., AbstractDynamics],
    config: TrainingConfig,
) -> Pattern:
    """How members are trained: as the stage did that the best model came from, from draws after Adam's."""
    last = stages[state.origin]
    if isinstance(last, LevenbergStage) and last.data.parted:
        last = stages[-1]  # What it found, on all recordings.
    if not isinstance(last, LevenbergStage) or last.regresses:
        raise TypeError("The best model must come from Levenberg-Marquardt on rollouts.")
    # What an earlier stage set free and validation kept is open, though the last one did not change it.
    kinds = last.corrections | kinds_in_use(state.best)
    first: dict[type[AbstractStage], AbstractStage] = {}
    for stage in stages:
        if isinstance(stage, LevenbergStage) and stage.regresses:
            asked = kinds & (ACTUATION | INERTIA | POTENTIAL)
            first.setdefault(LevenbergStage, dataclasses.replace(stage, corrections=asked))
        elif isinstance(stage, AdamStage):
            first.setdefault(AdamStage, stage)
    horizon = last.data.train.ts.shape[1]
    rollouts = (each.data for each in stages if isinstance(each, LevenbergStage) and not each.regresses)
    shorter = {each.train.ts.shape[1]: each.train for each in rollouts if not each.parted}
    windows = tuple(shorter[length] for length in sorted(shorter) if length < horizon)
    draw = functools.partial(fresh, awake=bool(kinds_in_use(state.best) & POTENTIAL))
    last = dataclasses.replace(last, corrections=kinds, frees=last.frees or bool(kinds & NETWORKS))
    return Pattern(lambda number: draw(config.restarts + number), tuple(first.values()), windows, last, state)
