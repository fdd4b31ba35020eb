"""How fast recorded motion is."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._trajectory import Trajectory

_IDLE: Final = 1e-3  # Share of what the liveliest length, or angle, has, below which another one rests.
_MOST_FILLED: Final = 10  # Samples in place of one where sampling is uneven.


def least_lively(
    sizes: Float[np.ndarray, " n"], is_angle: Sequence[bool] | Bool[np.ndarray, " n"], *, idle: float = _IDLE
) -> Float[np.ndarray, " n"]:
    """Sizes below which coordinates rest: nothing moves, or an encoder flickers.

    Lengths are compared with lengths and angles with angles: a cart may be logged in micrometres beside radians.

    Args:
        sizes: What every coordinate has of something.
        is_angle: Which of them are angles.
        idle: Share of the largest of its kind.

    Returns:
        The least size of every coordinate.
    """
    angles = np.asarray(is_angle, bool)
    largest = [sizes[angles == kind].max(initial=0.0) for kind in (False, True)]
    return idle * np.where(angles, largest[1], largest[0])


def time_scales(
    trajectories: Sequence[Trajectory], is_angle: Sequence[bool] | Bool[np.ndarray, " n"], *, idle: float = _IDLE
) -> Float[np.ndarray, " k"]:
    """Times in which rates change by about their own size: twice the lags after which they have changed by half.

    For a sine of angular frequency ω it is 1/ω, and so it is of one about a mean, such as the ripple of a wheel that
    keeps turning. Differences over a lag, unlike derivatives, hardly feel noise.

    Args:
        trajectories: Recordings.
        is_angle: Which coordinates are angles.
        idle: Share of the rate of the liveliest of its kind below which a coordinate rests.

    Returns:
        The time scale [s] of each coordinate that moves: twice the longest lag where its rate changes less, and alone
        where none moves.

    Example:
        >>> ts = 0.01 * np.arange(1000)
        >>> q, v = np.sin(3 * ts)[:, None], 3 * np.cos(3 * ts)[:, None]
        >>> swing = Trajectory(name="swing", ts=ts, q=q, rates=v, us=q[:, :0])
        >>> time_scales([swing], [False]).round(2).tolist()
        [0.34]
    """
    step, recordings = _evenly(trajectories)
    size = np.std(np.concatenate(recordings), axis=0)
    moving = size > least_lively(size, is_angle, idle=idle)
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
    return 2 * step * (lags if lags.size else np.array([float(longest)]))


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
