"""What a stage of Levenberg-Marquardt begins with."""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from symoden.blocks import DIRECTIONS, FRICTION, silenced
from symoden.mechanics import AbstractDynamics

from ._flatten import freed
from ._state import TrainingState


class AbstractBeginning(abc.ABC):
    """What a stage begins with."""

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

    def free(self, model: AbstractDynamics, before: AbstractDynamics) -> int:
        """Which corrections are free whatever the stage sets free, as flags.

        Args:
            model: The model now.
            before: The best one before the stage.

        Returns:
            Their kinds.
        """
        del before
        return freed(model)

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
class Without(AbstractBeginning):
    """The best model so far, some of its corrections zero again.

    Attributes:
        kinds: Which, as flags.
    """

    kinds: int

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The model without them."""
        del loss
        return silenced(state.best, self.kinds)

    def applies(self, state: TrainingState) -> bool:
        """Whether one of them is free."""
        return bool(self.kinds & freed(state.best))


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

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The untrained model."""
        del state, loss
        return self.fresh

    def free(self, model: AbstractDynamics, before: AbstractDynamics) -> int:
        """What is free of both."""
        return freed(model) | freed(before) & ~(FRICTION | DIRECTIONS)

    def anew(self, fresh: AbstractDynamics) -> "Untrained":
        """Another draw."""
        return Untrained(fresh)


@final
@dataclass(frozen=True)
class Refitted(AbstractBeginning):
    """What the stage before has made of the same recordings alone."""

    def model(self, state: TrainingState, loss: Callable[[AbstractDynamics], float]) -> AbstractDynamics:
        """The rival of that stage."""
        del loss
        return state.incumbent.rival
