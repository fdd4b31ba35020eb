"""Recordings on a uniform time grid, without aliasing and without phase lag."""

import dataclasses
from typing import Literal

import numpy as np

from symoden.data._errors import DataError
from symoden.data._shapes import Inputs, Signals, Times
from symoden.data._trajectory import Trajectory

from ._signals import whole_steps
from ._velocities import MOST_SAMPLES, averaged_noise_gain

_ROUNDED = 1e-3  # Of a step: stamps that count from 1970 are rounded to 2.4e-7 s.
_FINEST = 50  # Samples between two of the recording: more tell nothing, and time stamps are in another unit.


def resample(trajectory: Trajectory, dt: float, *, hold: Literal["zero", "linear"] = "zero") -> Trajectory:
    """Bring a recording to samples `dt` apart, from its first time stamp on.

    A step longer than the recording's own takes averages over a centred window of width `dt` (the exact integral of
    the line through the samples; the window shrinks symmetrically at the ends): what is faster than the new samples
    can show averages out instead of turning up as a slow motion, and nothing is delayed. Velocities are averaged
    alike, so that they stay the derivative of the positions. A shorter step interpolates linearly. An input with hold
    "zero" becomes the mean of the held signal over [t, t + dt), which keeps every impulse ∫u dt.

    Args:
        trajectory: The recording, its time stamps as irregular as they are.
        dt: New step [s].
        hold: What the input is between samples.

    Returns:
        The recording at the new times; `initial_samples` counts the new samples.

    Raises:
        ValueError: If `dt` is not positive.
        DataError: If the recording is shorter than a step, or would have too many samples, or far more than it had.
    """
    if not dt > 0:
        raise ValueError(f"`dt` must be positive; got {dt}.")
    ts, elapsed = trajectory.ts, trajectory.ts - trajectory.ts[0]
    (steps,) = whole_steps(elapsed[-1:], dt, rounded=_ROUNDED)
    if not 1 <= steps < MOST_SAMPLES:
        raise DataError(
            f"`{trajectory.name}`: `resample` must give 2 to {MOST_SAMPLES} samples; got a step of {dt} s for a "
            f"recording of {elapsed[-1]:.6g} s. It is a time [s]: 0.01 for 100 rows a second."
        )
    usual = float(np.median(np.diff(ts)))
    if dt * _FINEST < usual:
        raise DataError(
            f"`{trajectory.name}`: `resample` must not be far shorter than the recording's own steps; got {dt:g} s "
            f"where they are {usual:.4g} s. Are its time stamps in ms or us? `units` says so, by their column's name."
        )
    grid = dt * np.arange(int(steps) + 1)
    width = dt if dt > usual * (1 + 1e-6) else 0.0
    average_held = hold == "zero"
    us = (
        held_mean(elapsed, trajectory.us, grid, dt)
        if average_held
        else centred_mean(elapsed, trajectory.us, grid, width)
    )
    before = trajectory.noise_gain
    gain = None if before is None else averaged_noise_gain(ts, np.asarray(before), averaged=width)
    return dataclasses.replace(
        trajectory,
        ts=ts[0] + grid,
        q=centred_mean(elapsed, trajectory.q, grid, width),
        rates=centred_mean(elapsed, trajectory.rates, grid, width),
        us=us,
        noise_gain=gain,
    )


def centred_mean(ts: Times, signals: Signals, at: np.ndarray, width: float) -> np.ndarray:
    """Mean of the line through the samples over windows centred at given times.

    Args:
        ts: Time stamps [s].
        signals: One column per signal.
        at: Centres of the windows [s], within the time stamps.
        width: Width of the windows [s]; 0 interpolates.

    Returns:
        One row per window. Windows that reach beyond the samples are shrunk symmetrically.
    """
    half = np.clip(np.minimum(at - ts[0], ts[-1] - at), 0.0, width / 2)
    value = _interpolated(ts, signals, at)
    area = np.zeros_like(signals)
    np.cumsum(np.diff(ts)[:, None] * (signals[1:] + signals[:-1]) / 2, axis=0, out=area[1:])
    integral = _integral(ts, signals, area, at + half) - _integral(ts, signals, area, at - half)
    wide = half > 1e-9 * (ts[-1] - ts[0])  # A narrower window has lost its integral to rounding.
    return np.where(wide[:, None], integral / np.where(wide, 2 * half, 1.0)[:, None], value)


def held_mean(ts: Times, signals: Inputs, at: np.ndarray, width: float | np.ndarray) -> np.ndarray:
    """Mean, over [t, t + width), of signals that keep each sample's value until the next one.

    Args:
        ts: Time stamps [s].
        signals: One column per signal; the last sample is held for ever.
        at: Starts t of the windows [s], not before the first time stamp.
        width: Width of the windows [s]; a column of one width per window, or one for all.

    Returns:
        One row per window.
    """
    widths = np.broadcast_to(width, (len(at), 1))
    end = max(ts[-1], at[-1]) + 2 * widths.max()
    knots = np.append(ts, end)
    area = np.zeros((len(knots), signals.shape[1]))
    np.cumsum(np.diff(knots)[:, None] * signals, axis=0, out=area[1:])
    means = (_interpolated(knots, area, at + widths[:, 0]) - _interpolated(knots, area, at)) / widths
    return np.clip(means, signals.min(axis=0), signals.max(axis=0))  # An input that never changes has no rounding.


def _interpolated(ts: np.ndarray, signals: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Lines through the samples of every column, at given times."""
    columns = [np.interp(at, ts, column) for column in signals.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(at), 0))


def _integral(ts: Times, signals: Signals, area: Signals, at: np.ndarray) -> np.ndarray:
    """Integral of the lines through the samples from the first sample to given times."""
    before = np.clip(np.searchsorted(ts, at, side="right") - 1, 0, len(ts) - 1)
    return area[before] + (at - ts[before])[:, None] * (signals[before] + _interpolated(ts, signals, at)) / 2
