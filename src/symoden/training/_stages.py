"""What a stage of training is: it advances one state by one checkpointable stride."""

import abc
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

from symoden.mechanics import AbstractDynamics

from ._state import Report, TrainingState
from ._verdicts import Verdict

EXPLAINED: Final = 1e-6  # Mean squared residual, relative to the motion, below which no block need grow.
EXACT: Final = 1e-11  # The same below which no measurement could tell the model from the truth.


Clock: TypeAlias = Callable[[], bool]
"""Says whether the time is over."""


class OutOfTime(Exception):  # noqa: N818 - It is no error: what was before the stride stands.
    """The time is over in the middle of a stride."""


def never() -> bool:
    """No time limit."""
    return False


class AbstractStage(abc.ABC):
    """One stage of training.

    Attributes:
        name: What reports call it.
        steps: Largest number of steps.
    """

    name: str
    steps: int

    def applies(self, state: TrainingState) -> bool:
        """Whether the stages before have left it something to do.

        Args:
            state: State at the end of the one before.

        Returns:
            Whether they have; else it is passed over.
        """
        del state
        return True

    def anew(self, fresh: AbstractDynamics) -> "AbstractStage":
        """The same stage for another draw of weights.

        Args:
            fresh: Untrained model.

        Returns:
            The stage that begins with it, where it begins with an untrained model.
        """
        del fresh
        return self

    @abc.abstractmethod
    def start(self, state: TrainingState) -> TrainingState:
        """State at the beginning of this stage, from the end of the one before."""

    @abc.abstractmethod
    def advance(self, state: TrainingState, is_over: Clock = never) -> tuple[TrainingState, Report]:
        """Take one stride.

        Args:
            state: Where to start.
            is_over: Whether the time is over, which a stride that takes long asks now and then.

        Returns:
            The state after it, and what it did.

        Raises:
            OutOfTime: If the time is over before the stride is.
        """

    @abc.abstractmethod
    def settled(self, state: TrainingState) -> tuple[TrainingState, Verdict | None]:
        """State with the best model so far, where training stops before the stage has ended; and the verdict on it."""


def names_of(stages: Sequence[AbstractStage]) -> list[str]:
    """What reports call stages.

    Args:
        stages: Some of them.

    Returns:
        Their names.
    """
    return [stage.name for stage in stages]
