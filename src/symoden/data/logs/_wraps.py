"""Clocks that count ticks in so many bits, and begin anew when these are full: they are counted on."""

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np

from symoden.data._findings import SHOWN_SPANS, Finding
from symoden.data._shapes import Times
from symoden.data.description import of_column
from symoden.data.signals import longest_step

from ._clock_notes import Wraps
from ._logs import Log

_BITS: Final = (16, 24, 31, 32)  # Of timers, of those that count while processors run, and of signed numbers and words.
_TICKS: Final = {1e-3: "ms", 1e-6: "us"}  # [s]; a program may have divided them into seconds.
_GAP: Final = 2.0  # Times the longest step that is no gap: more may be the beginning of another recording.
_FEW: Final = 0.05  # Share of what a clock counts to, within which any step would fit.
_SAME: Final = 2.0  # Ticks between the beginnings of recordings whose clock is set back to the same.
_ROUNDED: Final = 1e-12  # What double precision leaves of a stamp, relative to it.
_WHOLE: Final = 1e-3  # Of a tick,
_ROUNDING: Final = 0.25  # or so much at most: of larger stamps it is not known whether they are whole.
_COARSER: Final = (5.0, 10.0)  # Ticks, of which 2^bits are no whole number: a clock that shows these alone counts them.


def unwrapped_clock(log: Log, units: Mapping[str, float]) -> Log:
    """Count a clock on where it began anew.

    A counter of milliseconds in 16 bits is at 0 again after 65.536 s. Where all stamps that go back do so by the same
    power of two of ticks, but for a step that is no gap, or hardly one, they were counted: recordings one after the
    other end anywhere, or, where all have one length, begin with the same stamp.

    Args:
        log: What was logged.
        units: What columns were multiplied by to be in SI.

    Returns:
        The log with stamps that go on, and `wraps`; the same log where none goes back, or it may have another reason.
    """
    known = np.flatnonzero(np.isfinite(log.ts))
    ts = log.ts[known]
    steps = np.diff(ts)
    back = np.flatnonzero(steps < 0)
    if "time" not in log.names or not len(back) or not (steps > 0).any():
        return log
    longest = _GAP * longest_step(steps[steps > 0])
    unit = of_column(log.names["time"][0], units) or 1.0
    for tick, bits in ((tick, bits) for tick in dict.fromkeys((unit, *_TICKS)) for bits in _BITS):
        period = tick * 2.0**bits
        over = steps[back] + period
        fits = (over > 0) & (over <= min(longest, _FEW * period))
        set_back = np.abs(ts[back + 1] - ts[0]) <= _SAME * tick
        if fits.all() and steps.max() < period / 2 and not set_back.all() and _counts(ts, tick):
            rows = np.zeros(len(log.ts))
            rows[known[back + 1]] = period
            times = log.ts + np.cumsum(rows)
            spans = tuple((float(times[a]), float(times[b])) for a, b in zip(known[back], known[back + 1], strict=True))
            return dataclasses.replace(
                log, ts=times, wraps=Wraps(bits, tick, log.place(int(known[back[0] + 1])), spans)
            )
    return log


def find_wraps(log: Log) -> list[Finding]:
    """Say that a clock began anew, and was counted on.

    Args:
        log: What was logged, its clock counted on.

    Returns:
        The finding, or none.
    """
    if log.wraps is None:
        return []
    bits, tick, where, spans = log.wraps
    (name,) = log.names["time"]
    size = f"1 {_TICKS[tick]}" if tick in _TICKS else f"{tick:g} s"
    often = "once" if len(spans) == 1 else f"{len(spans)} times"
    return [
        Finding(
            kind="time",
            level="note",
            channel=name,
            text=f"`{name}` goes back {often}, at {where}{' first' if len(spans) > 1 else ''}, by 2^{bits} ticks of "
            f"{size} but for a usual step: a counter of {bits} bits that is full and begins anew; it is counted on",
            advice="Nothing need be done.",
            spans=spans[:SHOWN_SPANS],
        )
    ]


def _counts(ts: Times, tick: float) -> bool:
    """Whether stamps are whole numbers of ticks, as far as they are exact."""

    def whole(size: float) -> bool:
        ticks = ts / size
        rounding = _WHOLE + _ROUNDED * np.abs(ticks)
        return bool((rounding < _ROUNDING).all() and (np.abs(ticks - np.round(ticks)) <= rounding).all())

    return whole(tick) and not any(map(whole, (tick * more for more in _COARSER)))
