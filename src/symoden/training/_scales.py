"""Natural units of a mechanism, read off its recordings."""

from collections.abc import Sequence

import numpy as np

from symoden.data import Trajectory
from symoden.known import KnownParts
from symoden.models import KnownMagnitudes, Scales, known_magnitudes
from symoden.spaces import Space

_IDLE = 1e-3  # Share of the largest rate below which a coordinate rests.
_MOST_FILLED = 10  # Samples in place of one where sampling is uneven.


def measure_scales(
    trajectories: Sequence[Trajectory],
    space: Space,
    *,
    momenta: bool,
    input_matrix: np.ndarray | None = None,
    known: KnownParts | None = None,
) -> Scales:
    """Typical magnitudes of coordinates, rates, inputs and time.

    Velocities in momentum data are differences of the coordinates. With velocity data the unit of momentum is free
    (the gauge). A known inertia fixes it, or a force that is known: of the inputs, the potential energy or friction;
    otherwise energies are of order one.

    Args:
        trajectories: Training recordings.
        space: Configuration space of n coordinates.
        momenta: Whether the rates are momenta.
        input_matrix: Known g (n × m), if any.
        known: Parts that are given, if any.

    Returns:
        The scales; what never moves has unit scale, and what hardly does a thousandth of the fastest one's.
    """
    lengths = np.concatenate([trajectory.q for trajectory in trajectories])[:, space.lengths]
    circles = np.zeros(space.embedded_size - lengths.shape[1])
    rates = np.concatenate([trajectory.rates for trajectory in trajectories])
    slopes = np.concatenate([np.diff(t.q, axis=0) / np.diff(t.ts)[:, None] for t in trajectories])
    time = time_scale(trajectories)
    us = np.concatenate([trajectory.us for trajectory in trajectories])
    velocity = _rms(slopes if momenta else rates)
    velocity = np.maximum(velocity, _IDLE * velocity.max(initial=0.0))  # The flicker of an encoder is no motion.
    inputs = _rms(us)
    given = KnownMagnitudes(None, None)
    if known is not None:
        given = known_magnitudes(known, space, *states(trajectories, momenta=momenta), us)
    force = np.abs(input_matrix) @ inputs if input_matrix is not None and np.any(input_matrix) else given.force
    if momenta:
        momentum = _rms(rates)
    elif given.momentum is not None:
        momentum = given.momentum
    elif force is not None:
        power = float(np.sum(velocity * force))
        momentum = power * time / (np.count_nonzero(force) * velocity)
    else:
        momentum = 1 / velocity
    return Scales(
        center=np.concatenate([lengths.mean(axis=0), circles]),
        spread=np.concatenate([_or_one(lengths.std(axis=0)), circles + 1]),
        velocity=velocity,
        momentum=momentum,
        input=inputs,
        time=time,
    )


def states(trajectories: Sequence[Trajectory], *, momenta: bool) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and velocities of all samples; velocities in momentum data are differences of the coordinates.

    Args:
        trajectories: Recordings.
        momenta: Whether the rates are momenta.

    Returns:
        Coordinates (K, n) and velocities (K, n).
    """
    q = np.concatenate([trajectory.q for trajectory in trajectories])
    if momenta:
        return q, np.concatenate([np.gradient(trajectory.q, trajectory.ts, axis=0) for trajectory in trajectories])
    return q, np.concatenate([trajectory.rates for trajectory in trajectories])


def time_scale(trajectories: Sequence[Trajectory]) -> float:
    """Time in which rates change by about their own size [s]: twice the lag after which they have changed by half.

    For a sine of angular frequency ω it is 1/ω, and so it is of one about a mean, such as the ripple of a wheel that
    keeps turning. Differences over a lag, unlike derivatives, hardly feel noise.

    Args:
        trajectories: Recordings.

    Returns:
        Median of the time scales of the coordinates that move; the longest lag where rates change less.
    """
    step, recordings = _evenly(trajectories)
    size = np.std(np.concatenate(recordings), axis=0)
    moving = size > _IDLE * size.max(initial=0.0)
    half = 0.5 * size[moving]
    longest = max(map(len, recordings)) - 1
    previous, before = np.zeros_like(half), 0
    lags = np.full(half.shape, float(longest))
    for lag in _lags(longest):
        changes = [rates[lag:, moving] - rates[:-lag, moving] for rates in recordings]
        change = np.sqrt(np.mean(np.concatenate(changes) ** 2, axis=0))
        crossing = (previous < half) & (change >= half) & (lags == longest)
        share = (half - previous) / np.maximum(change - previous, 1e-300)
        lags[crossing] = (before + (lag - before) * share)[crossing]
        previous, before = np.maximum(previous, change), lag
        if np.all(change >= half):
            break
    return 2 * step * float(np.median(lags)) if lags.size else 2 * step * longest


def _evenly(trajectories: Sequence[Trajectory]) -> tuple[float, list[np.ndarray]]:
    """The usual sampling interval [s], and the rates of every recording at such intervals."""
    steps = np.concatenate([np.diff(trajectory.ts) for trajectory in trajectories])
    step = max(float(np.median(steps)), float(np.mean(steps)) / _MOST_FILLED)
    found = []
    for trajectory in trajectories:
        rates = trajectory.rates
        if np.abs(np.diff(trajectory.ts) - step).max() > step / 2:
            ts = np.arange(trajectory.ts[0], trajectory.ts[-1], step)
            rates = np.stack([np.interp(ts, trajectory.ts, column) for column in rates.T], axis=1)
        found.append(rates)
    return step, found


def _lags(longest: int) -> list[int]:
    """Every small lag, and larger ones a twentieth apart."""
    lags = [1]
    while lags[-1] < longest:
        lags.append(min(longest, max(lags[-1] + 1, round(lags[-1] * 1.05))))
    return lags


def _rms(samples: np.ndarray) -> np.ndarray:
    """Root mean square of every column; 1 where it vanishes."""
    return _or_one(np.sqrt(np.mean(samples**2, axis=0)))


def _or_one(scale: np.ndarray) -> np.ndarray:
    """Replace zeros, which cannot divide."""
    return np.where(scale > 0, scale, 1.0)
