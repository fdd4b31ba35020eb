"""A table's columns of forces and torques that a description does not read."""

import re
from collections.abc import Collection
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from ._cells import known_numbers

_WORDS: Final = (
    {"effort", "efforts", "torque", "torques", "tau", "force", "forces", "current", "currents"}
    | {"voltage", "volt", "volts", "pwm", "duty", "command", "cmd", "input", "u", "thrust", "throttle"}
)  # fmt: skip
_OTHERS: Final = (
    {"battery", "supply", "bus", "time", "temp", "temperature", "limit", "max", "min", "state", "id"}
    | {"pos", "position", "vel", "velocity", "angle"}
)  # fmt: skip


def unread_inputs(path: Path, frame: pl.DataFrame, read: Collection[str]) -> tuple[str, ...]:
    """Find columns that are called as what drives a machine, and change.

    Args:
        path: File of the table, for messages.
        frame: The table.
        read: Names of the columns that are read.

    Returns:
        Their names.
    """
    return tuple(name for name in frame.columns if name not in read and _drives(name) and _changes(path, frame, name))


def _drives(name: str) -> bool:
    """Whether a name has a word for what drives a machine, and none that says of what else it is."""
    words = set(re.split(r"[^a-z]+", name.lower()))
    return bool(words & _WORDS) and not words & _OTHERS


def _changes(path: Path, frame: pl.DataFrame, name: str) -> bool:
    """Whether a column has numbers, and not one alone."""
    known = known_numbers(path, frame, name)
    return bool(len(known)) and bool(np.ptp(known) > 0)
