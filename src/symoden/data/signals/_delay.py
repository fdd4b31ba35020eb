"""Delays: of inputs, where what acts now was logged a while ago, and of sensors, which tell of a while ago."""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from symoden.data._errors import DataError
from symoden.data._trajectory import Trajectory

from ._resample import centred_mean, held_mean


def one_each(seconds: Sequence[float], count: int, *, key: str, of: str, name: str) -> Float[np.ndarray, " k"]:
    """Times for each column of one kind.

    Args:
        seconds: One for each column, or one for all of them [s].
        count: Number of columns k.
        key: What a description calls the times.
        of: What the columns are, one of them.
        name: Name of the recording.

    Returns:
        One for each column.

    Raises:
        DataError: If their number is wrong.
    """
    if len(seconds) not in (1, count):
        raise DataError(
            f"`{name}`: `{key}` must be one number or one per {of}, {count}; got {len(seconds)}: {list(seconds)}."
        )
    return np.broadcast_to(np.asarray(seconds, float), count)


def delay_inputs(trajectory: Trajectory, delays: Sequence[float], *, hold: Literal["zero", "linear"]) -> Trajectory:
    """Let the input that acts at t be the one that was logged at t − delay.

    With hold "zero" the delayed signal changes between the time stamps. Each sample then takes its mean over the time
    to the next sample, the integral being exact: every impulse ∫u dt is kept at any time stamps and nothing is aliased.
    With hold "linear" it is interpolated. What acted on the first samples was logged before the recording began; they
    are left out, since any value put there would be learned as physics. A delay below zero is the log's own: a filter,
    or a mean that is stamped at its end, tells what acted a while ago. Then the last samples are left out.

    Args:
        trajectory: The recording, before it is resampled.
        delays: Delay of each input [s], or one for all of them.
        hold: What an input is between samples.

    Returns:
        The recording of the samples whose inputs are all known.

    Raises:
        DataError: If their number is wrong, or a delay leaves less than two samples.
    """
    ts, us = trajectory.ts, trajectory.us
    every = one_each(delays, us.shape[1], key="input_delay", of="input", name=trajectory.name)
    if not every.any():
        return trajectory
    late, early = max(0.0, *delays), max(0.0, *(-delay for delay in delays))
    first = int(np.searchsorted(ts, ts[0] + late * (1 - 1e-12)))
    stop = int(np.searchsorted(ts, ts[-1] - early * (1 - 1e-12), side="right"))
    if stop - first < 2:
        raise DataError(
            f"`{trajectory.name}`: `input_delay` must be shorter than the recording; got "
            f"{late if late > early else -early} s for {trajectory.duration:.6g} s. Give it in seconds."
        )
    elapsed = ts - ts[0]
    steps = np.diff(elapsed, append=2 * elapsed[-1] - elapsed[-2])[first:stop, None]
    columns = []
    for column, delay in zip(us.T, every, strict=True):
        at = np.clip(elapsed[first:stop] - delay, 0.0, elapsed[-1])
        if hold == "zero":
            columns.append(held_mean(elapsed, column[:, None], at, steps))
        else:
            columns.append(centred_mean(elapsed, column[:, None], at, 0.0))
    kept = trajectory.cut(first, stop, name=trajectory.name)
    return dataclasses.replace(kept, us=np.concatenate(columns, axis=1))


def advance_positions(trajectory: Trajectory, delays: Sequence[float]) -> Trajectory:
    """Let each position, and its rate, be that of the time at which it was, of sensors that are late.

    Between samples positions are interpolated by monotone cubics, rates linearly. The last samples, whose positions
    were not logged any more, are left out.

    Args:
        trajectory: The recording, angles without jumps, before it is resampled.
        delays: Delay of each position [s], or one for all of them.

    Returns:
        The recording up to the last sample whose positions are all known.

    Raises:
        DataError: If their number is wrong, or a delay leaves less than two samples.

    References:
        Fritsch & Carlson (1980), *Monotone piecewise cubic interpolation*.
    """
    ts, size = trajectory.ts, trajectory.q.shape[1]
    every = one_each(delays, size, key="position_delay", of="position", name=trajectory.name)
    if not every.any():
        return trajectory
    longest = max(delays)
    count = int(np.searchsorted(ts, ts[-1] - longest * (1 - 1e-12), side="right"))
    if count < 2:
        raise DataError(
            f"`{trajectory.name}`: `position_delay` must be shorter than the recording; got {longest} s for "
            f"{trajectory.duration:.6g} s. Give it in seconds."
        )
    elapsed = ts - ts[0]
    kept = trajectory.cut(0, count, name=trajectory.name)
    q, rates = kept.q.copy(), kept.rates.copy()
    for i, delay in enumerate(every):
        if delay:
            at = np.minimum(elapsed[:count] + delay, elapsed[-1])
            q[:, i] = PchipInterpolator(elapsed, trajectory.q[:, i])(at)
            rates[:, i] = np.interp(at, elapsed, trajectory.rates[:, i])
    return dataclasses.replace(kept, q=q, rates=rates)
