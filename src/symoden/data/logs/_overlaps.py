"""Rows that parts name: those that two of them have, from which a test tells nothing, and those that no file has."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from symoden.data._errors import DataError
from symoden.data._findings import Finding
from symoden.data.description import Description

from ._logs import Log


def find_overlaps(description: Description, logs: Sequence[Log]) -> tuple[DataError, ...]:
    """Find rows that two parts have in common.

    Args:
        description: What it says.
        logs: What was logged, with the rows that the files have.

    Returns:
        Why training refuses them: an error for each file and two parts.
    """
    parts = {name: _by_file(description, [log for log in logs if log.part == name]) for name in description.parts}
    names = {description.whereabouts(log.path): log.path for log in reversed(logs)}
    return tuple(
        DataError(
            f"`{description.path}`: [{name}] and [{other}] must have no rows in common; both have rows {shared[0]} to "
            f"{shared[-1]} of `{names[file]}`{_ending(description, file, {name: files[file], other: others[file]})}. "
            "Name other files, other `rows` or `recordings`."
        )
        for (name, files), (other, others) in itertools.combinations(parts.items(), 2)
        for file in files
        if file in others and len(shared := np.intersect1d(files[file], others[file], assume_unique=True))
    )


def find_ended(description: Description, logs: Sequence[Log]) -> list[Finding]:
    """Say which files end before the rows that the description names of them.

    Args:
        description: What it says.
        logs: What was logged, with the rows that the files have.

    Returns:
        One finding for each file and part.
    """
    return [
        Finding(
            kind="missing",
            level="note",
            channel="",
            text=f"[{name}] `rows` name rows of `{file.name}` up to {last}, and it ends after row {index.max()}",
            advice="Nothing need be done, unless the file was cut off: copy it again then.",
        )
        for name in description.parts
        for file, index in _by_file(description, [log for log in logs if log.part == name]).items()
        if (last := _last_beyond(description, name, file, index))
    ]


def _by_file(description: Description, part: Sequence[Log]) -> dict[Path, np.ndarray]:
    """Rows of each file that a part has."""
    found: dict[Path, list[np.ndarray]] = {}
    for log in part:
        where = description.whereabouts(log.path)
        found.setdefault(where, []).extend([log.rows, np.array(log.repeats, dtype=log.rows.dtype)])
    return {path: np.concatenate(each) for path, each in found.items()}


def _ending(description: Description, file: Path, rows: dict[str, np.ndarray]) -> str:
    """That a file ends before rows that a part names, if so: then others are counted from an end that is none."""
    for name, index in rows.items():
        if last := _last_beyond(description, name, file, index):
            return f", which ends before row {last} of [{name}]: perhaps it was cut off"
    return ""


def _last_beyond(description: Description, name: str, file: Path, index: np.ndarray) -> int:
    """The last row that a part names of a file if this ends before; 0 if not, or if rows are those of recordings."""
    part = description.parts[name]
    last = max((stop for _, stop in part.rows_of(file) if stop is not None), default=0)
    told_apart = description.recording is not None or part.recordings
    return last if last > index.max() + 1 and not told_apart else 0
