"""Windows: the short stretches of recordings that training fits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Float64, Int

from ._errors import DataError
from ._trajectory import Trajectory, log_numbers
from .signals import measure_noise

WindowTimes: TypeAlias = Float64[np.ndarray, "B points"]  # h + 1 points
WindowCoordinates: TypeAlias = Float64[np.ndarray, "B points n"]
WindowInputs: TypeAlias = Float64[np.ndarray, "B points m"]

FEWEST_LOGS: Final = 3
"""Fewest logs that tell how much they differ."""

_NOISE: Final = 8.0  # Standard deviations: samples of a rest hardly ever span more, of 20 as of 500.
_STILL: Final = 0.01  # Of a coordinate's range, which in noise is no rest.
_RESTS: Final = 10  # Windows, of which one at rest tells enough.


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """B windows of h + 1 consecutive samples, h being the horizon; the first axis counts windows.

    Attributes:
        ts: Times since the window's first sample [s]; small numbers, so that single precision keeps their steps.
        q: Positions.
        rates: Velocities or momenta.
        us: Inputs.
        recording: Number of the log that each was cut out of, as an encoder has one zero all along it; of fewer than
            three logs in pieces, of its piece.
    """

    ts: WindowTimes
    q: WindowCoordinates
    rates: WindowCoordinates
    us: WindowInputs
    recording: Int[np.ndarray, " B"]

    def __len__(self) -> int:
        """Number of windows B."""
        return len(self.ts)

    def take(self, index: Int[np.ndarray, " k"] | Bool[np.ndarray, " B"]) -> "Windows":
        """Choose windows."""
        return Windows(
            ts=self.ts[index],
            q=self.q[index],
            rates=self.rates[index],
            us=self.us[index],
            recording=self.recording[index],
        )


def windows(trajectories: Sequence[Trajectory], horizon: int, *, stride: int = 1) -> Windows:
    """Cut every window of `horizon` steps out of the trajectories.

    Args:
        trajectories: Recordings of any length, each longer than `horizon` samples.
        horizon: Number of steps h of a window; it has h + 1 samples.
        stride: Samples from one window's start to the next one's. 1 takes every start point, as the paper does.

    Returns:
        The windows, trajectory by trajectory, in the order of their start.

    Raises:
        ValueError: If `horizon` or `stride` is less than 1.
        DataError: If there is no trajectory, or one is shorter than a window.

    Example:
        >>> ts = np.arange(5.0)
        >>> swing = Trajectory(name="swing", ts=ts, q=ts[:, None], rates=np.ones((5, 1)), us=np.zeros((5, 0)))
        >>> windows([swing], 2).q[:, :, 0].tolist()
        [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]
    """
    if horizon < 1 or stride < 1:
        raise ValueError(f"`horizon` and `stride` must be at least 1; got {horizon} and {stride}.")
    if not trajectories:
        raise DataError("Windows must be cut from at least one trajectory; got none.")
    for trajectory in trajectories:
        if len(trajectory) <= horizon:
            raise DataError(
                f"`{trajectory.name}`: a recording must be longer than a window of {horizon + 1} samples; "
                f"got {len(trajectory)} samples. Take a shorter horizon, or leave the recording out."
            )
    ts = _stacked([trajectory.ts for trajectory in trajectories], horizon + 1, stride)
    counts = [(len(trajectory) - 1 - horizon) // stride + 1 for trajectory in trajectories]
    return Windows(
        ts=ts - ts[:, :1],
        q=_stacked([trajectory.q for trajectory in trajectories], horizon + 1, stride),
        rates=_stacked([trajectory.rates for trajectory in trajectories], horizon + 1, stride),
        us=_stacked([trajectory.us for trajectory in trajectories], horizon + 1, stride),
        recording=np.repeat(_numbered(trajectories), counts),
    )


def _numbered(trajectories: Sequence[Trajectory]) -> Int[np.ndarray, " R"]:
    """Which log each recording is of, if these are as many as tell how much they differ; else its own number."""
    numbers = log_numbers(trajectories)
    return numbers if numbers.max() + 1 >= FEWEST_LOGS else np.arange(len(trajectories))


def least_motion(trajectories: Sequence[Trajectory]) -> Float[np.ndarray, " n"]:
    """Say from what change on each coordinate moves.

    Args:
        trajectories: Recordings.

    Returns:
        Eight standard deviations of the sensor's noise, though no more than a hundredth of the coordinate's range.
    """
    ranges = np.max([np.ptp(each.q, axis=0) for each in trajectories], axis=0)
    return np.minimum(_NOISE * measure_noise(trajectories).q, _STILL * ranges)


def with_few_rests(found: Windows, least: Float[np.ndarray, " n"]) -> Windows:
    """Leave out windows in which nothing moves, but for a tenth of all.

    A mechanism that stands still tells the same for as long as it does. By dry friction it stands where nothing else
    would let it, at any force that friction can hold, which no function of the velocity is: laws that are fitted to
    little but rests are those of rests (`benchmarks/`). Where gravity is held, a few tell of it.

    Args:
        found: Windows.
        least: Change of each coordinate from which on it moves.

    Returns:
        All that move, and of the others as many as make a tenth, spaced evenly; the same where nothing moves.
    """
    rests = np.all(np.ptp(found.q, axis=1) <= least, axis=1)
    moving = len(found) - int(np.sum(rests))
    most = max(1, moving // (_RESTS - 1))
    if moving == 0 or len(found) - moving <= most:
        return found
    kept = ~rests
    kept[np.flatnonzero(rests)[spaced_evenly(len(found) - moving, most)]] = True
    return found.take(kept)


def spaced_evenly(count: int, most: int) -> Int[np.ndarray, " k"]:
    """Choose so many of a number of windows, the first and the last among them; all where there are fewer.

    Args:
        count: Number of windows.
        most: How many to choose, at least 1.

    Returns:
        Their indices, in order.

    Example:
        >>> spaced_evenly(9, 3), spaced_evenly(2, 3)
        (array([0, 4, 8]), array([0, 1]))
    """
    return np.linspace(0, count - 1, min(count, most)).round().astype(int)


def _stacked(signals: list[np.ndarray], samples: int, stride: int) -> np.ndarray:
    """Windows of all signals, the window's samples being the second axis."""
    views = [np.lib.stride_tricks.sliding_window_view(signal, samples, axis=0)[::stride] for signal in signals]
    return np.concatenate([np.moveaxis(view, -1, 1) for view in views])
