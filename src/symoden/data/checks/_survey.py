"""Which rows of every log are used, what is wrong with them, and which velocities are not taken as they are."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symoden.data._errors import DataError
from symoden.data._findings import Finding
from symoden.data.description import Description
from symoden.data.logs import (
    BlindSpot,
    Facts,
    Log,
    Mask,
    StuckRows,
    blind_spots,
    bridge,
    find_stuck_rows,
    measure,
    rows_to_use,
)

from ._examine import Examination, examine
from ._late import replace_late
from ._lone_inputs import ask_motion, find_lone_inputs, lone_inputs, without_wrong
from ._mismatch import find_wrong_clock


class Survey(NamedTuple):
    """What was found out about logs before recordings are made of them.

    Attributes:
        used: The logs as they are used: inputs bridged, without velocities where these are estimated.
        rows: Which of each one's rows are used, or why none are.
        examinations: What was found in each.
        replaced: That velocities are estimated although they were logged, if so.
    """

    used: tuple[Log, ...]
    rows: list[Mask | DataError]
    examinations: tuple[Examination, ...]
    replaced: Finding | None


def survey(logs: Sequence[Log], description: Description, is_angle: np.ndarray) -> Survey:
    """Examine logs, and choose which of their rows and velocities are used.

    Args:
        logs: What was logged, on one clock each.
        description: What it means.
        is_angle: Whether each coordinate is an angle.

    Returns:
        What was found; that a log cannot be used is for the caller to raise or to report.
    """
    spots = blind_spots(logs, is_angle, description.blind)
    logs = [bridge(log, description) for log in logs]
    measured = [_measured(log, description, is_angle, spots) for log in logs]
    lone = [lone_inputs(facts) for _, facts in measured]
    lone = ask_motion(logs, [chosen for chosen, _ in measured], lone, description, is_angle)
    for i, each in enumerate(lone):
        if any(len(one.wrong.rows) for one in each):
            logs[i] = without_wrong(logs[i], each, description)
            measured[i] = _measured(logs[i], description, is_angle, spots)
    rows = [chosen for chosen, _ in measured]
    clock = find_wrong_clock([facts for _, facts in measured if facts], description)
    examined = [
        examine(facts, description, find_lone_inputs(log, each), clock=clock)
        for log, (_, facts), each in zip(logs, measured, lone, strict=True)
    ]
    used, examined, replaced = replace_late(logs, examined, description)
    if replaced:  # What velocities lacked is lacking no more.
        rows = [
            _rows(log, description, is_angle, spots, _stuck(chosen)) for log, chosen in zip(used, rows, strict=True)
        ]
    return Survey(used, rows, examined, replaced)


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
