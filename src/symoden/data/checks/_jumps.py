"""Jumps of positions: wraps of an angle, and what no machine moves from one sample to the next."""

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from symoden.data._findings import Finding
from symoden.data.logs import Facts
from symoden.data.signals import jumps
from symoden.wording import stamp

_FAR: Final = 10.0  # Times all other changes from row to row that a leap is.
_FASTER: Final = 3.0  # Times the largest velocity.
_MOST_LEAPS: Final = 5  # In a recording without velocities; what is more is how it moves.
_USUAL_CHANGES: Final = 20  # Other changes for each of them, which tell what is usual.
_APART: Final = 2  # Changes between two leaps.


def find_jumps(facts: Facts, i: int, stuck: Sequence[Finding]) -> list[Finding]:
    """Find jumps by a turn, and by something else, but for those with which a sensor that was stuck goes on.

    Args:
        facts: Facts of a log.
        i: Which coordinate.
        stuck: What was found of sensors that stand still.

    Returns:
        The findings.
    """
    turns, others = jumps(facts.ts, facts.q[:, i], longest=facts.longest)
    ends = [end for finding in stuck if finding.channel == facts.positions[i].name for _, end in finding.spans]
    others = others[~np.isin(facts.ts[others], ends)]
    by_turns = f"jumps by 2π {_times(turns)}, first at {_first(facts, turns)} s" if len(turns) else ""
    if not facts.is_angle[i]:
        if len(turns) and not len(others) and _quiet(facts.q[:, i], turns):
            text = f"{by_turns}, as a wrapped angle does, but the description calls it a length"
            advice = "If it is an angle, give its factor of `space` the letter T instead of R."
            return [_finding(facts, i, turns, "wrap", "warning", text, advice)]
        return _leaps(facts, i, ends)
    taken = f"{by_turns}: taken for wraps of the angle, and removed"
    wraps = [_finding(facts, i, turns, "wrap", "note", taken, "Nothing need be done.")] if len(turns) else []
    if not len(others):
        return [*wraps, *_leaps(facts, i, ends)]
    text = f"jumps by more than half a turn, but not a whole one, {_times(others)}, first at {_first(facts, others)} s"
    advice = (
        "An angle must move by less than half a turn between samples: look for outliers, lost samples, or another unit "
        "(degrees?)."
    )
    return [*wraps, _finding(facts, i, others, "jump", "warning", text, advice)]


def _leaps(facts: Facts, i: int, ends: Sequence[float]) -> list[Finding]:
    """Changes that are far beyond all others, such as where another recording begins in the same file.

    Returns:
        One finding, or none.
    """
    q = np.unwrap(facts.q[:, i]) if facts.is_angle[i] else facts.q[:, i]
    steps = np.diff(facts.ts)
    usual = float(np.median(steps))
    changes = np.abs(np.diff(q)) * usual / np.maximum(steps, usual)  # Across rows that are left out it goes farther.
    changes[(steps > facts.longest) | np.isin(facts.ts[:-1], ends)] = 0.0
    if facts.v is not None and facts.ratios[i].agrees:
        least = _FASTER * usual * np.abs(facts.v[:, i]).max() + _FAR * facts.positions[i].accuracy.size
        leaps = np.flatnonzero(changes > least)
    else:
        leaps = _single(changes)
    if not len(leaps):
        return []
    advice = (
        "If so, make a file of each, or give each its interval of `rows`. If not, look for lost rows, or for a sensor "
        "that was set to zero; if it snaps faster than it is logged, log it faster."
    )
    if leaps.tolist() == [0]:
        advice = f"Leave the first row out if the sensor was not ready: `rows = [1]`. {advice}"
    text = (
        f"jumps by {changes[leaps].max():.3g} {_times(leaps)}, first at {_first(facts, leaps)} s; elsewhere it changes "
        f"by at most {np.delete(changes, leaps).max(initial=0.0):.2g} from row to row: does another recording begin "
        "there?"
    )
    return [_finding(facts, i, leaps, "jump", "warning", text, advice)]


def _single(changes: np.ndarray) -> np.ndarray:
    """Few changes that are far beyond the others; what moves on in the next sample is a fast motion."""
    order = np.argsort(-changes)
    for count in range(1, min(_MOST_LEAPS, len(changes) // _USUAL_CHANGES) + 1):
        leaps, most = np.sort(order[:count]), float(changes[order[count]])
        if 0 < _FAR * most < changes[order[count - 1]] and np.diff(leaps).min(initial=_APART) >= _APART:
            return leaps
    return order[:0]


def _times(samples: np.ndarray) -> str:
    """How often something happens."""
    return "once" if len(samples) == 1 else f"{len(samples)} times"


def _first(facts: Facts, samples: np.ndarray) -> str:
    """When it happens first [s]."""
    return stamp(float(facts.ts[samples[0] + 1]))


def _quiet(q: np.ndarray, turns: np.ndarray) -> bool:
    """Whether a position moves little from sample to sample, apart from its jumps."""
    return float(np.abs(np.delete(np.diff(q), turns)).max(initial=0.0)) < np.pi / 4


def _finding(
    facts: Facts,
    i: int,
    samples: np.ndarray,
    kind: Literal["wrap", "jump"],
    level: Literal["note", "warning"],
    text: str,
    advice: str,
) -> Finding:
    """What is said of the steps after samples of coordinate i."""
    name = facts.positions[i].name
    spans = tuple((float(facts.ts[k]), float(facts.ts[k + 1])) for k in samples)
    return Finding(kind=kind, level=level, channel=name, text=f"`{name}` {text}", advice=advice, spans=spans)
