"""Positions that have another zero in one file, from which forces seem to be turned or to have another unit."""

import dataclasses
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._trajectory import Trajectory

from ._changes import Change

_MOST_TURNED: Final = 0.5  # [rad] of an angle: joints are homed, or begin, not farther off than that.
_MOST_MOVED: Final = 0.25  # The same of lengths, of the range of all recordings.
_ROUNDS: Final = 5  # Of Gauss–Newton: forces are smooth in so small an offset.
_SMALL: Final = 1e-3  # Of the most, for a difference quotient.


class Zero(NamedTuple):
    """A position that may have another zero in a file.

    Attributes:
        which: Its number, from 0 on.
        name: Its column.
        unit: What it is measured in; empty if that is not known.
        most: How far off its zero may be.
    """

    which: int
    name: str
    unit: str
    most: float

    def moved(self, offset: float) -> Change:
        """The change that adds an offset to it in a file."""

        def mend(each: Trajectory) -> Trajectory:
            return dataclasses.replace(each, q=each.q + offset * (np.arange(each.q.shape[1]) == self.which))

        how = "added to" if offset > 0 else "taken from"
        by = f"{abs(offset):.2g} {self.unit}".rstrip()
        return Change("zero", self.name, f"{by} is {how} `{self.name}`", mend)


def zeros_of(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> list[Zero]:
    """Lay out which positions may have another zero in a file.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        All that move.
    """
    ranges = np.ptp(np.concatenate([each.q for each in dataset.recordings]), axis=0)
    most = np.where(is_angle, _MOST_TURNED, _MOST_MOVED * ranges).tolist()
    of_each = zip(dataset.position_names, dataset.position_units, most, strict=True)
    return [Zero(i, *each) for i, each in enumerate(of_each) if ranges[i] > 0]


def best_offset(zero: Zero, residuals: Callable[[Change], Float[np.ndarray, " k"]]) -> Change | None:
    """The offset by which accelerations are told best, by Gauss–Newton from none on.

    Args:
        zero: The position that is moved.
        residuals: What a law leaves of accelerations with a change.

    Returns:
        The change; nothing where it would be too far off, or where forces do not depend on it.
    """
    offset, step = 0.0, _SMALL * zero.most
    for _ in range(_ROUNDS):
        now = residuals(zero.moved(offset))
        slope = (residuals(zero.moved(offset + step)) - now) / step
        if not (size := float(slope @ slope)):
            return None
        offset -= float(slope @ now) / size
        if abs(offset) > zero.most:
            return None
    return zero.moved(offset)
