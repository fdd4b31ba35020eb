"""How noisy the sensors of a data set are."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from ._signals import noise_level, quantum
from ._trajectory import Trajectory

_SMOOTH: Final = 0.5  # Ratio of two differences' levels below which they see a motion, and no noise.
_MOST_SAMPLES: Final = 100_000
_HIGH: Final = 5  # Order of the differences.


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
    motion. Noise that a filter has cut off shrinks too, though less: the level is continued back to order 0.

    Args:
        trajectories: Recordings.

    Returns:
        The noise, rounding included.

    References:
        von Neumann et al. (1941), *The mean square successive difference*.
    """
    most = max(1, _MOST_SAMPLES // len(trajectories))
    parts = [(each.ts[:most], each.q[:most], each.rates[:most]) for each in trajectories]
    longest = max(float(np.diff(ts).max()) for ts, _, _ in parts)
    ends = np.cumsum([0.0] + [ts[-1] - ts[0] + 3 * longest for ts, _, _ in parts])
    # No window of differences spans a gap between two recordings.
    ts = np.concatenate([ts - ts[0] + end for (ts, _, _), end in zip(parts, ends[:-1], strict=True)])
    q, rates = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
    return SensorNoise(*(np.array([_noise(ts, x, longest) for x in signals.T]) for signals in (q, rates)))


def _noise(ts: np.ndarray, signal: np.ndarray, longest: float) -> float:
    """Noise of one channel."""
    low, high = (noise_level(ts, signal, longest=2 * longest, order=order) for order in (_HIGH - 1, _HIGH))
    rounding = quantum(signal) / np.sqrt(12)
    if high <= _SMOOTH * low:
        return rounding
    # Rounding is not filtered, though it shrinks too where a signal is slow.
    return max(rounding, high if rounding else high * max(1.0, low / high) ** _HIGH)
