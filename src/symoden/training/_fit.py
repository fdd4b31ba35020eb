"""Fit a model to recordings: Adam finds the basin, Levenberg-Marquardt reaches the bottom."""

import dataclasses
import functools
import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.blocks import ACTUATION, INERTIA, NETWORKS, POTENTIAL, count_parameters, trainable
from symoden.data import DataError, Dataset, check_trainable
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import ModelConfig, StructuredModel, awaken, build, check_savable, save
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.wording import number

from ._adam_stage import AdamStage
from ._config import TrainingConfig
from ._data import hold_out, name_held, regression_data
from ._ensemble import FEWEST_MEMBERS, Ensemble, Pattern, check_members, train_members
from ._first_guess import as_heavy, begin_with, can_be_guessed, guess, silent
from ._flatten import cast, freed
from ._gauss_newton import MOST_SOLVED
from ._laplace import infer_posterior
from ._levenberg_stage import LevenbergStage
from ._line_up import can_regress, line_up
from ._posterior import AbstractPosterior
from ._run import MODEL, Journal, Progress, Stopwatch, ignore, run
from ._scales import measure_scales
from ._stages import AbstractStage
from ._state import Incumbent, TrainingState
from ._weighing import Weighing

FEWEST_SUBSTEPS: Final = 4
"""RK4 steps in a sampling interval by which models are evaluated, or more where training needed more."""

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
        config: Settings of training.
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
    told = repr((dataset.digest, model, config))
    journal = Journal(folder=folder, origin=hashlib.sha256(told.encode()).hexdigest())
    _refuse_overwriting(journal, resume=resume)
    precision = jnp.zeros(()).dtype  # The user's; inside, arrays have another.
    # Optax's schedules mix integers and floats, which a user's strict promotion would refuse.
    watch = Stopwatch(max_minutes, progress)
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        guessing = lambda step, most, loss: watch.report(Progress("first guess", step, most, loss, None, watch.seconds))
        stages, state, fresh = _prepare(dataset, model, config, guessing, saved=folder is not None)
        begun = state.model
        counts = [stage.data.train.ts.shape[0] for stage in stages if isinstance(stage, LevenbergStage)]
        check_members(members, config, min(counts, default=0))
        state, findings = run(stages, state, journal, resume=resume, watch=watch)
        completed, ensemble, outcome = state.stage == len(stages), None, findings.outcome
        state = _rated(stages, state, completed=completed)
        _refuse_lost(state, config, completed=completed)
        visited = np.concatenate([each.q for each in dataset.train])
        state = state._replace(best=as_heavy(state.best, begun, visited[:: 1 + len(visited) // _STATES]))
        best = cast(state.best, precision)
        if folder is not None:
            save(folder / MODEL, best)
        if members and completed:
            pattern = _pattern(stages, state, fresh, config)
            ensemble = train_members(pattern, members, path=journal.ensemble, resume=resume, watch=watch)
            completed = ensemble.is_complete(members)
            if not completed:
                outcome = watch.outcome(["members"])
            elif len(ensemble.members) < members:
                outcome = f"{len(ensemble.members)} of {ensemble.tried} members fitted as well as the model"
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


def _prepare(
    dataset: Dataset,
    model: ModelConfig,
    config: TrainingConfig,
    guessing: Callable[[int, int, float], None] = silent,
    *,
    saved: bool = False,
) -> tuple[list[AbstractStage], TrainingState, Callable[..., AbstractDynamics]]:
    """Split the recordings, and line up the stages, the state before them, and what makes untrained models."""
    if not dataset.train:
        raise DataError(f"`{dataset.name}`: training must have recordings in `train`; got none.")
    check_trainable(dataset)
    name_held(dataset)
    dataset = hold_out(dataset, config)
    if saved and dataset.known is not None:
        _check_savable(_drawing(dataset, model, config)(0))  # Before guesses and training take their time.
    fresh = _builder(dataset, model, config, guessing)
    dynamics = fresh(0)
    restarts = config.restarts if config.adam_steps else 0
    candidates = [fresh(number, awake=number > 0) for number in range(restarts)]  # First a V that is a polynomial.
    awake = (fresh(number, awake=True) for number in range(2))
    if config.lm_steps and eqx.tree_equal(*(eqx.filter(one, trainable(one, corrections=freed(one))) for one in awake)):
        candidates = []  # Nothing is: from a guess that a user gave, Levenberg-Marquardt finds the bottom alone.
    size = count_parameters(dynamics)
    if not size:
        raise ValueError("Training must have something to learn; every part is given. Leave a number or a part open.")
    if config.lm_steps and size > MOST_SOLVED:
        raise ValueError(
            f"Levenberg-Marquardt must have at most {MOST_SOLVED} numbers to learn, as its matrices hold the squares; "
            f"the model has {size}. Take smaller networks, or Adam alone: `lm_steps=0`."
        )
    stages = line_up(dataset, dynamics, candidates, config)
    weighing = Weighing.plain(dynamics.space.embedded_size + dynamics.space.size)
    state = TrainingState(
        stage=0,
        step=0,
        model=dynamics,
        memory=None,
        damping=config.damping,
        substeps=(config.lm_substeps or 1) if config.lm_steps else config.substeps,
        weighing=weighing,
        best=dynamics,
        best_loss=math.inf,
        origin=0,
        stale=0,
        incumbent=Incumbent(dynamics, None, 0, weighing, rival=dynamics),
    )
    return stages, state, fresh


def _check_savable(dynamics: AbstractDynamics) -> None:
    """Refuse a model that could not be saved after training."""
    try:
        check_savable(dynamics)
    except StorageError as error:
        raise StorageError(f"{error} To train without files, leave `folder` out.") from None


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


def _builder(
    dataset: Dataset, model: ModelConfig, config: TrainingConfig, guessing: Callable[[int, int, float], None]
) -> Callable[..., AbstractDynamics]:
    """What makes untrained models from the number of a draw, networks of V awake or not (see `awaken`)."""
    draw = _drawing(dataset, model, config)
    untouched = draw(0)
    if not isinstance(untouched, StructuredModel) or not can_regress(untouched, config):
        return draw
    windows = regression_data(dataset, untouched, config) if can_be_guessed(untouched) else None
    if windows is None:
        return draw
    first = guess(cast(untouched, jnp.float64), windows, guessing)
    known = dataset.known
    if first.drives is not None and known is not None and known.robot is not None:
        # Natural units follow: those of a wrist whose drive outweighs it are not those of its weight.
        driven = dataclasses.replace(known, robot=known.robot.with_drives(first.drives.tolist()))
        draw = _drawing(dataclasses.replace(dataset, known=driven), model, config)

    def begun(number: int, *, awake: bool = False) -> AbstractDynamics:
        drawn = draw(number, awake=awake)
        return begin_with(drawn, first) if isinstance(drawn, StructuredModel) else drawn

    return begun


def _drawing(dataset: Dataset, model: ModelConfig, config: TrainingConfig) -> Callable[..., AbstractDynamics]:
    """What makes models from the number of a draw, whatever the recordings say of inputs and friction."""
    space = Space.parse(dataset.space)
    scales = None
    if model.scaled:
        scales = measure_scales(
            dataset.train, space, momenta=dataset.momenta, input_matrix=dataset.input_matrix, known=dataset.known
        )

    def drawn(number: int, *, awake: bool = False) -> AbstractDynamics:
        key = jax.random.fold_in(jax.random.key(config.seed), number)
        made = build(
            model,
            space,
            dataset.inputs,
            momenta=dataset.momenta,
            scales=scales,
            input_matrix=dataset.input_matrix,
            known=dataset.known,
            key=key,
        )
        return awaken(made, key=jax.random.fold_in(key, 1)) if awake else made

    return drawn


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
    kinds = last.corrections | freed(state.best)
    first: dict[type[AbstractStage], AbstractStage] = {}
    for stage in stages:
        if isinstance(stage, LevenbergStage) and stage.regresses:
            asked = kinds & (ACTUATION | INERTIA | POTENTIAL)
            first.setdefault(LevenbergStage, dataclasses.replace(stage, corrections=asked))
        elif isinstance(stage, AdamStage):
            first.setdefault(AdamStage, stage)
    draw = functools.partial(fresh, awake=bool(freed(state.best) & POTENTIAL))
    last = dataclasses.replace(last, corrections=kinds, frees=last.frees or bool(kinds & NETWORKS))
    return Pattern(lambda number: draw(config.restarts + number), tuple(first.values()), last, state)
