"""Velocities from positions, where a recording has none."""

import numpy as np

from ._errors import DataError
from ._shapes import Positions, Rates, Times

_WIDTH = 0.05  # [s]: follows motions of 10 Hz, and averages out an encoder's steps at 500 Hz.
_LEAST = 5  # Samples of the narrowest window: the fourth-order difference formula.
_DEGREE = 3
_MOST_SAMPLES = 50_000_000


def estimate_velocities(ts: Times, q: Positions, *, name: str) -> Rates:
    """Slope of the cubic that fits the positions best around each sample (Savitzky and Golay's smoother).

    The fit spans 0.05 s, or 5 samples where these are more than 12.5 ms apart, on a uniform grid of the median step.
    The window is centred, so that nothing is delayed, and any cubic motion is reproduced exactly: the bias is of order
    4 in the window's width. At 500 Hz a sine of 10 Hz loses 1 % of its velocity, and white noise of σ rad becomes 35 σ
    rad/s; a wider window would have less noise and lose more.

    Args:
        ts: Time stamps [s].
        q: Positions; angles without jumps.
        name: Name of the recording, for messages.

    Returns:
        Velocities at the time stamps.

    Raises:
        DataError: If the recording is too short, or its time stamps are too uneven.

    References:
        Savitzky and Golay (1964), *Smoothing and differentiation of data by simplified least squares procedures*.
    """
    from scipy.signal import savgol_filter  # slow to import, seldom needed

    steps = np.diff(ts)
    count = _samples(ts)
    if len(ts) < _LEAST or not _LEAST <= count < _MOST_SAMPLES:
        raise DataError(
            f"`{name}`: velocities are estimated from at least {_LEAST} samples without extreme gaps; got {len(ts)} "
            f"samples {steps.min():.6g} to {steps.max():.6g} s apart. Name the columns of `velocities`, or take other "
            "rows."
        )
    grid, step = np.linspace(ts[0], ts[-1], count, retstep=True)
    window = _window(count, float(step))
    even = np.stack([np.interp(grid, ts, column) for column in q.T], axis=1)
    slopes = np.asarray(savgol_filter(even, window, _DEGREE, deriv=1, delta=float(step), axis=0))
    return np.stack([np.interp(ts, grid, column) for column in slopes.T], axis=1)


def velocity_noise_gain(ts: Times, *, averaged: float = 0.0) -> float:
    """Standard deviation of the noise of estimated velocities over that of the positions, which is white.

    It is the norm of the weights with which `estimate_velocities` adds up positions.

    Args:
        ts: Time stamps [s], at least 2.
        averaged: Width of the window over which positions and velocities are averaged afterwards [s].

    Returns:
        The gain [1/s].

    Example:
        >>> round(velocity_noise_gain(0.002 * np.arange(100)))
        35
    """
    from scipy.signal import savgol_coeffs  # slow to import, seldom needed

    count = _samples(ts)
    step = float((ts[-1] - ts[0]) / (count - 1))
    weights = savgol_coeffs(_window(max(count, _LEAST), step), _DEGREE, deriv=1, delta=step)
    mean = np.ones(max(1, round(averaged / step)))
    return float(np.linalg.norm(np.convolve(weights, mean)) / np.linalg.norm(mean))


def _samples(ts: Times) -> int:
    """Number of samples of a uniform grid of the median step."""
    return round(float((ts[-1] - ts[0]) / np.median(np.diff(ts)))) + 1


def _window(count: int, step: float) -> int:
    """Number of samples, an odd one, that the fit spans."""
    return min(max(_LEAST, 2 * round(_WIDTH / step / 2) + 1), count - 1 + count % 2)
