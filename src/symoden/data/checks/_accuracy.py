"""Velocities that know less than the positions do."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from symoden.data._errors import DataError
from symoden.data._findings import Finding
from symoden.data._shapes import Positions, Rates, Times
from symoden.data.logs import Facts
from symoden.data.signals import choose_spans, delays, deviation, estimate_velocities, velocity_noise_gain

WORSE: Final = 3.0  # Times the estimate's own error by which a velocity must differ from it.
_LEAST: Final = 1e-3  # The same relative to a typical velocity: what is less does no harm.
_RESTS: Final = 0.1  # Of a typical velocity.
_MOST_SAMPLES: Final = 8_192  # From the middle of a log: many begin and end at rest.
_ORDERS: Final = 2**4 - 1  # Twice as wide a window has 2⁴ times the error, the estimate's being of order 4.
_EXPLAINS: Final = 0.5  # Share of a difference's square that a delay must explain to be named.


@dataclass(frozen=True, kw_only=True)
class SlopeComparison:
    """How a logged velocity differs from the slope of its position.

    Attributes:
        joint: Which coordinate.
        position: Name of the position's column.
        rate: Name of the velocity's column.
        differs: Standard deviation of the difference while it moves.
        error: What the slope itself would be off by then: noise of the positions, and what smoothing takes away.
        typical: Root mean square of the velocity.
        delay: By how much the velocity comes late [s], where that explains most of the difference; else 0.
    """

    joint: int
    position: str
    rate: str
    differs: float
    error: float
    typical: float
    delay: float

    @property
    def is_inaccurate(self) -> bool:
        """Whether the velocity differs by more than can be wrong with the slope, and by enough to matter."""
        return self.differs > max(WORSE * self.error, _LEAST * self.typical)

    @property
    def is_late(self) -> bool:
        """Whether it is inaccurate and a delay explains most of that."""
        return self.is_inaccurate and self.delay > 0


def compare_with_slopes(facts: Facts) -> tuple[SlopeComparison, ...]:
    """Compare velocities with the slopes of their positions.

    A controller's velocities are differences of positions or filtered, hence late, and the lateness is an error that no
    average takes out: a millisecond at 60 rad/s² is 0.06 rad/s in every sample of a swing.

    Args:
        facts: Facts of a log.

    Returns:
        One comparison for each velocity that belongs to its position; none where there are too few samples.
    """
    joints = [i for i, ratio in enumerate(facts.ratios) if ratio.agrees]
    if facts.v is None or not joints:
        return ()
    start = max(0, (len(facts.ts) - _MOST_SAMPLES) // 2)
    rows = slice(start, start + _MOST_SAMPLES)
    ts, q = facts.ts[rows], facts.q[rows]
    q = np.where(facts.is_angle, np.unwrap(q, axis=0), q)[:, joints]
    noise = np.array([facts.positions[i].noise for i in joints])
    try:
        v, errors = _estimated(ts, q, noise)
    except DataError:  # Too few samples, or too uneven ones.
        return ()
    differs = facts.v[rows][:, joints] - v
    sizes = [deviation(off[_moving(each)]) for off, each in zip(differs.T, v.T, strict=True)]
    return tuple(
        SlopeComparison(
            joint=i,
            position=facts.positions[i].name,
            rate=facts.rates[i].name,
            differs=float(size),
            error=float(errors[k]),
            typical=facts.rates[i].rms,
            delay=_delay(ts, v[:, k], differs[:, k]),
        )
        for k, (i, size) in enumerate(zip(joints, sizes, strict=True))
    )


def find_inaccurate(
    comparisons: Sequence[SlopeComparison], *, named: Collection[str] = (), trusted: bool = False
) -> list[Finding]:
    """Find velocities that differ from the slope of the positions by more than that can be wrong.

    Args:
        comparisons: Velocities beside the slopes of their positions.
        named: Velocities of which enough was said already.
        trusted: Whether the description says that they are to be taken as they are.

    Returns:
        The findings: warnings of those that come late, which no average mends, notes of the others.
    """
    return [
        Finding(
            kind="slope",
            level="warning" if one.is_late and not trusted else "note",
            channel=one.rate,
            text=f"`{one.rate}` differs from the slope of `{one.position}` by {one.differs:.2g}"
            + (f", as if it came {1000 * one.delay:.3g} ms late" if one.is_late else "")
            + f"; estimated from the positions it would be off by about {one.error:.1g}",
            advice=f"Leave `{'trust_velocities' if trusted and one.is_late else 'velocities'}` out: they are then "
            "estimated, and what is learned is mostly better.",
        )
        for one in comparisons
        if one.is_inaccurate and one.rate not in named
    ]


def _estimated(ts: Times, q: Positions, noise: np.ndarray) -> tuple[Rates, np.ndarray]:
    """Velocities from positions, and their errors: noise of the positions, and what smoothing takes away."""
    spans = choose_spans([ts], [q])
    v, smoother = (estimate_velocities(ts, q, name="", spans=factor * spans) for factor in (1, 2))
    smoothed = [deviation(off[_moving(each)]) for off, each in zip((smoother - v).T, v.T, strict=True)]
    return v, np.hypot(velocity_noise_gain(ts, spans) * noise, np.array(smoothed) / _ORDERS)


def _moving(v: np.ndarray) -> np.ndarray:
    """Samples of a velocity that is not at rest, or hardly: there nothing comes late."""
    return np.abs(v) >= _RESTS * np.sqrt(np.mean(v**2))


def _delay(ts: Times, v: np.ndarray, differs: np.ndarray) -> float:
    """The delay that explains a difference [s]; 0 where none explains most of it."""
    delay, late = 0.0, differs
    for longer in delays(ts)[1:]:
        left = v + differs - np.interp(ts - longer, ts, v)
        if not left @ left < late @ late:  # Farther on is the next period of a periodic motion.
            break
        delay, late = float(longer), left
    # Between those that were tried the difference is a straight line.
    a = np.interp(ts - delay, ts, np.gradient(v, ts))
    power = float(a @ a)
    more = -float(late @ a) / power if power else 0.0
    delay, left = delay + more, late + more * a
    return delay if delay > 0 and left @ left < (1 - _EXPLAINS) * (differs @ differs) else 0.0
