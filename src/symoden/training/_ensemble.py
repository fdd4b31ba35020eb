"""Ensembles: models trained like one, each from other initial weights on windows drawn with replacement."""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
import scipy.stats
from jaxtyping import Array, Float

from symoden.blocks import DIRECTIONS, FRICTION, NETWORKS
from symoden.mechanics import AbstractDynamics
from symoden.storage import StorageError, load_arrays, save_arrays

from ._config import TrainingConfig
from ._flatten import Flattening, cast
from ._level import LEAST_WINDOWS
from ._levenberg_marquardt import LevenbergState
from ._levenberg_stage import LevenbergStage
from ._objective import Batch
from ._posterior import AbstractPosterior, AbstractScatter, Quantities, Restore
from ._residuals import evaluate_loss
from ._stages import EXACT, EXPLAINED, AbstractStage
from ._state import TrainingState
from ._stopwatch import Progress, Stopwatch

FEWEST_MEMBERS: Final = 2
"""Fewest members whose scatter makes bands."""
_TRIES: Final = 2  # Of initial weights, for every member that is wanted.
_ASTRAY: Final = 1.5  # Times the trained model's loss on the same windows: a member above has found another basin.
_SAME: Final = 1e-4  # Relative difference of models that differ by rounding in a file.
_LADDER: Final = (0, FRICTION, FRICTION | DIRECTIONS, FRICTION | DIRECTIONS | NETWORKS)  # Rungs in older files.


@final
class _Members(AbstractScatter):
    """Every member's parameters."""

    restore: Restore
    theta: Float[Array, " P"]
    members: Float[Array, "k P"]

    def moments(self, quantities: Quantities) -> tuple[Float[Array, "*K"], Float[Array, "*K"]]:
        value = quantities(self.restore(self.theta))
        squares = jax.vmap(lambda theta: (quantities(self.restore(theta)) - value) ** 2)(self.members)
        return value, jnp.mean(squares, axis=0)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble(AbstractPosterior):
    """Models that were trained like one, each from other initial weights on windows drawn with replacement.

    How they scatter about it is how it would scatter if its windows were drawn anew (the bootstrap of Efron), and if
    each prior had another mean, drawn from itself: where the data say nothing, members scatter as the prior does.
    Nothing is linear in this, and nothing normal. Priors that training has learned stay as they are, other than in
    Laplace's approximation: what they narrowed counts as known.

    Attributes:
        members: Flat parameters of every member.
        tried: How many were trained; those that fit their own windows worse than the model does, mostly because they
            ended in another basin, are no members.
        corrections: Which kinds of corrections are free, as flags.

    References:
        Efron (1979), *Bootstrap methods: another look at the jackknife*; Bardsley et al. (2014),
        *Randomize-then-optimize*: the means of the priors.
    """

    members: Float[np.ndarray, "k P"]
    tried: int
    corrections: int

    def quantile(self, level: float) -> float:
        """Student's, with as many degrees of freedom as there are members: the model is given, not their mean."""
        return float(scipy.stats.t.ppf((1 + level) / 2, len(self.members)))

    def project(self, quantities: Quantities) -> Float[np.ndarray, "K k"]:
        """Each member's deviation from the model, over the root of their number."""
        with jax.enable_x64(True):  # noqa: FBT003 - JAX's signature
            value, *others = (
                np.asarray(quantities(self.restore(jnp.asarray(theta))), float) for theta in (self.theta, *self.members)
            )
        return (np.stack(others, axis=1) - value[:, None]) / math.sqrt(len(others))

    def scatter(self) -> AbstractScatter:
        """The members."""
        return _Members(self.restore, jnp.asarray(self.theta, float), jnp.asarray(self.members, float))

    def is_complete(self, count: int) -> bool:
        """Whether there are as many members as wanted, or twice as many models were tried.

        Args:
            count: How many are wanted.

        Returns:
            Whether no more are to be trained.
        """
        return len(self.members) >= count or self.tried >= _TRIES * count

    def models(self) -> Iterator[AbstractDynamics]:
        """The members as models."""
        return (cast(self.restore(jnp.asarray(theta)), jnp.zeros(()).dtype) for theta in self.members)


def save_ensemble(path: Path, ensemble: Ensemble) -> None:
    """Write an ensemble beside its model.

    Args:
        path: The file.
        ensemble: The ensemble.

    Raises:
        StorageError: If it cannot be written.
    """
    facts = {"tried": ensemble.tried, "windows": ensemble.windows, "kinds": ensemble.corrections}
    save_arrays(path, {"model": ensemble.theta, "members": ensemble.members}, facts)


def load_ensemble(path: Path, model: AbstractDynamics) -> Ensemble:
    """Read an ensemble.

    Args:
        path: The file.
        model: The trained model that it belongs to.

    Returns:
        The ensemble.

    Raises:
        StorageError: If the file is absent or damaged, or belongs to another model.
    """
    remedy = "The model is whole: remove this file, and train members anew by `--resume --members N`."
    try:
        arrays, facts = load_arrays(path)
    except StorageError as error:
        raise StorageError(f"{error} {remedy}") from error
    if set(arrays) != {"model", "members"}:
        raise StorageError(f"`{path}` must be an ensemble; it is another file of symoden. {remedy}")
    saved, members = arrays["model"], arrays["members"]
    tried, windows = (int(facts[name]) for name in ("tried", "windows"))
    corrections = int(facts["kinds"]) if "kinds" in facts else _LADDER[int(facts["corrections"])]
    with jax.enable_x64(True):  # noqa: FBT003 - JAX's signature
        restore, theta = Flattening.of(cast(model, float), corrections=corrections)
    if saved.shape != theta.shape or not np.allclose(saved, theta, rtol=_SAME, atol=_SAME):
        raise StorageError(f"`{path}` must be the ensemble of the run's model; it belongs to another. {remedy}")
    return Ensemble(
        restore=restore, theta=saved, windows=windows, members=members, tried=tried, corrections=corrections
    )


def check_members(count: int, config: TrainingConfig, windows: int = LEAST_WINDOWS) -> None:
    """Refuse numbers of members that tell nothing, and settings and data that train none.

    Args:
        count: How many are wanted; 0 is no ensemble.
        config: Settings of training.
        windows: Number of windows to draw from, if it is known.

    Raises:
        ValueError: If there are too few, or training has no Levenberg-Marquardt.
    """
    if count and windows < LEAST_WINDOWS:
        raise ValueError(
            f"Members need {LEAST_WINDOWS} windows or more to draw from; the training recordings have {windows}. "
            "Record longer, or train without members."
        )
    if count and count < FEWEST_MEMBERS:
        raise ValueError(f"`members` must be 0, or at least {FEWEST_MEMBERS}, better 8; got {count}.")
    if count and not config.lm_steps:
        raise ValueError(
            "Members need settings with Levenberg-Marquardt, as the preset `default` has and `paper` has not. Train "
            "without members, or by the other preset."
        )


class Pattern(NamedTuple):
    """How the members of an ensemble are trained.

    Attributes:
        fresh: Makes an untrained model from the number of a draw.
        first: Stages that find the basin, in turn; none if the stage after them needs no such help.
        shorter: Windows of stages before that one, from the shortest on: from afar, long rollouts end in other basins.
        stage: The stage that the trained model came from.
        state: The state at the end of training.
    """

    fresh: Callable[[int], AbstractDynamics]
    first: tuple[AbstractStage, ...]
    shorter: tuple[Batch, ...]
    stage: LevenbergStage
    state: TrainingState


def train_members(
    pattern: Pattern,
    count: int,
    *,
    path: Path | None,
    resume: bool,
    watch: Stopwatch,
) -> Ensemble:
    """Train models until there are as many as wanted, or twice as many were tried.

    What training has chosen stays as it is: which corrections are free, the priors, the length of windows, the steps of
    integration.

    Args:
        pattern: How.
        count: How many are wanted.
        path: Where to keep them, each as soon as it is trained.
        resume: Go on with those that are there.
        watch: Hears of every step and tells when the run is to end; a member that is being trained then is lost.

    Returns:
        The ensemble; smaller than wanted where the run was to end, or too many went astray.
    """
    stage, model = pattern.stage, cast(pattern.state.best, float)
    restore, theta = Flattening.of(model, corrections=stage.corrections)
    ensemble = Ensemble(
        restore=restore,
        theta=np.asarray(theta),
        windows=stage.data.train.ts.shape[0],
        members=np.zeros((0, theta.size)),
        tried=0,
        corrections=stage.corrections,
    )
    if resume and path is not None and path.exists():
        ensemble = load_ensemble(path, model)
    while not ensemble.is_complete(count) and not watch.is_up():
        member = _Member(pattern, restore, ensemble.tried)
        name, found = f"model {len(ensemble.members) + 1} of {count}", ensemble.theta
        for done in member.train():
            found = done.best
            watch.report(Progress(name, done.step, member.steps, done.loss, None, watch.seconds))
            if watch.is_over() and not done.ended:
                return ensemble
        members = ensemble.members
        floor = EXPLAINED if stage.config.scaled_loss else 0.0
        if member.loss(found) <= _ASTRAY * max(member.loss(ensemble.theta), floor):
            members = np.concatenate([members, found[None]])
        ensemble = dataclasses.replace(ensemble, members=members, tried=ensemble.tried + 1)
        if path is not None:
            save_ensemble(path, ensemble)
    return dataclasses.replace(ensemble, members=ensemble.members[:count])


class _Trained(NamedTuple):
    """A step of a member's training."""

    step: int
    loss: float
    ended: bool
    best: Float[np.ndarray, " P"]


@final
@dataclass(frozen=True)
class _Member:
    """A model to be trained on its own windows."""

    pattern: Pattern
    restore: Flattening
    number: int

    @functools.cached_property
    def windows(self) -> Batch:
        """As many windows as there are, drawn with replacement."""
        stage = self.pattern.stage
        total = stage.data.train.ts.shape[0]
        return stage.data.train.take(np.random.default_rng([stage.config.seed, self.number]).integers(0, total, total))

    def loss(self, theta: Float[np.ndarray, " P"]) -> float:
        """Mean squared residual on its own windows."""
        return self._loss(theta, self.windows)

    @property
    def steps(self) -> int:
        """Largest number of steps of Levenberg-Marquardt."""
        config = self.pattern.stage.config
        return config.lm_steps + config.growth_steps + self.pattern.stage.learns * config.relevance_steps

    def train(self) -> Iterator[_Trained]:
        """Into a basin from fresh weights, then Levenberg-Marquardt to its bottom.

        Yields:
            After each step its number, the loss and the best parameters so far.
        """
        theta = first = self._flat(fresh := self.pattern.fresh(self.number))
        for loss, begun in self._sought(fresh):
            theta = self._flat(begun)
            yield _Trained(step=0, loss=loss, ended=False, best=np.asarray(theta))
        if self.loss(np.asarray(first)) < self.loss(np.asarray(theta)):  # A guess may be better than a regression.
            theta = first
        for windows in self.pattern.shorter:
            for done in self._fitted(theta, windows, final=False):
                theta = jnp.asarray(done.best)
                yield done._replace(ended=False)
        yield from self._fitted(theta, self.windows, final=True)

    def _fitted(self, theta: Float[Array, " P"], windows: Batch, *, final: bool) -> Iterator[_Trained]:
        """Levenberg-Marquardt to the bottom.

        Yields:
            After each step its number, the loss and the best parameters so far.
        """
        stage, end = self.pattern.stage, self.pattern.state
        data, config, priors = stage.data, stage.config, end.memory
        state, best, least, stale = LevenbergState(theta, config.damping), theta, math.inf, 0
        mean = self._mean(priors.precisions(self.restore(theta), stage.corrections))
        # Learned priors keep from fitting noise; else the validation windows tell when to stop, as in training.
        judges = data.validation if final and not data.in_turn and not stage.learns else None
        for step in range(self.steps):
            state, done = stage.step(
                state, self.restore, windows, substeps=end.substeps, weighing=end.weighing, priors=priors, mean=mean
            )
            judged = done.after if judges is None else self._loss(np.asarray(state.theta), judges)
            stale = 0 if stage.gains(done, judged, least) else stale + 1
            if judged < least:
                best, least = state.theta, judged
            exact = config.scaled_loss and judged < EXACT
            ended = exact or stale >= config.patience or step + 1 == self.steps
            yield _Trained(step + 1, done.after, ended, np.asarray(best))
            if ended:
                break

    def _sought(self, fresh: AbstractDynamics) -> Iterator[tuple[float, AbstractDynamics]]:
        """From a fresh model into a basin.

        Yields:
            The loss and the best model so far, after each stride.
        """
        state = self.pattern.state._replace(best=fresh, best_loss=math.inf, memory=None)
        for each in self.pattern.first:
            stage = each.anew(fresh)
            if not stage.applies(state):
                continue
            state, finished = stage.start(state), False
            while not finished:
                state, done = stage.advance(state)
                finished = done.finished
                yield done.loss, state.best

    def _flat(self, model: AbstractDynamics) -> Float[Array, " P"]:
        """Its free parameters."""
        return Flattening.of(cast(model, float), corrections=self.pattern.stage.corrections)[1]

    def _mean(self, precisions: Float[np.ndarray, " P"]) -> Float[np.ndarray, " P"]:
        """A mean of the prior, drawn from itself; zero where it is flat."""
        draws = np.random.default_rng([self.pattern.stage.config.seed, self.number, 1]).normal(size=len(precisions))
        return np.where(precisions > 0, draws / np.sqrt(np.maximum(precisions, np.finfo(float).tiny)), 0.0)

    def _loss(self, theta: Float[np.ndarray, " P"], windows: Batch) -> float:
        model = self.restore(jnp.asarray(theta))
        final = self.pattern.state
        return evaluate_loss(model, self.pattern.stage.objective(final.substeps, final.weighing), windows)
