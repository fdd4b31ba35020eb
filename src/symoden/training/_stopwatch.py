"""Reports of how far training is, and what ends it early."""

import itertools
import math
import time
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from symoden.wording import first_few, number

_NAMED: Final = 3  # Stages to come that are named; there may be twenty.


class Progress(NamedTuple):
    """How far training is; its string says it in a line.

    Attributes:
        stage: Name of the stage.
        step: Steps done in it.
        steps: Its largest number of steps.
        loss: Training loss.
        validation: Validation loss; None without validation data.
        seconds: Time spent [s], earlier runs included.
        outcome: At the end of a stage: why it ended, in words.
        verdict: At the end of a stage that has to gain something: whether it is kept or was skipped, in words.
    """

    stage: str
    step: int
    steps: int
    loss: float
    validation: float | None
    seconds: float
    outcome: str = ""
    verdict: str = ""

    def __str__(self) -> str:
        """In a line."""
        return f"{self.stage} {self.step}/{self.steps}  {self.losses}  {self.seconds:.0f} s"

    @property
    def losses(self) -> str:
        """Losses, and what came of the stage, in words."""
        validation = "" if self.validation is None else f"  validation {number(self.validation)}"
        verdict = f"  {self.verdict}" if self.verdict else ""
        return f"loss {number(self.loss)}{validation}{verdict}"


def ignore(progress: Progress) -> None:
    """Report nothing."""
    del progress


class Stopwatch:
    """Time spent on training, that of earlier runs included, and what ends this run early: a limit, or who follows."""

    def __init__(self, max_minutes: float | None, progress: Callable[[Progress], object] = ignore) -> None:
        """Start it.

        Args:
            max_minutes: Largest time from now on, if any.
            progress: Called with every report; where it raises `StopIteration`, the run ends.

        Raises:
            ValueError: If the time is not positive.
        """
        if max_minutes is not None and not max_minutes > 0:
            raise ValueError(f"`max_minutes` must be positive; got {max_minutes}. None is no limit.")
        self._progress = progress
        self._asked = False
        self.spent = 0.0  # In earlier runs [s].
        self._started = time.monotonic()
        self._limit = math.inf if max_minutes is None else max_minutes
        self._ends = [0.0]  # Of the steps so far [s].

    @property
    def seconds(self) -> float:
        """Time spent [s]."""
        return self.spent + time.monotonic() - self._started

    def report(self, now: Progress) -> None:
        """Say how far training is, and hear whether that will do.

        Args:
            now: How far it is.
        """
        try:
            self._progress(now)
        except StopIteration:  # As SciPy's callbacks do; what is returned may be anything, as of a progress bar.
            self._asked = True

    def is_up(self) -> bool:
        """Whether the run is to end now."""
        return self._asked or time.monotonic() - self._started >= 60 * self._limit

    def is_over(self) -> bool:
        """Whether the run is to end, or the time would be up before another step has ended; to be asked after each one.

        Returns:
            Whether it is so. Of the last two steps the shorter one tells: what compiles first takes long once.
        """
        now = time.monotonic() - self._started
        self._ends = [*self._ends[-2:], now]
        steps = [end - start for start, end in itertools.pairwise(self._ends)]
        return self._asked or now + (min(steps) if len(steps) > 1 else 0.0) >= 60 * self._limit

    def outcome(self, left: Sequence[str], gone: int = 0) -> str:
        """How training ended when it is.

        Args:
            left: Names of the stages that have not ended.
            gone: How many have.

        Returns:
            The outcome in words.
        """
        names = first_few(dict.fromkeys(left), _NAMED)
        limit = f"at the time limit of {self._limit:g} minute{'' if self._limit == 1 else 's'}"
        why = "by `progress`" if self._asked else limit
        how_far = f" after {gone} of {gone + len(left)} stages" if gone else ""
        return f"stopped {why}{how_far}, with {names} still to come"
