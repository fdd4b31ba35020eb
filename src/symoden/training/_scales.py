"""Natural units of a mechanism, read off its recordings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symoden.data import Trajectory, least_lively, states, time_scales
from symoden.known import KnownParts
from symoden.models import KnownMagnitudes, Scales, known_magnitudes, parameter_units
from symoden.spaces import Space


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
        The scales; what never moves has unit scale, and what hardly does a thousandth of the fastest one's of its kind.
    """
    lengths = np.concatenate([trajectory.q for trajectory in trajectories])[:, space.lengths]
    circles = np.zeros(space.embedded_size - lengths.shape[1])
    rates = np.concatenate([trajectory.rates for trajectory in trajectories])
    slopes = np.concatenate([np.diff(t.q, axis=0) / np.diff(t.ts)[:, None] for t in trajectories])
    time = time_scale(trajectories, space)
    us = np.concatenate([trajectory.us for trajectory in trajectories])
    velocity = _rms(slopes if momenta else rates)
    velocity = np.maximum(velocity, least_lively(velocity, space.is_angle))  # The flicker of an encoder is no motion.
    inputs = _rms(us)
    at = () if known is None else (*states(trajectories, momenta=momenta), us)
    given = KnownMagnitudes(None, None) if known is None else known_magnitudes(known, space, *at)
    force = np.abs(input_matrix) @ inputs if input_matrix is not None and np.any(input_matrix) else given.force
    momentum = _rms(rates) if momenta else given.momentum
    if momentum is None and force is not None:
        power = float(np.sum(velocity * force))
        momentum = power * time / (np.count_nonzero(force) * velocity)
    center, spread = lengths.mean(axis=0), _or_one(lengths.std(axis=0))
    farthest = np.abs(lengths - center).max(axis=0, initial=0.0) / spread
    scales = Scales(
        center=np.concatenate([center, circles]),
        spread=np.concatenate([spread, circles + 1]),
        reach=np.concatenate([np.maximum(farthest, 1.0), circles + 1]),
        velocity=velocity,
        momentum=1 / velocity if momentum is None else momentum,
        input=inputs,
        time=time,
    )
    if known is None:
        return scales
    # What is held still, or moves slowly, bears larger forces than accelerate it.
    largest = np.maximum(scales.force, 0.0 if force is None else force)
    units = parameter_units(known, space, *at, acceleration=velocity / time, force=largest)
    return replace(scales, parameters=units)


def time_scale(trajectories: Sequence[Trajectory], space: Space) -> float:
    """Time in which rates change by about their own size [s], see `time_scales`.

    Args:
        trajectories: Recordings.
        space: Their configuration space.

    Returns:
        Median of the time scales of the coordinates that move.
    """
    return float(np.median(time_scales(trajectories, space.is_angle)))


def _rms(samples: np.ndarray) -> np.ndarray:
    """Root mean square of every column; 1 where it vanishes."""
    return _or_one(np.sqrt(np.mean(samples**2, axis=0)))


def _or_one(scale: np.ndarray) -> np.ndarray:
    """Replace zeros, which cannot divide."""
    return np.where(scale > 0, scale, 1.0)
