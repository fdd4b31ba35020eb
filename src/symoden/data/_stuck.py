"""Sensors that stand still while what they measure moves."""

from typing import Final

import numpy as np

from ._facts import Facts
from ._findings import Finding
from ._kinematics import displacement
from ._signals import standstills

_LEAST: Final = 10  # identical samples
_LEAST_REST: Final = 0.5  # [s] at rest that a joint must be for the motion of others to count
_FOLLOWS = 0.3  # misfit up to which position and velocity tell of one motion
_ROUNDINGS, _NOISES = 4.0, 6.0
_SHARE, _SHARE_OTHER, _SHARE_INPUT = 0.03, 0.3, 0.7  # of a channel's range
_REST_VELOCITY = 0.02  # of its root mean square


def find_stuck(facts: Facts) -> list[Finding]:
    """Find positions and velocities that stay bit-identical while they should change.

    Where both are logged, they contradict each other if q − k ∫v dt, which should be constant, leaves what rounding and
    noise allow; the one that is identical is to blame. Where a joint seems at rest, nothing can contradict but the
    other joints, or an input that swings through most of its range; that it is held by friction is possible too.

    Args:
        facts: Facts of a log.

    Returns:
        One finding for each channel that is stuck.
    """
    found = []
    for i, position in enumerate(facts.positions):
        stuck = [*_contradicted(facts, i, facts.q[:, i], by_velocity=True), *_alone(facts, i)]
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
    fixed = _ROUNDINGS * position.quantum + _NOISES * position.noise + _SHARE * position.span
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
        if facts.ts[end] - facts.ts[start] < least:
            continue
        if any(np.ptp(other) > 0 and np.ptp(other[part]) > share * np.ptp(other) for other, share in others):
            stuck.append((start, end))
    return stuck


def _finding(facts: Facts, name: str, stuck: list[tuple[int, int]]) -> list[Finding]:
    """Say where a channel is stuck."""
    if not stuck:
        return []
    spans = sorted({(float(facts.ts[start]), float(facts.ts[end])) for start, end in stuck})
    start, end = max(spans, key=lambda span: span[1] - span[0])
    times = f", and {len(spans) - 1} more such stretch{'es' if len(spans) > 2 else ''}" if len(spans) > 1 else ""
    return [
        Finding(
            kind="stuck",
            level="warning",
            channel=name,
            text=f"`{name}` does not change at all from {start:.6g} to {end:.6g} s while the machine moves{times}: "
            "a stuck sensor?",
            advice="Leave the cells of this column empty there: such rows are left out and the recording is split. "
            "(`rows` does it too, but holds for every file of its part.) If the joint is held by friction, nothing "
            "need be done.",
            spans=tuple(spans),
        )
    ]
