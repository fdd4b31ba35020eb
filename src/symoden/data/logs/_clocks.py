"""Recordings whose time stamps are in another unit than those of the others, or are not those that `dt` says."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from symoden.data._findings import Finding
from symoden.data.description import Description, entry, split_unit
from symoden.data.files import UnreadClock
from symoden.data.signals import usual_step
from symoden.wording import quoted

from ._logs import Log

_OTHER: Final = 100  # times longer or shorter: no logger's rates differ so much
_NEAR: Final = 3.0  # factor up to which a unit explains it, since rates differ too
SLOW: Final = 1.0
"""Step [s] from which time stamps are rather in another unit: no mechanism is logged so slowly."""
_FAST: Final = 1e-4  # Step [s] below which they are rather in seconds already, if those are a logger's.
_ROUNDING: Final = 1e-6
_SAME: Final = 0.05  # How far `dt` may be from what a clock says, relatively.
_UNITS: Final = ((1e3, "milliseconds", "ms"), (1e6, "microseconds", "us"), (1e9, "nanoseconds", "ns"))


def find_other_clocks(logs: Sequence[Log], description: Description) -> tuple[tuple[Finding, ...], ...]:
    """Find logs whose usual step of time is far from that of most others, or all too long or short for a mechanism.

    Args:
        logs: Every log of a data set.
        description: What it means.

    Returns:
        The findings on each log: one, or none.
    """
    if description.time is None and description.dt is not None:
        slow = _slow_rows(description.dt, description)
        return tuple(slow or _other_rows(log, description.dt) for log in logs)
    steps = [_usual(log) for log in logs]
    known = sorted(step for step in steps if step is not None)
    if not known:
        return ((),) * len(logs)
    most = known[(len(known) - 1) // 2]
    others = tuple(
        () if step is None or 1 / _OTHER < step / most < _OTHER else (_finding(log, step, most, description),)
        for log, step in zip(logs, steps, strict=True)
    )
    if most < _FAST:
        return tuple(other or _fast(log, most, description) for other, log in zip(others, logs, strict=True))
    if most < SLOW or description.velocities is not None:  # These tell what is wrong.
        return others
    return tuple(other or _slow(log, most, description) for other, log in zip(others, logs, strict=True))


def _usual(log: Log) -> float | None:
    """Usual step of time of a log [s]; nothing where no time increases."""
    steps = np.diff(log.ts[np.isfinite(log.ts)])
    steps = steps[steps > 0]
    return usual_step(steps) if len(steps) else None


def _slow(log: Log, step: float, description: Description) -> tuple[Finding, ...]:
    """All time stamps are in a unit that the description does not name, or count rows."""
    (name,) = log.names["time"]
    told = description.units.get(name, 1.0)
    if name in description.units and told >= 1:
        return ()  # In minutes: a slow machine.
    smaller = [each for each in _UNITS if each[0] * told > 1 + _ROUNDING and step / told >= each[0] / 1e3 * SLOW]
    if not smaller:
        return ()
    _, word, key = smaller[-1]
    advice = (
        f"Write {entry({name: key}, {column: unit for column, unit in description.units.items() if column != name})}."
    )
    if step == told == 1:
        advice = f"If it counts rows, leave `time` out and write `dt`, the time between two [s]. Otherwise: {advice}"
    return (
        Finding(
            kind="unit",
            level="warning",
            channel=name,
            text=f"the usual step of `{name}` is {step:.4g} s, long for a mechanism: is it in {word}?",
            advice=advice,
        ),
    )


def _slow_rows(step: float, description: Description) -> tuple[Finding, ...]:
    """Rows without time stamps are so far apart that the time between them is hardly in seconds."""
    if step < SLOW or description.velocities is not None:
        return ()
    factor, word, _ = next((each for each in reversed(_UNITS) if step >= each[0] / 1e3), _UNITS[0])
    return (
        Finding(
            kind="unit",
            level="warning",
            channel="",
            text=f"`dt` is {step:.4g} s, long for a mechanism: is it in {word}?",
            advice=f"Write `dt = {step / factor:.4g}`: it is in seconds. Nothing need be done if the machine is slow.",
        ),
    )


def _other_rows(log: Log, dt: float) -> tuple[Finding, ...]:
    """Columns of time that are not read say another time from row to row than the description."""
    told = [(clock, unit) for clock in log.clocks if (unit := split_unit(clock.name)[1]) or not clock.whole]
    if not told or any(_may_be(clock, unit, dt) for clock, unit in told):
        return ()
    (name, steps, _), unit = told[0]
    step = f"{steps[0]:.4g}{unit and ' '}{unit}"
    return (
        Finding(
            kind="time",
            level="warning",
            channel=name,
            text=f"`{name}`, which is not read, goes on by {step} from row to row, but `dt` is {dt:g} s",
            advice=f"Write `time = {quoted(name)}` in place of `dt`, with its unit in `units` if it is not in seconds, "
            "or correct `dt`: by a wrong time masses and friction are wrong.",
        ),
    )


def _may_be(clock: UnreadClock, unit: str, dt: float) -> bool:
    """Whether a clock goes on by a time, in its unit or, if that is not known, in any."""
    units = {"s": 1.0} | {key: factor for factor, _, key in _UNITS}
    if unit not in units and (unit or clock.name[-1] in ")]"):
        return True  # Minutes, or ticks.
    factors = [units[unit]] if unit else units.values()
    return any(abs(step / factor - dt) <= _SAME * dt for step in clock.steps for factor in factors)


def _fast(log: Log, step: float, description: Description) -> tuple[Finding, ...]:
    """All time stamps are in seconds, and the description says otherwise."""
    (name,) = log.names["time"]
    factor = description.units.get(name, 1.0)
    if not _FAST <= step / factor < SLOW:
        return ()
    return (
        Finding(
            kind="unit",
            level="warning",
            channel=name,
            text=f"the usual step of `{name}` is {step:.2g} s, short for a mechanism, and would be "
            f"{step / factor:.2g} s without its entry in `units`: is it in seconds?",
            advice=f"Remove `{name}` from `units`.",
        ),
    )


def _finding(log: Log, step: float, most: float, description: Description) -> Finding:
    """A clock that runs much faster or slower than the others."""
    (name,) = log.names["time"]
    ratio = max(step / most, most / step)
    units = [(word, key) for factor, word, key in _UNITS if factor / _NEAR < ratio < factor * _NEAR]
    word, key = units[0] if units else ("another unit", "ms")
    if is_said := name in description.units:
        word = "another unit"
    question = f"are the others in {word}?" if step < most and not is_said else f"is `{name}` in {word}?"
    advice = f"`units` hold for all files: convert `{name}` of `{log.path}` to the unit of the others, or leave it out."
    if not is_said:
        advice += f" If all are in {word if units else 'milliseconds'}, write {entry({name: key}, description.units)}."
    return Finding(
        kind="unit",
        level="warning",
        channel=name,
        text=f"the usual step of `{name}` is {step:.4g} s, but {most:.4g} s in most others: {question}",
        advice=advice,
    )
