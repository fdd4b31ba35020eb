"""Single numbers of inputs that are missing, or turn out to be wrong: they are bridged, and their rows used."""

import dataclasses
from collections.abc import Collection
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int

from symoden.data._shapes import Times
from symoden.data.description import Description
from symoden.data.signals import longest_step

from ._logs import Bridge, Log
from ._spikes import rows_of

_SMOOTH: Final = 0.4  # Of what held numbers miss: sines of eight samples a period; lines through steps miss as much.


def bridge(log: Log, description: Description, wrong: Bool[np.ndarray, "T m"] | None = None) -> Log:
    """Bridge numbers of inputs where a few in succession are missing, and the rest of their rows is there.

    Without its row an input would be held for two steps at the number before, or at what was known of it: of one that
    changes from sample to sample that is another impulse ∫u dt than was given. One that is smooth from sample to sample
    is interpolated, and so is one with hold "linear"; one that is made of held steps, or too fast for its samples,
    keeps the number before. No gap in time, see `longest_step`, is bridged; what is wrong at its edge, or at an end of
    the log, is set to the number beside.

    Args:
        log: What was logged.
        description: What it means.
        wrong: Which numbers are wrong; those that are missing are bridged if none are named.

    Returns:
        The log with these numbers, and which they are; the same log where there are none.
    """
    lacks = np.isnan(log.us) if wrong is None else wrong
    rest = np.concatenate([each for role, each in log.signals.items() if role != "inputs"], axis=1)
    whole = np.isfinite(rest).all(axis=1) & np.isfinite(log.ts)
    known = np.flatnonzero(np.isfinite(log.ts))
    if not lacks[whole].any() or (np.diff(log.ts[known]) <= 0).any():
        return log
    us, made = np.where(lacks, np.nan, log.us), []
    longest = longest_step(np.diff(log.ts[whole]), resample=description.resample)
    for j in np.flatnonzero(lacks[whole].any(axis=0)):
        held = description.hold == "zero" and not _is_smooth(us[known, j])
        us[known, j] = _filled(log.ts[known], us[known, j], longest, held=held)
        made.append((j, "held at the number before" if held else "interpolated", np.isfinite(us[:, j])))
        if wrong is not None:
            us[known, j] = _beside(log.ts[known], us[known, j])
            made.append((j, "set to the number beside", ~made[-1][-1]))
    bridged = lacks & (whole & np.isfinite(us).all(axis=1))[:, None]
    bridges = tuple(
        Bridge(channel=log.names["inputs"][j], rows=rows, how=how, wrong=wrong is not None)
        for j, how, which in made
        if len(rows := np.flatnonzero(bridged[:, j] & which))
    )
    return dataclasses.replace(log, us=np.where(bridged, us, log.us), bridges=(*log.bridges, *bridges))


def bridged_rows(log: Log, channels: Collection[str]) -> Int[np.ndarray, " k"]:
    """Find rows in which a number of some columns was missing, and is bridged.

    Args:
        log: What was logged.
        channels: Names of the columns.

    Returns:
        The rows, in order.
    """
    return rows_of([each for each in log.bridges if each.channel in channels and not each.wrong])


def _filled(ts: Times, u: Float[np.ndarray, " T"], longest: float, *, held: bool) -> Float[np.ndarray, " T"]:
    """An input with what it lacks between two numbers that are no gap apart."""
    there = np.flatnonzero(np.isfinite(u))
    if len(there) < 2:
        return u
    lacking = np.setdiff1d(np.arange(there[0], there[-1]), there)
    after = np.searchsorted(there, lacking)
    before, then = there[after - 1], there[after]
    value = u[before] if held else np.interp(ts[lacking], ts[there], u[there])
    filled = u.copy()
    filled[lacking] = np.where(ts[then] - ts[before] <= longest, value, np.nan)
    return filled


def _beside(ts: Times, u: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """An input with the nearest number in place of each that it lacks."""
    there = np.flatnonzero(np.isfinite(u))
    if not len(there):
        return u
    later = np.searchsorted(there, np.arange(len(u))).clip(1, len(there) - 1)
    before, after = there[later - 1], there[later]
    return np.where(np.isnan(u), u[np.where(ts - ts[before] <= ts[after] - ts, before, after)], u)


def _is_smooth(u: Float[np.ndarray, " T"]) -> bool:
    """Whether the mean of the samples beside tells a sample far better than the one before does, where it changes."""
    before, here, after = u[:-2], u[1:-1], u[2:]
    changes = (before != here) | (here != after)
    held, line = np.abs(here - before)[changes], np.abs(here - (before + after) / 2)[changes]
    if not np.isfinite(held + line).any():
        return False
    return bool(np.nanmedian(line) < _SMOOTH * np.nanmedian(held))
