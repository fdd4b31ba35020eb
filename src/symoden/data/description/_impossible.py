"""Numbers that no machine has: too large ones, and those that loggers write where they have none."""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data.files import LARGEST_NUMBER, OddNumbers, Rows, place

from ._units import number_of

_NINES: Final = tuple(10.0**k - 1 for k in range(3, 10))
_FULL: Final = tuple(2.0**k - 1 for k in (15, 16, 31, 32, 63, 64))  # Of counters; below zero they reach one further.
_PLACEHOLDERS: Final = np.array([*_NINES, *(-x for x in _NINES), *_FULL, *(-x - 1 for x in _FULL)])
_ROUNDED: Final = 1e-7  # What a unit's factor and single precision leave of a number, relative to it.
_APART: Final = 10.0  # Times the largest of the other numbers; or their range, where these are off zero, such as
_OFF_ZERO: Final = 3.0  # counts about 2048: then so many times the largest will do.
_RARE: Final = 0.5  # Share of the samples.


@dataclass(frozen=True, kw_only=True, eq=False)
class Impossible:
    """Numbers of one column that no machine has.

    Attributes:
        channel: Name of the column.
        rows: Their rows of the log.
        first: The first of them, in SI or rad; a placeholder as the file has it.
        place: Where that one is in the file.
        columns: Columns of the log that lack them: itself, or those that formulas make of it.
        placeholder: Whether they stand for missing numbers, rather than being too large for any machine.
    """

    channel: str
    rows: np.ndarray
    first: float
    place: str
    columns: tuple[str, ...]
    placeholder: bool = False

    @property
    def kind(self) -> str:
        """What each is, in words."""
        return "a placeholder for a missing number" if self.placeholder else f"a number beyond {LARGEST_NUMBER:g}"

    @property
    def counted(self) -> str:
        """How many there are, in words."""
        several = "s" if len(self.rows) > 1 else ""
        what = (
            f"placeholder{several} for missing numbers"
            if self.placeholder
            else f"number{several} beyond {LARGEST_NUMBER:g}"
        )
        return f"{len(self.rows)} {what}"


def without_impossible(
    rows: Rows, units: Mapping[str, float], zeros: Mapping[str, float]
) -> tuple[Rows, tuple[Impossible, ...]]:
    """Put NaN for every number that no machine has.

    Args:
        rows: Rows of a file, in SI and rad.
        units: What their columns were multiplied by for that, where it is not 1.
        zeros: What was subtracted from them before, where it is not 0.

    Returns:
        The rows, and these numbers, with those of columns that formulas are made of.
    """
    kept = {role: signal.copy() for role, signal in rows.signals.items()}
    found = []
    for role, signal in kept.items():
        for name, column in zip(rows.names[role], signal.T, strict=True):
            raw = column / number_of(name, units, 1.0) + number_of(name, zeros, 0.0)
            odd = odd_numbers(column, None if role == "time" else raw)
            found.extend(_named(rows, OddNumbers(name, (name,), odd)))
            column[np.isfinite(odd)] = np.nan
    of_parts = (each for odd in rows.odd for each in _named(rows, odd))
    return dataclasses.replace(rows, signals=kept, odd=()), (*of_parts, *found)


def odd_numbers(column: Float[np.ndarray, " T"], raw: Float[np.ndarray, " T"] | None) -> Float[np.ndarray, " T"]:
    """Pick the numbers of a column that no machine has.

    Args:
        column: The column, in SI and rad if its unit is known.
        raw: The same as the file has it, where loggers may write something for missing numbers.

    Returns:
        These numbers, placeholders as the file has them; NaN for all others.
    """
    odd = np.where(np.abs(column) > LARGEST_NUMBER, column, np.nan)
    for at, value in () if raw is None else _placeholders(raw):
        odd[at] = value
    return odd


def _named(rows: Rows, odd: OddNumbers) -> Iterator[Impossible]:
    """Those that are too large for any machine, and those that are each placeholder."""
    huge = np.abs(odd.values) > LARGEST_NUMBER
    placeholders = np.unique(odd.values[np.isfinite(odd.values) & ~huge])
    for at in (huge, *(odd.values == value for value in placeholders)):
        if at.any():
            first = np.flatnonzero(at)[0]
            yield Impossible(
                channel=odd.name,
                rows=np.flatnonzero(at),
                first=float(odd.values[first]),
                place=place(rows.path, int(rows.index[first])),
                columns=odd.columns,
                placeholder=at is not huge,
            )


def _placeholders(column: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Rows and value of those numbers, as files have them, that loggers write for missing ones, far from all others."""
    there = np.flatnonzero(np.abs(column) <= LARGEST_NUMBER)
    raw = column[there]
    largest = np.abs(raw).max(initial=0.0)
    for value in _PLACEHOLDERS[np.abs(_PLACEHOLDERS) <= largest * (1 + _ROUNDED)]:
        same = np.abs(raw - value) <= _ROUNDED * abs(value)
        others = raw[~same]
        # A command that is on or off has two values, none of them missing.
        if same.any() and same.mean() < _RARE and _is_far(value, others):
            yield there[same], float(value)


def _is_far(value: float, others: np.ndarray) -> bool:
    """Whether a number is far from all others, which differ from each other."""
    span, largest = np.ptp(others), np.abs(others).max()
    apart = abs(value - np.median(others)) > _APART * span and abs(value) > _OFF_ZERO * largest
    return bool(span > 0 and (apart or abs(value) > _APART * largest))
