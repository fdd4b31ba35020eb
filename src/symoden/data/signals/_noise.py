"""How noisy the sensors of a data set are."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from symoden.data._trajectory import Trajectory

from ._signals import longest_step, noise_level, quantum

_SMOOTH: Final = 0.7  # Ratio of two differences' levels below which they see a motion, and no noise.
_MOST_SAMPLES: Final = 100_000
_HIGH: Final = 5  # Order of the differences.
_LEAST_STEP: Final = 1e-6  # Of the signal's range, which floats are not rounded to.
_BEYOND: Final = 1.2  # Times the noise of rounding: what exceeds it is more than rounding.


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
        rates = np.maximum(rates, np.sqrt(np.mean(np.square(gains), axis=0)) * q)
    return SensorNoise(q, rates)


class _Part(NamedTuple):
    """The first samples of a recording, with the first and second integrals of its inputs."""

    ts: np.ndarray
    q: np.ndarray
    rates: np.ndarray
    moved: tuple[np.ndarray, np.ndarray]
    gain: np.ndarray | None

    @classmethod
    def of(cls, trajectory: Trajectory, most: int) -> "_Part":
        """Cut a recording off."""
        ts, us = trajectory.ts[:most], trajectory.us[:most]
        steps = np.diff(ts)[:, None]
        once = np.concatenate([np.zeros_like(us[:1]), np.cumsum(us[:-1] * steps, axis=0)])
        twice = np.concatenate([np.zeros_like(us[:1]), np.cumsum((once[:-1] + us[:-1] * steps / 2) * steps, axis=0)])
        gain = None if trajectory.noise_gain is None else np.asarray(trajectory.noise_gain)
        return cls(ts, trajectory.q[:most], trajectory.rates[:most], (once, twice), gain)


def rounding_and_noise(ts: Sequence[np.ndarray], signals: Sequence[np.ndarray]) -> tuple[float, float]:
    """Measure the step to which a signal is rounded, and its noise beside rounding.

    Args:
        ts: Time stamps of each recording [s].
        signals: The signal in each.

    Returns:
        The step, and the standard deviation of the noise; 0 where there is none to be seen.
    """
    most = max(1, _MOST_SAMPLES // len(ts))
    times, longest = _joined([each[:most] for each in ts])
    rounding, noise = _rounding_and_noise(
        times, np.concatenate([each[:most] for each in signals]), longest, bursts=True
    )
    if rounding and noise <= _BEYOND * rounding / np.sqrt(12):
        noise = 0.0
    return rounding, float(np.sqrt(max(0.0, noise**2 - rounding**2 / 12)))


def _joined(ts: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Time stamps of several recordings one after another, and the longest step that is no gap."""
    longest = longest_step(np.concatenate([np.diff(each) for each in ts]))
    # No window of differences spans a gap, between two recordings or within one.
    ends = np.cumsum([0.0] + [float(np.ptp(each)) + 2 * longest for each in ts])
    return np.concatenate([each - each[0] + end for each, end in zip(ts, ends[:-1], strict=True)]), longest


def _noises(
    ts: Sequence[np.ndarray], signals: Sequence[np.ndarray], causes: Sequence[np.ndarray]
) -> Float[np.ndarray, " n"]:
    """Noise of each channel of several recordings, rounding included."""
    joined, longest = _joined(ts)
    moved = np.concatenate(causes)
    found = [_rounding_and_noise(joined, column, longest, moved) for column in np.concatenate(signals).T]
    return np.array([max(rounding / np.sqrt(12), noise) for rounding, noise in found])


def _rounding_and_noise(
    ts: np.ndarray, signal: np.ndarray, longest: float, causes: np.ndarray | None = None, *, bursts: bool = False
) -> tuple[float, float]:
    """Step to which one channel is rounded, and what is too fast for a motion, rounding included."""
    low, high = (
        noise_level(ts, signal, longest=longest, order=k, causes=causes, bursts=bursts) for k in (_HIGH - 1, _HIGH)
    )
    rounding = quantum(signal)
    if rounding < np.sqrt(12) * _LEAST_STEP * np.ptp(signal) or not np.ptp(signal):
        rounding = 0.0
    if high <= _SMOOTH * low:
        return rounding, 0.0
    # Rounding is not filtered, though it shrinks too where a signal is slow.
    return rounding, high if rounding or bursts else high * max(1.0, low / high) ** _HIGH
