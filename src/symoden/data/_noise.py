"""How noisy the sensors of a data set are."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from ._signals import longest_step, noise_level, quantum
from ._trajectory import Trajectory

_SMOOTH: Final = 0.7  # Ratio of two differences' levels below which they see a motion, and no noise.
_MOST_SAMPLES: Final = 100_000
_HIGH: Final = 5  # Order of the differences.
_LEAST_STEP: Final = 1e-6  # Of the signal's range, which floats are not rounded to.


class SensorNoise(NamedTuple):
    """Standard deviation of the noise in every channel; 0 where there is none to be seen beside the motion.

    Attributes:
        q: Of the coordinates.
        rates: Of the velocities or momenta.
    """

    q: Float[np.ndarray, " n"]
    rates: Float[np.ndarray, " n"]

    @property
    def is_seen(self) -> bool:
        """Whether there is any."""
        return bool(np.any(self.q > 0) or np.any(self.rates > 0))


def measure_noise(trajectories: Sequence[Trajectory]) -> SensorNoise:
    """Measure the noise of the sensors from what is too fast for a motion.

    Differences of order k, scaled to unit weight, leave white noise its size whatever k, while those of a motion of
    angular frequency ω shrink by a factor of ω times the step from order to order. So two orders tell noise from
    motion. Noise that a filter has cut off shrinks too, though less: the level is continued back to order 0. Inputs
    may change at once; what their first and second integrals move is no noise.

    Velocities that were estimated from positions (`Trajectory.noise_gain`) have the noise of the positions times their
    gain. Of velocities that the machine itself has filtered, the level is too small: what a filter has left of their
    noise is as slow as a motion (2nd-order low-pass of 20 Hz at 500 Hz: a twentieth of it is found).

    Args:
        trajectories: Recordings.

    Returns:
        The noise, rounding included.

    References:
        von Neumann et al. (1941), *The mean square successive difference*.
    """
    most = max(1, _MOST_SAMPLES // len(trajectories))
    parts = [_Part.of(each, most) for each in trajectories]
    q = _noises([part.ts for part in parts], [part.q for part in parts], [part.moved[1] for part in parts])
    rates = np.zeros_like(q)
    if logged := [part for part in parts if part.gain is None]:
        rates = _noises(
            [part.ts for part in logged], [part.rates for part in logged], [part.moved[0] for part in logged]
        )
    if gains := [part.gain for part in parts if part.gain is not None]:
        rates = np.maximum(rates, np.sqrt(np.mean(np.square(gains))) * q)
    return SensorNoise(q, rates)


class _Part(NamedTuple):
    """The first samples of a recording, with the first and second integrals of its inputs."""

    ts: np.ndarray
    q: np.ndarray
    rates: np.ndarray
    moved: tuple[np.ndarray, np.ndarray]
    gain: float | None

    @classmethod
    def of(cls, trajectory: Trajectory, most: int) -> "_Part":
        """Cut a recording off."""
        ts, us = trajectory.ts[:most], trajectory.us[:most]
        steps = np.diff(ts)[:, None]
        once = np.concatenate([np.zeros_like(us[:1]), np.cumsum(us[:-1] * steps, axis=0)])
        twice = np.concatenate([np.zeros_like(us[:1]), np.cumsum((once[:-1] + us[:-1] * steps / 2) * steps, axis=0)])
        return cls(ts, trajectory.q[:most], trajectory.rates[:most], (once, twice), trajectory.noise_gain)


def _noises(
    ts: Sequence[np.ndarray], signals: Sequence[np.ndarray], causes: Sequence[np.ndarray]
) -> Float[np.ndarray, " n"]:
    """Noise of each channel of several recordings."""
    longest = longest_step(np.concatenate([np.diff(each) for each in ts]))
    # No window of differences spans a gap, between two recordings or within one.
    ends = np.cumsum([0.0] + [float(np.ptp(each)) + 2 * longest for each in ts])
    joined = np.concatenate([each - each[0] + end for each, end in zip(ts, ends[:-1], strict=True)])
    moved = np.concatenate(causes)
    return np.array([_noise(joined, column, longest, moved) for column in np.concatenate(signals).T])


def _noise(ts: np.ndarray, signal: np.ndarray, longest: float, causes: np.ndarray) -> float:
    """Noise of one channel."""
    low, high = (noise_level(ts, signal, longest=longest, order=k, causes=causes) for k in (_HIGH - 1, _HIGH))
    rounding = quantum(signal) / np.sqrt(12)
    if rounding < _LEAST_STEP * np.ptp(signal) or not np.ptp(signal):
        rounding = 0.0
    if high <= _SMOOTH * low:
        return rounding
    # Rounding is not filtered, though it shrinks too where a signal is slow.
    return max(rounding, high if rounding else high * max(1.0, low / high) ** _HIGH)
