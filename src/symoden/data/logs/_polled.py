"""Positions that are read more rarely than rows are written: between readings a row repeats the last one."""

import dataclasses
from typing import Final, Literal

import numpy as np
from jaxtyping import Bool

from symoden.data._errors import listing
from symoden.data._findings import Finding
from symoden.data.signals import least_change, quantum

from ._clock_notes import Polled
from ._logs import Log
from ._merged import bring_to, rows_of_positions

_LEAST: Final = 30  # Repeats while the joint moves,
_SHARE: Final = 0.03  # and their share of its readings then.
_ROUNDINGS: Final = 4.0  # Changes on either side by which it certainly moves,
_USUAL: Final = 0.25  # and the part of the usual one that they are at least.
_MOST: Final = 0.95  # Share of repeats by which it is told how long they go on,
_LONGER: Final = 2.0  # and times that what is longer is a rest, or a sensor that is stuck.
_STEADIER: Final = 0.25  # Of deviations from a straight line in rows to those from one in readings.


def on_new_readings(log: Log, is_angle: np.ndarray, hold: Literal["zero", "linear"]) -> Log:
    """Leave out rows in which a position only repeats its last reading.

    A sensor that is polled, sends or filters more slowly than rows are written leaves stairs, of which no model is
    right: the joint seems to stand still and to leap. A joint at rest, and one that moves by less than a step of its
    encoder, repeat positions too; but not between two changes in the same direction that are many steps large. Where
    that is no exception, and readings after longer repeats have gone farther, rows in which nothing was read are left
    out; of a rest that is longer than such repeats, rows as far apart as readings are stay. Inputs are averaged over
    the longer steps, or interpolated. Where readings go on after repeats as if no time had passed, time stamps are
    wrong rather than rows, and nothing is done.

    Args:
        log: What was logged, on a clock that counts on.
        is_angle: Whether each coordinate is an angle.
        hold: What an input is between its samples.

    Returns:
        The log on the rows of readings, with `polled`; the same log where every row has its own, or time stamps are out
        of order.
    """
    if (np.diff(log.ts[np.isfinite(log.ts)]) <= 0).any():
        return log
    fresh = np.stack([_fresh(signal) for signal in log.q.T], axis=1)
    if fresh.all():
        return log
    read = dataclasses.replace(log, q=np.where(fresh, log.q, np.nan))
    base = rows_of_positions(read)
    named = tuple(name for name, each in zip(log.names["positions"], fresh.T, strict=True) if not each.all())
    apart: dict[str, np.ndarray] = {
        "positions": np.count_nonzero(~fresh[base], axis=0) > 0,
        "rates": np.zeros(log.q.shape[1], bool),
        "inputs": np.count_nonzero(np.isfinite(log.us), axis=0) > 0,
    }
    brought, _ = bring_to(read, base, apart, is_angle, hold)
    return dataclasses.replace(brought, polled=Polled(len(log), named))


def find_polled(log: Log) -> list[Finding]:
    """Say that positions were read more rarely than rows were written, if so.

    Args:
        log: What was logged, on the rows of readings.

    Returns:
        The finding, or none.
    """
    if log.polled is None:
        return []
    columns = listing(log.polled.columns)
    repeat = "repeats its" if len(log.polled.columns) == 1 else "repeat their"
    return [
        Finding(
            kind="time",
            level="masked",
            channel=log.polled.columns[0] if len(log.polled.columns) == 1 else "",
            text=f"{columns} {repeat} last reading in many rows while the machine moves, as of a sensor that is read "
            f"more rarely than rows are written: {len(log)} of {log.polled.rows} rows, those of new readings, are used",
            advice="Nothing need be done: inputs act as their mean over the longer steps. Better still, log what a "
            "sensor reads when it reads it.",
        )
    ]


def _fresh(signal: np.ndarray) -> Bool[np.ndarray, " T"]:
    """Rows in which a position has a reading of its own."""
    fresh = np.append(True, signal[1:] != signal[:-1])  # What is missing repeats nothing.
    first = np.flatnonzero(fresh)
    lengths = np.diff(first, append=len(signal))
    every_row = np.ones(len(signal), bool)
    if np.count_nonzero(lengths > 1) < _LEAST:
        return every_row
    moves = _moves(signal[first])
    repeats = lengths[moves & (lengths > 1)]
    if len(repeats) < max(_LEAST, _SHARE * np.count_nonzero(moves)):
        return every_row
    every = int(np.median(lengths[moves]))
    regular = every > 1 and np.mean(lengths[moves] == every) > _MOST
    if not regular and not _is_steadier(first.astype(float), signal[first], moves):
        return every_row
    long = lengths > _LONGER * np.quantile(repeats, _MOST, method="higher")
    for start, length in zip(first[long], lengths[long], strict=True):
        fresh[start : start + length : every] = True
    return fresh


def _moves(readings: np.ndarray) -> Bool[np.ndarray, " R"]:
    """Which readings differ from both neighbours by much, in the same direction."""
    changes = np.diff(readings, prepend=np.nan, append=np.nan)
    known = np.abs(changes[np.isfinite(changes)])
    if not len(known):
        return np.zeros(len(readings), bool)
    there = readings[np.isfinite(readings)]
    step = max(quantum(there), least_change(there))
    least = max(_ROUNDINGS * step, _USUAL * float(np.median(known)))
    before, after = changes[:-1], changes[1:]
    return (np.minimum(np.abs(before), np.abs(after)) >= least) & (before * after > 0)


def _is_steadier(rows: np.ndarray, readings: np.ndarray, moves: Bool[np.ndarray, " R"]) -> bool:
    """Whether readings that are unevenly far apart are on straight lines by their rows, rather than one by one."""
    inner = np.flatnonzero(moves[1:-1]) + 1
    share = (rows[inner] - rows[inner - 1]) / (rows[inner + 1] - rows[inner - 1])
    inner, share = inner[share != 0.5], share[share != 0.5]
    if len(inner) < _LEAST:
        return False
    before, here, after = readings[inner - 1], readings[inner], readings[inner + 1]
    steady, evenly = (np.median(np.abs(before + each * (after - before) - here)) for each in (share, 0.5))
    return bool(steady <= _STEADIER * evenly)
