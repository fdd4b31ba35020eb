"""Velocities that know less than the positions do."""

from collections.abc import Collection
from typing import Final

import numpy as np

from ._errors import DataError
from ._facts import Facts
from ._findings import Finding
from ._shapes import Positions, Rates, Times
from ._signals import deviation
from ._spans import choose_spans
from ._velocities import estimate_velocities, velocity_noise_gain

_WORSE: Final = 3.0  # Times the estimate's own error by which a velocity must differ from it.
_LEAST: Final = 1e-3  # The same relative to a typical velocity: what is less does no harm.
_MOST_SAMPLES: Final = 8_192  # From the middle of a log: many begin and end at rest.
_ORDERS: Final = 2**4 - 1  # Twice as wide a window has 2⁴ times the error, the estimate's being of order 4.
_EXPLAINS: Final = 0.5  # Share of a difference's square that a delay must explain to be named.


def find_inaccurate(facts: Facts, *, named: Collection[str] = ()) -> list[Finding]:
    """Find velocities that differ from the slope of the positions by more than that can be wrong.

    A controller's velocities are differences of positions or filtered, hence late, and the lateness is an error that no
    average takes out: a millisecond at 60 rad/s² is 0.06 rad/s in every sample of a swing.

    Args:
        facts: Facts of a log.
        named: Velocities of which enough was said already.

    Returns:
        The findings.
    """
    joints = [
        i
        for i, (ratio, rate) in enumerate(zip(facts.ratios, facts.rates, strict=False))
        if ratio.agrees and rate.name not in named
    ]
    if facts.v is None or not joints:
        return []
    start = max(0, (len(facts.ts) - _MOST_SAMPLES) // 2)
    rows = slice(start, start + _MOST_SAMPLES)
    ts, q = facts.ts[rows], facts.q[rows]
    q = np.where(facts.is_angle, np.unwrap(q, axis=0), q)[:, joints]
    noise = np.array([facts.positions[i].noise for i in joints])
    try:
        v, errors = _estimated(ts, q, noise)
    except DataError:  # Too few samples, or too uneven ones.
        return []
    differs = facts.v[rows][:, joints] - v
    found = []
    for k, (i, size) in enumerate(zip(joints, deviation(differs), strict=True)):
        position, rate = facts.positions[i], facts.rates[i]
        if size <= max(_WORSE * errors[k], _LEAST * rate.rms):
            continue
        delay = _delay(ts, v[:, k], differs[:, k])
        found.append(
            Finding(
                kind="slope",
                level="warning" if delay else "note",
                channel=rate.name,
                text=f"`{rate.name}` differs from the slope of `{position.name}` by {size:.2g}"
                + (f", as if it came {1000 * delay:.2g} ms late" if delay else "")
                + f"; estimated from the positions it would be off by about {errors[k]:.1g}",
                advice="Leave `velocities` out: they are then estimated, and what is learned is mostly better.",
            )
        )
    return found


def _estimated(ts: Times, q: Positions, noise: np.ndarray) -> tuple[Rates, np.ndarray]:
    """Velocities from positions, and their errors: noise of the positions, and what smoothing takes away."""
    spans = choose_spans([ts], [q])
    v, smoother = (estimate_velocities(ts, q, name="", spans=factor * spans) for factor in (1, 2))
    return v, np.hypot(velocity_noise_gain(ts, spans) * noise, deviation(smoother - v) / _ORDERS)


def _delay(ts: Times, v: np.ndarray, differs: np.ndarray) -> float:
    """The delay that explains a difference [s]; 0 where none explains most of it."""
    a = np.gradient(v, ts)
    power = float(a @ a)
    delay = -float(differs @ a) / power if power else 0.0
    left = differs + delay * a
    return delay if delay > 0 and left @ left < (1 - _EXPLAINS) * (differs @ differs) else 0.0
