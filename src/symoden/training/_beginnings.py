"""What a stage of Levenberg-Marquardt begins with."""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal, final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from symoden.blocks import DIRECTIONS, FRICTION, Correction, Harmonics, Polynomial, kinds_in_use, silenced
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel, given_parts

from ._levenberg_marquardt import CLOSED
from ._relevance import Relevance
from ._state import Incumbent, TrainingState


class AbstractBeginning(abc.ABC):
    """What a stage begins with.

    Attributes:
        untrained: Whether nothing is in it that stages before have found.
        leaner: Whether it has fewer numbers than the best model: it must fit the training windows better, too.
        rivalled: Whether the best model becomes it by the recordings of the stage alone: it must predict what judges
            it, or the stage is left out; where time runs out nothing of it is delivered.
        closes: Whether something of the best model is closed, in later stages too.
    """

    untrained: ClassVar[bool] = False
    leaner: ClassVar[bool] = False
    rivalled: ClassVar[bool] = False
    closes: ClassVar[bool] = False

    @abc.abstractmethod
    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The model.

        Args:
            state: State at the end of the stage before.
            loss: By which models are chosen in the stage.

        Returns:
            The model.
        """

    def applies(self, state: TrainingState) -> bool:
        """Whether there is such a model that differs from what was before.

        Args:
            state: State at the end of the stage before.

        Returns:
            Whether there is.
        """
        del state
        return True

    def memory(self, state: TrainingState) -> PyTree:
        """What is remembered of priors.

        Args:
            state: State at the end of the stage before.

        Returns:
            It.
        """
        return state.memory

    def priors(self, before: Relevance) -> Relevance:
        """The priors of the stage.

        Args:
            before: Those that it would have else.

        Returns:
            The priors.
        """
        return before

    def incumbent(self, state: TrainingState) -> Incumbent:
        """What the stage has to improve on.

        Args:
            state: State at the end of the stage before.

        Returns:
            The best model so far.
        """
        return Incumbent(state.best, state.memory, state.origin, state.weighing, rival=state.best)

    def free(self, model: AbstractDynamics, before: AbstractDynamics) -> int:
        """Which corrections are free whatever the stage sets free, as flags.

        Args:
            model: The model now.
            before: The best one before the stage.

        Returns:
            Their kinds.
        """
        del before
        return kinds_in_use(model)

    def anew(self, fresh: AbstractDynamics) -> "AbstractBeginning":
        """The same where it is the best model; else with another draw of weights.

        Args:
            fresh: Untrained model.

        Returns:
            The beginning.
        """
        del fresh
        return self


@final
@dataclass(frozen=True)
class Best(AbstractBeginning):
    """The best model so far.

    Attributes:
        guess: A model that takes its place where the guess has the lower loss.
    """

    guess: AbstractDynamics | None = None

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The better one of both."""
        return state.best if self.guess is None or loss(state.best) <= loss(self.guess) else self.guess


@final
@dataclass(frozen=True)
class Joined(AbstractBeginning):
    """What the stage before has made: both are kept or neither."""

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The best model so far."""
        del loss
        return state.best

    def incumbent(self, state: TrainingState) -> Incumbent:
        """What that stage had to improve on."""
        return state.incumbent._replace(rival=state.incumbent.model)


@final
@dataclass(frozen=True)
class Again(AbstractBeginning):
    """What the stage before began with, whatever that has made of it: the better one of both ways is kept."""

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The model that stage had to improve on."""
        del loss
        return state.incumbent.model

    def memory(self, state: TrainingState) -> PyTree:
        """What was remembered then."""
        return state.incumbent.memory


@final
@dataclass(frozen=True)
class Without(AbstractBeginning):
    """The best model so far, some of its corrections zero again.

    Attributes:
        kinds: Which, as flags.
    """

    kinds: int
    leaner: ClassVar[bool] = True

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The model without them."""
        del loss
        return silenced(state.best, self.kinds)

    def applies(self, state: TrainingState) -> bool:
        """Whether one of them is free."""
        return bool(self.kinds & kinds_in_use(state.best))


@final
@dataclass(frozen=True)
class Uniform(AbstractBeginning):
    """The best model so far, but M or V the same everywhere: what depends on the configuration is closed.

    Attributes:
        part: Which of both.
    """

    part: Literal["inverse_mass", "potential"]
    closes: ClassVar[bool] = True

    def has(self, model: AbstractDynamics) -> bool:
        """Whether there is such a part, which was not given.

        Args:
            model: Any model.

        Returns:
            Whether there is.
        """
        name = {"inverse_mass": "mass_matrix", "potential": "potential_energy"}[self.part]
        return bool(self._weights(model)) and name not in given_parts(model)

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The model with a part that is constant."""
        del loss
        return self._filled(state.best, 0.0)

    def applies(self, state: TrainingState) -> bool:
        """Whether it is not closed yet."""
        memory = state.memory
        closed = isinstance(memory, Relevance) and all(
            np.all(np.asarray(each)[1:] >= CLOSED) for each in self._weights(memory.precision)
        )
        return self.has(state.best) and not closed

    def priors(self, before: Relevance) -> Relevance:
        """The same, but what is closed stays so."""
        return before._replace(precision=self._filled(before.precision, CLOSED))

    def _filled(self, model: PyTree, value: float) -> PyTree:
        """The model, or what has its structure, with one number in place of all weights but those of constants."""
        return eqx.tree_at(self._weights, model, replace_fn=lambda weights: weights.at[1:].set(value))

    def _weights(self, model: PyTree) -> list:
        """Weights of the part, a row for each product or monomial, that of the constant first."""
        if not isinstance(model, StructuredModel):
            return []
        parts = jax.tree.leaves(getattr(model, self.part), is_leaf=_is_a_start)
        return [part.weights for part in parts if isinstance(part, Harmonics | Polynomial)]


def _is_a_start(part: object) -> bool:
    """Whether a part of a block is what it starts from, or a correction, which is asked for apart."""
    return isinstance(part, Harmonics | Polynomial | Correction)


@final
@dataclass(frozen=True)
class Untrained(AbstractBeginning):
    """An untrained model in any case.

    What stages before have set free and kept is free, but for friction's laws: from wide priors on these take up what
    is not yet explained.

    Attributes:
        fresh: The model.
    """

    fresh: AbstractDynamics
    untrained: ClassVar[bool] = True

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The untrained model."""
        del state, loss
        return self.fresh

    def free(self, model: AbstractDynamics, before: AbstractDynamics) -> int:
        """What is free of both."""
        return kinds_in_use(model) | kinds_in_use(before) & ~(FRICTION | DIRECTIONS)

    def anew(self, fresh: AbstractDynamics) -> "Untrained":
        """Another draw."""
        return Untrained(fresh)


@final
@dataclass(frozen=True)
class Refitted(AbstractBeginning):
    """What the stage before has made of the same recordings alone."""

    rivalled: ClassVar[bool] = True

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The rival of that stage."""
        del loss
        return state.incumbent.rival

    def incumbent(self, state: TrainingState) -> Incumbent:
        """The best model so far, compared by what it becomes."""
        return Incumbent(state.best, state.memory, state.origin, state.weighing, rival=state.incumbent.rival)
