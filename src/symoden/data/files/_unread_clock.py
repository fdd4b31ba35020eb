"""A table's columns of time stamps that a description does not name."""

import re
from collections.abc import Collection
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from ._cells import known_numbers

_NAME: Final = re.compile(  # No `T`, which is a torque or a temperature.
    r"(.*[_/. ])?((?-i:ts?)|time|timestamp|time_?stamp|stamp|clock|secs?|seconds)([_ ([].*)?", re.IGNORECASE
)
_MOSTLY: Final = 0.95  # Share of rows in which time goes on: in a table of several recordings it may begin anew.
_EVEN: Final = 3.0  # Large steps over small ones, of time and of rows, up to which it goes on like a clock.


class UnreadClock(NamedTuple):
    """A column that counts time, and is not read.

    Attributes:
        name: Its name.
        steps: By how much it goes on from row to row, in its own unit: in the median, and in the mean, which rounded
            stamps keep.
        whole: Whether it has whole numbers alone, and may count rows or ticks as well.
    """

    name: str
    steps: tuple[float, float]
    whole: bool


def unread_clocks(path: Path, frame: pl.DataFrame, read: Collection[str]) -> tuple[UnreadClock, ...]:
    """Find columns that are called as time is, and go on evenly.

    Args:
        path: File of the table, for messages.
        frame: The table.
        read: Names of the columns that are read.

    Returns:
        The columns.
    """
    found = (_clock(path, frame, name) for name in frame.columns if name not in read and _NAME.fullmatch(name))
    return tuple(clock for clock in found if clock is not None)


def _clock(path: Path, frame: pl.DataFrame, name: str) -> UnreadClock | None:
    """The clock that a column is, if it is one."""
    stamps = known_numbers(path, frame, name)
    steps = np.diff(stamps)
    rows = np.flatnonzero(steps > 0)
    if len(rows) < 2 or (steps >= 0).mean() < _MOSTLY or not (_is_even(steps[rows]) and _is_even(np.diff(rows))):
        return None
    usual = float(np.median(steps[rows])), float(steps[rows].sum() / (steps >= 0).sum())
    return UnreadClock(name, usual, bool((stamps % 1 == 0).all()))


def _is_even(steps: np.ndarray) -> bool:
    """Whether most steps are alike: a temperature that rises is in no hurry, and then it is."""
    small, large = np.quantile(steps, (0.1, 0.9))
    return bool(large <= _EVEN * small)
