"""Lags: what motors, propellers and valves make of the inputs that they are told."""

import dataclasses
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from jaxtyping import Float

from symoden.data._errors import DataError
from symoden.data._trajectory import Trajectory

from ._delay import one_each

SETTLED: Final = 3.0
"""Time constants after which a twentieth is left of what acted before a recording."""


def lag_inputs(trajectory: Trajectory, lags: Sequence[float], *, hold: Literal["zero", "linear"]) -> Trajectory:
    """Let what acts follow the logged inputs by a first-order lag, τ ẋ = u − x, such as a motor's or a propeller's.

    It is solved exactly from sample to sample, for inputs that are held or joined by straight lines. With hold "zero"
    each sample takes the mean of x until the next one, which keeps every impulse; with hold "linear" x itself. What
    acted when the recording began is not known, unless an input is never anything but zero: it is taken for the first
    sample, and the samples of the first three time constants, in which this matters, are left out.

    Args:
        trajectory: The recording, before it is resampled.
        lags: Time constant τ of each input [s], or one for all of them; 0 for none.
        hold: What an input is between samples.

    Returns:
        The recording of what acts, of the samples that tell it.

    Raises:
        DataError: If their number is wrong, or less than two samples are left.
    """
    ts, us = trajectory.ts, trajectory.us
    told = one_each(lags, us.shape[1], key="input_lag", of="input", name=trajectory.name)
    every = np.where(us.any(axis=0), told, 0.0)
    if not every.any():
        return trajectory
    first = int(np.searchsorted(ts, ts[0] + settling(every) * (1 - 1e-12)))
    if len(ts) - first < 2:
        raise DataError(
            f"`{trajectory.name}`: `input_lag` must be less than a third of the recording, whose first samples do not "
            f"tell what acted; got {every.max():g} s for {trajectory.duration:.6g} s. Give it in seconds."
        )
    acting = us.copy()
    for i in np.flatnonzero(every):
        acting[:, i] = _followed(np.diff(ts), us[:, i], float(every[i]), held=hold == "zero")
    return dataclasses.replace(trajectory, us=acting).cut(first, len(ts), name=trajectory.name)


def _followed(
    steps: Float[np.ndarray, " S"], u: Float[np.ndarray, " T"], lag: float, *, held: bool
) -> Float[np.ndarray, " T"]:
    """What follows an input: its means over the steps if that is held, else its values at the samples."""
    left = np.exp(-steps / lag)
    slopes = np.zeros_like(steps) if held else np.diff(u) / steps
    x = np.empty_like(u)
    x[0] = u[0]
    # x − (u − τ u̇) decays from step to step, u being a straight line in each.
    for k, (share, slope) in enumerate(zip(left, slopes, strict=True)):
        x[k + 1] = u[k] + slope * (steps[k] - lag) + (x[k] - u[k] + slope * lag) * share
    if not held:
        return x
    widths = np.append(steps, steps[-1])
    return u + (x - u) * -np.expm1(-widths / lag) * lag / widths


def settling(lags: Sequence[float] | np.ndarray) -> float:
    """How much of a recording's beginning may be left out for lags.

    Args:
        lags: Time constants [s].

    Returns:
        The time [s].
    """
    return SETTLED * max(lags)
