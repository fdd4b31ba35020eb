"""Windows left out in turn: what judges models of few numbers where few windows validate."""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Int

from symoden.mechanics import AbstractDynamics

from ._data import Data
from ._flatten import Flattening
from ._levenberg_marquardt import LevenbergState, LevenbergStep
from ._objective import AbstractObjective, Batch
from ._stages import Clock, OutOfTime, never
from ._verdicts import Judge, Verdict, by_windows, window_losses

_FOLDS: Final = 5
_STALLED: Final = 0.01  # Relative decrease of the loss in a step that counts as none.
_PATIENCE: Final = 2


class Contender(NamedTuple):
    """A model that can be fitted to other windows.

    Attributes:
        model: The model, fitted to all training windows.
        corrections: Which kinds of them are free, as flags.
        step: A step of Levenberg-Marquardt.
        steps: How many of them at most.
        damping: Of the first one.
    """

    model: AbstractDynamics
    corrections: int
    step: Callable[[LevenbergState, Flattening, Batch], tuple[LevenbergState, LevenbergStep]]
    steps: int
    damping: float

    def refitted(self, windows: Batch, is_over: Clock = never) -> AbstractDynamics:
        """The model fitted to these windows.

        It goes on from where it is: another start may end in another basin, which says nothing of the laws that are
        asked for. Of a few numbers that all of these windows determine nothing is left of what others have taught.

        Args:
            windows: What to fit.
            is_over: Whether the time is over.

        Returns:
            The model.

        Raises:
            OutOfTime: If the time is over before it is fitted.
        """
        restore, theta = Flattening.of(self.model, corrections=self.corrections, dtype=windows.q.dtype)
        state, stale = LevenbergState(theta, self.damping), 0
        for _ in range(self.steps):
            if is_over():
                raise OutOfTime
            state, done = self.step(state, restore, windows)
            stale = 0 if done.falls_by(_STALLED) else stale + 1
            if stale == _PATIENCE:
                break
        return restore(state.theta)


def by_left_out(
    data: Data,
    ours: Contender,
    theirs: Contender,
    objective: AbstractObjective,
    *,
    wanted: float,
    is_over: Clock = never,
) -> Verdict:
    """The verdict of windows that are left out, on a model and another that it had to improve on.

    Both are fitted to four fifths of the training windows at a time, and judged by the others; the windows of
    validation, which neither was fitted to, count as well.

    Args:
        data: The windows.
        ours: The model.
        theirs: The one before.
        objective: What errors count.
        wanted: By more than so many standard errors it has to be better.
        is_over: Whether the time is over.

    Returns:
        The verdict.

    Raises:
        OutOfTime: If the time is over before it is found.
    """
    assert data.validation is not None
    here, there = (window_losses(each.model, objective, data.validation) for each in (ours, theirs))
    for fitted, left_out in _folds(data.train):
        losses = (window_losses(each.refitted(fitted, is_over), objective, left_out) for each in (ours, theirs))
        here, there = (np.concatenate(pair) for pair in zip((here, there), losses, strict=True))
    return by_windows(Judge.LEFT_OUT, here, there, wanted=wanted)


def _folds(windows: Batch) -> Iterator[tuple[Batch, Batch]]:
    """Windows without some in a row, and these.

    Yields:
        What to fit and what is left out.
    """
    every = np.arange(windows.ts.shape[0])
    for left_out in np.array_split(every, min(_FOLDS, len(every))):
        yield without(windows, left_out), windows.take(left_out)


def without(windows: Batch, left_out: Int[np.ndarray, " k"]) -> Batch:
    """Windows without some of them.

    So many of the others come twice that there are as many as before: another number would be another program.

    Args:
        windows: All of them.
        left_out: Indices of those that are to be left out, not all.

    Returns:
        The others, in their order.
    """
    others = np.setdiff1d(np.arange(windows.ts.shape[0]), left_out)
    twice = others[np.linspace(0, len(others) - 1, len(left_out)).round().astype(int)]
    return windows.take(np.sort(np.concatenate([others, twice])))
