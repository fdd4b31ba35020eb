"""Windows: the short stretches of recordings that training fits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64, Int

from ._errors import DataError
from ._trajectory import Trajectory

WindowTimes: TypeAlias = Float64[np.ndarray, "B points"]  # h + 1 points
WindowCoordinates: TypeAlias = Float64[np.ndarray, "B points n"]
WindowInputs: TypeAlias = Float64[np.ndarray, "B points m"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """B windows of h + 1 consecutive samples, h being the horizon; the first axis counts windows.

    Attributes:
        ts: Times since the window's first sample [s]; small numbers, so that single precision keeps their steps.
        q: Positions.
        rates: Velocities or momenta.
        us: Inputs.
    """

    ts: WindowTimes
    q: WindowCoordinates
    rates: WindowCoordinates
    us: WindowInputs

    def __len__(self) -> int:
        """Number of windows B."""
        return len(self.ts)


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
    return Windows(
        ts=ts - ts[:, :1],
        q=_stacked([trajectory.q for trajectory in trajectories], horizon + 1, stride),
        rates=_stacked([trajectory.rates for trajectory in trajectories], horizon + 1, stride),
        us=_stacked([trajectory.us for trajectory in trajectories], horizon + 1, stride),
    )


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
