"""Velocities that know less than the positions do."""

from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from ._errors import DataError
from ._facts import Facts
from ._findings import Finding
from ._spans import choose_spans
from ._velocities import estimate_velocities, velocity_noise_gain

_WORSE: Final = 3.0  # Times the estimate's own error by which a velocity must differ from it.
_LEAST: Final = 1e-3  # The same relative to a typical velocity: what is less does no harm.
_MOST_SAMPLES: Final = 20_000
_DEVIATION: Final = 1.4826  # A Gaussian's standard deviation over the median of its absolute value.
_ORDERS: Final = 2**4 - 1  # Twice as wide a window has 2⁴ times the error, the estimate's being of order 4.
_EXPLAINS: Final = 0.5  # Share of a difference's square that a delay must explain to be named.


class _Estimate(NamedTuple):
    """Velocities that were estimated from positions.

    Attributes:
        v: The velocities (T,).
        error: Standard deviation of their error: noise of the positions, and what smoothing takes away.
    """

    v: Float[np.ndarray, " T"]
    error: float


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
    if facts.v is None:
        return []
    found = []
    for i, (ratio, rate) in enumerate(zip(facts.ratios, facts.rates, strict=True)):
        if rate.name in named or not ratio.agrees or (estimate := _estimated(facts, i)) is None:
            continue
        differs = facts.v[: len(estimate.v), i] - estimate.v
        size = _typical(differs)
        if size <= max(_WORSE * estimate.error, _LEAST * rate.rms):
            continue
        delay = _delay(facts.ts[: len(differs)], estimate.v, differs)
        found.append(
            Finding(
                kind="slope",
                level="warning" if delay else "note",
                channel=rate.name,
                text=f"`{rate.name}` differs from the slope of `{facts.positions[i].name}` by {size:.2g}"
                + (f", as if it came {1000 * delay:.2g} ms late" if delay else "")
                + f"; estimated from the positions it would be off by about {estimate.error:.1g}",
                advice="Leave `velocities` out: they are then estimated, and what is learned is mostly better.",
            )
        )
    return found


def _estimated(facts: Facts, i: int) -> _Estimate | None:
    """Velocity i from its position; None where the samples are too few or too uneven."""
    ts, q = facts.ts[:_MOST_SAMPLES], facts.q[:_MOST_SAMPLES, i]
    q = (np.unwrap(q) if facts.is_angle[i] else q)[:, None]
    name = facts.positions[i].name
    try:
        spans = choose_spans([ts], [q])
        v, smoother = (estimate_velocities(ts, q, name=name, spans=k * spans)[:, 0] for k in (1, 2))
    except DataError:
        return None
    noise = float(velocity_noise_gain(ts, spans)[0]) * facts.positions[i].noise
    return _Estimate(v, float(np.hypot(noise, _typical(smoother - v) / _ORDERS)))


def _delay(ts: np.ndarray, v: np.ndarray, differs: np.ndarray) -> float:
    """The delay that explains a difference [s]; 0 where none explains most of it."""
    a = np.gradient(v, ts)
    power = float(a @ a)
    delay = -float(differs @ a) / power if power else 0.0
    left = differs + delay * a
    return delay if delay > 0 and left @ left < (1 - _EXPLAINS) * (differs @ differs) else 0.0


def _typical(x: np.ndarray) -> float:
    """Standard deviation of an error about zero, whatever a few outliers do."""
    return _DEVIATION * float(np.median(np.abs(x)))
