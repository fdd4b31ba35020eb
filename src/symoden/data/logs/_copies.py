"""Rows of one part that another part has too, in a file of its own."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from symoden.data._findings import Finding

from ._logs import Log

_PIECE: Final = 10  # Rows that are looked for together.
_LEAST: Final = 20  # Rows that are equal one after another by no accident.
_NAMED: Final = 3


class _Moving(NamedTuple):
    """Rows of a log in which a position changes, and their numbers as text, as long for each row."""

    log: Log
    rows: np.ndarray
    text: bytes
    width: int

    def piece(self, start: int, size: int = _PIECE) -> bytes:
        """The numbers of some rows; fewer at the end."""
        return self.text[start * self.width : (start + size) * self.width]


_Index: TypeAlias = Mapping[bytes, tuple[_Moving, int]]


def find_copies(logs: Sequence[Log]) -> list[Finding]:
    """Find rows that files of two parts have in common: a test on what was learned from tells nothing.

    Rows are equal whose positions, velocities and inputs are, whatever their time stamps. Those in which no position
    changes do not count: many recordings begin at the same rest. One row of one file in two parts is refused elsewhere.

    Args:
        logs: What was logged.

    Returns:
        One finding for each two parts that have rows in common.
    """
    parts: dict[str, list[_Moving]] = {}
    for log in logs:
        parts.setdefault(log.part, []).append(_moving(log))
    every = (_between(*two) for two in itertools.combinations(parts.items(), 2))
    return [finding for finding in every if finding is not None]


def _between(first: tuple[str, list[_Moving]], second: tuple[str, list[_Moving]]) -> Finding | None:
    """What two parts have in common, if anything."""
    (part, logs), (other_part, others) = first, second
    index: dict[bytes, tuple[_Moving, int]] = {}
    for log in logs:
        for start in range(0, len(log.rows) - _PIECE + 1, _PIECE):
            index.setdefault(log.piece(start), (log, start))
    found = [words for log in others for words in _copied(log, index)]
    if not found:
        return None
    more = f"; and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return Finding(
        kind="copy",
        level="warning",
        channel="",
        text=f"[{other_part}] has rows of [{part}], equal number by number: {'; '.join(found[:_NAMED])}{more}",
        advice="Leave them out of one of the two: a test on what was learned from tells nothing.",
    )


def _copied(log: _Moving, index: _Index) -> Iterator[str]:
    """Words for each stretch of a log that is in another one, too."""
    start = 0
    while start <= len(log.rows) - _PIECE:
        other, there = index.get(log.piece(start), (log, -1))
        count = 0 if there < 0 else _equal(log, start, other, there)
        if count >= _LEAST:
            first, last = (log.log.place(int(log.rows[row])) for row in (start, start + count - 1))
            yield (
                f"`{log.log.path}` from {first} to {last} is `{other.log.path}` from "
                f"{other.log.place(int(other.rows[there]))} on"
            )
        start += count if count >= _LEAST else 1


def _equal(log: _Moving, start: int, other: _Moving, there: int) -> int:
    """How many rows of two logs are equal from one on in each."""
    most = min(len(log.rows) - start, len(other.rows) - there)
    return next((k for k in range(most) if log.piece(start + k, 1) != other.piece(there + k, 1)), most)


def _moving(log: Log) -> _Moving:
    """Rows of a log in which a position is another one than in the row before."""
    numbers = np.ascontiguousarray(np.concatenate(list(log.signals.values()), axis=1)) + 0.0  # No zero is negative.
    q = numbers[:, : log.q.shape[1]]
    rows = 1 + np.flatnonzero((q[1:] != q[:-1]).any(axis=1))
    return _Moving(log, rows, numbers[rows].tobytes(), numbers.itemsize * numbers.shape[1])
