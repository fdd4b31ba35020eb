"""Sensors that stand still while what they measure moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Int

from symoden.data._findings import Finding
from symoden.data.signals import blocks, displacement, least_change, standstills
from symoden.wording import stamp

from ._facts import ChannelFacts, Facts

_LEAST: Final = 10  # identical samples
_LEAST_REST: Final = 0.5  # [s] at rest that a joint must be for the motion of others to count
_FOLLOWS = 0.3  # misfit up to which position and velocity tell of one motion
_ROUNDINGS, _NOISES = 4.0, 6.0
_SHARE, _SHARE_OTHER, _SHARE_INPUT = 0.03, 0.3, 0.7  # of a channel's range
_TURN = 10  # steps of an encoder
_LEAST_FROZEN: Final = 0.3  # [s] that a position must stand still for its rows to be left out,
_SETTLES: Final = 0.15  # and the part of it in which a velocity that is filtered may still come to rest.
_FAST: Final = 0.5  # of the usual speed; what is slower may be a bias
_MOST_FROZEN: Final = 1 / 3  # of the rows, in more than a few stretches: a position logged more slowly than the table
_FEW: Final = 3
_RARE: Final = 0.1  # Share of samples that equal the one before, elsewhere.
_NOISY: Final = 2.0  # Steps of rounding, and
_SEEN: Final = 1e-5  # share of the range, that the noise must be to be one: that of a simulation is neither.
_LEAP: Final = 4.0  # Times all other changes near it.


@dataclass(frozen=True, kw_only=True, eq=False)
class StuckRows:
    """Rows in which a position does not change though its velocity says without a doubt that it does.

    Attributes:
        channel: Name of the position's column.
        velocity: Name of the velocity's.
        rows: Rows of the log.
        spans: Start and end of each stretch [s].
    """

    channel: str
    velocity: str
    rows: Int[np.ndarray, " k"]
    spans: tuple[tuple[float, float], ...]

    def describe(self) -> str:
        """Say which column does not change, and when."""
        return f"`{self.channel}` does not change at all {_when(self.spans)} while `{self.velocity}` says that it moves"


def find_stuck_rows(facts: Facts) -> tuple[StuckRows, ...]:
    """Find positions that stand still for long while their velocities show a motion that is no bias, lag or noise.

    Beside what `find_stuck` asks for, ∫v dt must go on once a filtered velocity has had time to come to rest, by many
    times the position's resolution, and somewhere at a speed that is not small in this log; still so in the latter half
    of the standstill, with a velocity that changes. So a machine that friction holds or a stop has caught is not meant,
    though its velocity be biased, noisy, late or held; nor a position that is logged more slowly than the table.

    Args:
        facts: Facts of a log.

    Returns:
        Those of each position that has any.
    """
    found = []
    for i, position in enumerate(facts.positions):
        stretches = _contradicted(facts, i, facts.q[:, i], by_velocity=True)
        if stretches := [each for each in stretches if _is_certain(facts, i, *each)]:
            spans = tuple((float(facts.ts[start]), float(facts.ts[end])) for start, end in stretches)
            rows = np.concatenate([facts.rows[start : end + 1] for start, end in stretches])
            if len(stretches) > _FEW and len(rows) > _MOST_FROZEN * len(facts.rows):
                continue
            found.append(StuckRows(channel=position.name, velocity=facts.rates[i].name, rows=rows, spans=spans))
    return tuple(found)


def _is_certain(facts: Facts, i: int, start: int, end: int) -> bool:
    """Whether coordinate i certainly moves in a standstill of its position that its velocity contradicts."""
    if facts.v is None or not facts.ratios[i].known or facts.ts[end] - facts.ts[start] < _LEAST_FROZEN:
        return False
    position, q = facts.positions[i], facts.q[:, i]
    way = facts.ratios[i].factor * displacement(facts.ts, facts.v[:, i], longest=facts.longest)
    settled = np.arange(np.searchsorted(facts.ts, facts.ts[start] + _SETTLES), end + 1)
    settled = settled[len(settled) // 2 :]
    resolution = max(position.quantum, least_change(q))
    if np.ptp(way[settled]) <= _allowed(position, resolution) or not np.ptp(facts.v[settled, i]):
        return False
    pairs = blocks(facts.ts, longest=facts.longest)
    usual = _speeds(facts.ts, way, pairs[q[pairs[:, 0]] != q[pairs[:, 1]]])
    size = min(int(pairs[0, 1] - pairs[0, 0]), len(settled) - 1)
    speeds = _speeds(facts.ts, way, np.stack([settled[:-size], settled[size:]], axis=1))
    return bool(np.abs(speeds).max() > _FAST * np.sqrt(np.mean(usual**2)))


def _speeds(ts: np.ndarray, way: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Mean speed between the samples of each pair."""
    return (np.diff(way[pairs], axis=1) / np.diff(ts[pairs], axis=1))[:, 0]


def _allowed(position: ChannelFacts, resolution: float) -> float:
    """Way that a position which does not change may hide."""
    return _ROUNDINGS * resolution + _NOISES * position.noise + _SHARE * position.span


def find_stuck(facts: Facts) -> list[Finding]:
    """Find positions and velocities that stay bit-identical while they should change.

    Where both are logged, they contradict each other if q − k ∫v dt, which should be constant, leaves what rounding and
    noise allow; the one that is identical is to blame. Where a joint seems at rest, nothing can contradict but the
    other joints, or an input that swings through most of its range; that it is held by friction is possible too. What
    has noise of several steps of its rounding never rests: then a leap with which it goes on tells enough.

    Args:
        facts: Facts of a log.

    Returns:
        One finding for each channel that is stuck.
    """
    found = []
    for i, position in enumerate(facts.positions):
        stuck = [*_contradicted(facts, i, facts.q[:, i], by_velocity=True), *_alone(facts, i), *_silent(facts, i)]
        found.extend(_finding(facts, position.name, stuck))
        if facts.v is not None:
            stuck = _contradicted(facts, i, facts.v[:, i], by_velocity=False)
            found.extend(_finding(facts, facts.rates[i].name, stuck))
    return found


def _contradicted(facts: Facts, i: int, signal: np.ndarray, *, by_velocity: bool) -> list[tuple[int, int]]:
    """Standstills of a position or velocity of coordinate i that the other of both contradicts."""
    if facts.v is None or facts.ratios[i].misfit > _FOLLOWS:
        return []
    factor = facts.ratios[i].factor if facts.ratios[i].known else 1.0
    q = np.unwrap(facts.q[:, i]) if facts.is_angle[i] else facts.q[:, i]
    rest = q - factor * displacement(facts.ts, facts.v[:, i], longest=facts.longest)
    position, velocity = facts.positions[i], facts.rates[i]
    fixed = _allowed(position, position.quantum)
    step = float(np.median(np.diff(facts.ts)))
    stuck = []
    for start, end in standstills(facts.ts, signal, least=_LEAST, longest=facts.longest):
        time = float(facts.ts[end] - facts.ts[start])
        share = 0.1 if by_velocity else 1.0  # A velocity that flickers is right on average, one at rest is not.
        drift = share * velocity.quantum * time + _NOISES * velocity.noise * np.sqrt(time * step)
        if np.ptp(rest[start : end + 1]) > fixed + abs(factor) * drift:
            stuck.append((start, end))
    return stuck


def _alone(facts: Facts, i: int) -> list[tuple[int, int]]:
    """Long standstills of coordinate i, without a velocity that moves, while other joints or its input move."""
    position = facts.positions[i]
    if position.span <= 20 * max(position.quantum, position.noise):
        return []
    least = max(_LEAST_REST, 0.05 * float(facts.ts[-1] - facts.ts[0]))
    others = [(facts.q[:, j], _SHARE_OTHER) for j in range(facts.q.shape[1]) if j != i]
    if facts.us.shape[1] == facts.q.shape[1]:
        others.append((facts.us[:, i], _SHARE_INPUT))
    stuck = []
    for start, end in standstills(facts.ts, facts.q[:, i], least=2 * _LEAST, longest=facts.longest):
        part = slice(start, end + 1)
        if facts.ts[end] - facts.ts[start] < least or _may_turn(facts, i, start, end):
            continue
        if any(np.ptp(other) > 0 and np.ptp(other[part]) > share * np.ptp(other) for other, share in others):
            stuck.append((start, end))
    return stuck


def _silent(facts: Facts, i: int) -> list[tuple[int, int]]:
    """Standstills of coordinate i, whose noise makes equal neighbours rare elsewhere, that end by a leap."""
    position = facts.positions[i]
    if position.noise <= max(_NOISY * position.quantum, _SEEN * position.span):
        return []
    q = np.unwrap(facts.q[:, i]) if facts.is_angle[i] else facts.q[:, i]
    changes, stuck = np.abs(np.diff(q)), []
    for start, end in standstills(facts.ts, q, least=2 * _LEAST, longest=facts.longest):
        elsewhere = np.delete(changes, slice(start, end))
        if end == len(changes) or facts.ts[end + 1] - facts.ts[end] > facts.longest or not len(elsewhere):
            continue
        near = np.r_[max(0, 2 * start - end) : start, end + 1 : min(len(changes), 2 * end + 1 - start)]
        least = max(_NOISES * position.noise, _LEAP * changes[near].max(initial=0.0))
        if np.mean(elsewhere == 0) < _RARE and changes[end] > least:
            stuck.append((start, end))
    return stuck


def _may_turn(facts: Facts, i: int, start: int, end: int) -> bool:
    """Whether coordinate i may be turning back on one step of its encoder."""
    # Where ½ a t² stays within one step for a time T, it goes eight steps in the time T before and after.
    time = facts.ts[end] - facts.ts[start]
    first, last = np.searchsorted(facts.ts, [facts.ts[start] - time, facts.ts[end] + time])
    sides = facts.q[first : start + 1, i], facts.q[end : last + 1, i]
    return bool(max(map(np.ptp, sides)) <= _TURN * facts.positions[i].quantum)


def _finding(facts: Facts, name: str, stuck: list[tuple[int, int]]) -> list[Finding]:
    """Say where a channel is stuck."""
    if not stuck:
        return []
    spans = tuple(sorted({(float(facts.ts[start]), float(facts.ts[end])) for start, end in stuck}))
    all_along = spans[0] == (float(facts.ts[0]), float(facts.ts[-1]))
    leave_out = (
        "Take this file out of `files`, or name a column that moves."
        if all_along
        else "Leave the cells of this column empty there: such rows are left out and the recording is split. "
        "(Intervals of `rows`, by the name of the file, do it too.)"
    )
    return [
        Finding(
            kind="stuck",
            level="warning",
            channel=name,
            text=f"`{name}` does not change {'in any row' if all_along else f'at all {_when(spans)}'} while the "
            "machine moves: a stuck sensor?",
            advice=f"{leave_out} If the joint is held by friction, nothing need be done.",
            spans=spans,
        )
    ]


def _when(spans: Sequence[tuple[float, float]]) -> str:
    """Words for the longest of some stretches of time, and for how many there are beside it."""
    start, end = max(spans, key=lambda span: span[1] - span[0])
    more = f" (and in {len(spans) - 1} more such stretch{'es' if len(spans) > 2 else ''})" if len(spans) > 1 else ""
    return f"from {stamp(start)} to {stamp(end)} s{more}"
