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
    """Find a column that is called as time is, and goes on from row to row. One that counts rows is none.

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
        on = steps[steps > 0]
        if len(on) and (steps >= 0).mean() >= _MOSTLY and not (steps == 1).all():
            return UnreadClock(name, (float(np.median(on)), float(on.sum() / (steps >= 0).sum())))
    return None
