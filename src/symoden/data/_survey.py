"""Which rows of every log are used, what is wrong with them, and which velocities are not taken as they are."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ._arrivals import on_even_clock
from ._blind import BlindSpot, blind_spots
from ._description import Description
from ._errors import DataError
from ._examine import Examination, examine
from ._facts import Facts, measure
from ._findings import Finding
from ._late import replace_late
from ._logs import Log, read_logs
from ._masking import Mask
from ._merged import on_one_clock
from ._mismatch import find_wrong_clock
from ._recordings import rows_to_use
from ._stuck import StuckRows, find_stuck_rows


class Survey(NamedTuple):
    """What was found out about logs before recordings are made of them.

    Attributes:
        logs: What was logged, on one clock each.
        used: The logs as they are used, without velocities where these are estimated.
        rows: Which of each one's rows are used, or why none are.
        examinations: What was found in each.
        replaced: That velocities are estimated although they were logged, if so.
    """

    logs: tuple[Log, ...]
    used: tuple[Log, ...]
    rows: list[Mask | DataError]
    examinations: tuple[Examination, ...]
    replaced: Finding | None


def survey(path: Path, description: Description, is_angle: np.ndarray) -> Survey:
    """Read the logs of a description, examine them, and choose which of their rows and velocities are used.

    Args:
        path: The description's file.
        description: What it says.
        is_angle: Whether each coordinate is an angle.

    Returns:
        What was found; that a log cannot be used is for the caller to raise or to report.

    Raises:
        DataError: If a file cannot be read, lacks a column, or one part has rows of another one.
    """
    logs = read_on_clocks(path, description, is_angle)
    spots = blind_spots(logs, is_angle, description.blind)
    measured = [_measured(log, description, is_angle, spots) for log in logs]
    rows = [chosen for chosen, _ in measured]
    clock = find_wrong_clock([facts for _, facts in measured if facts], description)
    examined = [examine(facts, description, clock=clock) for _, facts in measured]
    used, examined, replaced = replace_late(logs, examined, description)
    if replaced:  # What velocities lacked is lacking no more.
        rows = [
            _rows(log, description, is_angle, spots, _stuck(chosen)) for log, chosen in zip(used, rows, strict=True)
        ]
    return Survey(logs, used, rows, examined, replaced)


def read_on_clocks(path: Path, description: Description, is_angle: np.ndarray) -> tuple[Log, ...]:
    """Read the logs of a description, and bring each to one clock, which is even where stamps are of arrival.

    Args:
        path: The description's file.
        description: What it says.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The logs.

    Raises:
        DataError: If a file cannot be read, lacks a column, or its clocks have nothing in common.
    """
    step = None if description.time is None else description.dt
    logs = read_logs(path, description)
    return tuple(on_even_clock(on_one_clock(log, is_angle, description.hold), step) for log in logs)


def _measured(
    log: Log, description: Description, is_angle: np.ndarray, spots: tuple[BlindSpot, ...]
) -> tuple[Mask | DataError, Facts | None]:
    """Which rows of a log are used, and what is measured of them; of all that are complete, where none are used."""
    chosen = _rows(log, description, is_angle, spots)
    if isinstance(chosen, DataError):
        return chosen, measure(log, description, is_angle, np.arange(0))
    facts = measure(log, description, is_angle, chosen.left_out)
    stuck = find_stuck_rows(facts) if facts else ()
    if stuck and isinstance(again := _rows(log, description, is_angle, spots, stuck), Mask):
        return again, measure(log, description, is_angle, again.left_out)
    return chosen, facts


def _stuck(chosen: Mask | DataError) -> tuple[StuckRows, ...]:
    """Rows of a log that are left out because a sensor is stuck."""
    return chosen.stuck if isinstance(chosen, Mask) else ()


def _rows(
    log: Log,
    description: Description,
    is_angle: np.ndarray,
    spots: tuple[BlindSpot, ...],
    stuck: tuple[StuckRows, ...] = (),
) -> Mask | DataError:
    """Which rows of a log are used, or why none are: it may do without its velocities."""
    try:
        return rows_to_use(log, description, is_angle, spots, stuck)
    except DataError as error:
        return error
