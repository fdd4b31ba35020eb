"""A table's column of time stamps that a description does not name."""

import re
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from symoden.data._errors import DataError

from ._cells import numbers

_NAME: Final = re.compile(r"(.*[_/. ])?(time|t|ts|timestamp|time_?stamp|stamp|clock|secs?|seconds)([_ ([].*)?", re.I)
_MOSTLY: Final = 0.95  # Share of rows in which time goes on: in a table of several recordings it may begin anew.
_EVEN: Final = 3.0  # Large steps over small ones, of time and of rows, up to which it goes on like a clock.


class UnreadClock(NamedTuple):
    """A column that counts time, and is not read.

    Attributes:
        name: Its name.
        steps: By how much it goes on from row to row, in its own unit: in the median, and in the mean, which rounded
            stamps keep.
    """

    name: str
    steps: tuple[float, float]


def unread_clock(path: Path, frame: pl.DataFrame) -> UnreadClock | None:
    """Find a column that is called as time is, and goes on evenly. One that counts rows is none.

    Args:
        path: File of the table, for messages.
        frame: The table.

    Returns:
        The first such column; none where there is none.
    """
    for name in filter(_NAME.fullmatch, frame.columns):
        try:
            stamps = numbers(path, frame, [name], first_row=0)[name]
        except DataError:
            continue
        steps = np.diff(stamps[np.isfinite(stamps)])
        rows = np.flatnonzero(steps > 0)
        if len(rows) < 2 or (steps >= 0).mean() < _MOSTLY or (steps == 1).all():
            continue
        on = steps[rows]
        if _is_even(on) and _is_even(np.diff(rows)):
            return UnreadClock(name, (float(np.median(on)), float(on.sum() / (steps >= 0).sum())))
    return None


def _is_even(steps: np.ndarray) -> bool:
    """Whether most steps are alike: a temperature that rises is in no hurry, and then it is."""
    small, large = np.quantile(steps, (0.1, 0.9))
    return bool(large <= _EVEN * small)
