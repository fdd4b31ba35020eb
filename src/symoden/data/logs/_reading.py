"""Everything that the files of a description hold, on one clock each, and what of them cannot be read."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symoden.data._errors import DataError
from symoden.data.description import Description, Unreadable

from ._arrivals import on_even_clock
from ._logs import Log, read_logs
from ._merged import on_one_clock
from ._overlaps import find_overlaps
from ._polled import on_new_readings
from ._wraps import unwrapped_clock


class Reading(NamedTuple):
    """What the files of a description hold.

    Attributes:
        logs: What was logged, on one clock each, part by part, in the order of the files.
        unreadable: What of the files cannot be read, in the same order.
        refusals: What the description says of the parts that is not so, and rows that two of them have in common.
    """

    logs: tuple[Log, ...]
    unreadable: tuple[Unreadable, ...]
    refusals: tuple[DataError, ...]


def read_all(description: Description, is_angle: np.ndarray) -> Reading:
    """Read the files of a description, and bring each log to one clock, which is even where stamps are of arrival.

    Args:
        description: What it says.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The logs; that a file cannot be read is for the caller to raise or to report.
    """
    found, refusals = read_logs(description)
    overlaps = find_overlaps(description, [one for one in found if isinstance(one, Log)])
    every = [_on_clock(one, description, is_angle) for one in _with_same_inputs(found, description)]
    return Reading(
        logs=tuple(one for one in every if isinstance(one, Log)),
        unreadable=tuple(one for one in every if isinstance(one, Unreadable)),
        refusals=(*refusals, *overlaps),
    )


def _with_same_inputs(found: Sequence[Log | Unreadable], description: Description) -> list[Log | Unreadable]:
    """Refuse logs that have more or fewer inputs than most, as a variable of another width has."""
    counts = Counter(one.us.shape[1] for one in found if isinstance(one, Log))
    usual = counts.most_common(1)[0][0] if counts else 0
    return [
        _unreadable(
            one,
            DataError(
                f"`{one.path}`: `{description.inputs}` must have as many columns as in most files, {usual}; got "
                f"{one.us.shape[1]}. Name those to read, such as `{description.inputs}[0]`, or leave the file out."
            ),
        )
        if isinstance(one, Log) and one.us.shape[1] != usual
        else one
        for one in found
    ]


def _on_clock(one: Log | Unreadable, description: Description, is_angle: np.ndarray) -> Log | Unreadable:
    """A log on one clock, or why it has none."""
    if isinstance(one, Unreadable):
        return one
    step = None if description.time is None else description.dt
    try:
        counted = unwrapped_clock(one, description.units)
        alone = on_new_readings(on_one_clock(counted, is_angle, description.hold), is_angle, description.hold)
        return on_even_clock(alone, step)
    except DataError as error:
        return _unreadable(one, error)


def _unreadable(log: Log, error: DataError) -> Unreadable:
    """A log that turns out to be none."""
    return Unreadable(part=log.part, name=log.name, path=log.path, error=error)
