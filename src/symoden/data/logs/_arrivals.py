"""Time stamps that tell when rows arrived, not when they were taken: these go back onto an even clock."""

import dataclasses
from typing import Final

import numpy as np

from symoden.data._errors import DataError
from symoden.data._findings import Finding
from symoden.data._shapes import Times
from symoden.data.signals import longest_step, whole_steps

from ._clock_notes import Arrivals
from ._logs import Log

_AT_ONCE: Final = 0.1  # Of the mean step: no sensor that takes its samples so soon after each other waits as long then.
_FEWEST, _OFTEN = 10, 0.02  # Rows that come at once with those before: how many, and which share.
_ALIKE: Final = 0.5  # What positions move in such a step, relative to what they do in others.
_MOST_LOST: Final = 0.3  # Share of the rows.
_CANDIDATES: Final = 400
_SCATTER: Final = 0.5  # Of delays, relative to the usual wait; between 0 and that they would scatter by 0.29.
_LONGER: Final = 1.1  # Step of a clock, relative to the mean step of stamps, that is no rounding.


def on_even_clock(log: Log, dt: float | None) -> Log:
    """Put rows of which several often arrived at once back onto the even clock that they were taken by.

    A program that waits for messages stamps them when it gets to them: some come at once, after a while without any.
    So do rows whose stamps are rounded so coarsely that some are equal.
    If positions move as far between two that came at once as between others, the stamps cannot be right.
    Each row is taken to be the latest that its stamp allows, none at the same tick as another (`even_times`). Where a
    row is lost its tick stays empty; gaps remain.

    Args:
        log: What was logged.
        dt: Step of the clock [s], if it is known: then stamps are of arrival whatever they look like.

    Returns:
        The log with the clock's times, and `arrivals` if the step was not known; the same log where the stamps may be
        right, or do not tell.

    Raises:
        DataError: If there are more rows than ticks of the clock.
    """
    known = np.flatnonzero(np.isfinite(log.ts))
    ts = log.ts[known]
    steps = np.diff(ts)
    if (steps < 0).any() or not steps.any():
        return log
    usual = steps[steps <= longest_step(steps)]
    mean = float(np.mean(usual))
    together = np.flatnonzero(steps < _AT_ONCE * mean)
    if dt is None:
        told = len(together) >= max(_FEWEST, _OFTEN * len(steps))
        if not told or not _moves_as_far(log.q[known], together):
            return log
    elif dt > _LONGER * mean:
        raise DataError(
            f"{log.time_column}: where `dt` is given beside `time`, rows must be taken once in that time, or less "
            f"often; got one in {mean:.4g} s for `dt` = {dt:g}. Correct `dt`, or leave it out."
        )
    step = dt or _step_of_clock(ts, mean, wait=float(np.mean(usual[usual >= _AT_ONCE * mean])))
    times = log.ts.copy()
    times[known] = even_times(ts, step)
    return dataclasses.replace(log, ts=times, arrivals=None if dt else Arrivals(step, len(together)))


def find_arrivals(log: Log) -> list[Finding]:
    """Say that the time stamps were those of arrival.

    Args:
        log: What was logged, on an even clock.

    Returns:
        The finding, or none.
    """
    if log.arrivals is None:
        return []
    step, together = log.arrivals
    (name,) = log.names["time"]
    return [
        Finding(
            kind="clocks",
            level="note",
            channel=name,
            text=f"{together} of {len(log)} rows arrived at once with the one before, and positions move as far "
            f"between these as between others: `{name}` tells when rows arrived; they are put onto an even clock of "
            f"{1000 * step:.3g} ms",
            advice="If you know how often the sensor measures, write the step beside `time`, such as "
            f"`dt = {step:.3g}`; rows that were lost make the guess uncertain.",
        )
    ]


def even_times(ts: Times, step: float) -> Times:
    """Ticks of an even clock at which rows were taken that arrived at or after them.

    Args:
        ts: When rows arrived [s], in their order.
        step: Time from tick to tick [s].

    Returns:
        The latest ticks of which no two rows have the same [s].
    """
    rows = np.arange(len(ts))
    ticks = whole_steps(ts - ts[0], step)
    return ts[0] + step * (np.minimum.accumulate((ticks - rows)[::-1])[::-1] + rows)


def _moves_as_far(q: np.ndarray, together: np.ndarray) -> bool:
    """Whether positions move in steps of no time about as far as in others; medians do not see wraps of angles."""
    moves = np.abs(np.diff(q, axis=0))
    complete, at_once = np.isfinite(moves).all(axis=1), np.zeros(len(moves), bool)
    at_once[together] = True
    if not (complete & at_once).any() or not (complete & ~at_once).any():
        return False
    here, there = (np.median(moves[complete & which], axis=0) for which in (at_once, ~at_once))
    moving = there > 0
    return bool(moving.any()) and float(np.median(here[moving] / there[moving])) >= _ALIKE


def _step_of_clock(ts: Times, mean: float, *, wait: float) -> float:
    """The longest step of a clock on which delays do not grow: the mean step, or less where rows were lost."""
    steps = mean * np.linspace(1, 1 - _MOST_LOST, _CANDIDATES)
    return float(next((step for step in steps if np.std(ts - even_times(ts, step)) <= _SCATTER * wait), steps[-1]))
