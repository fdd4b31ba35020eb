"""From a log to recordings: masked, angles unwrapped, rates completed, delays and lags undone, resampled, split."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from symoden.data._errors import DataError
from symoden.data._split import segments
from symoden.data._trajectory import Trajectory, refuse_times_out_of_order
from symoden.data.description import Description
from symoden.data.signals import (
    advance_positions,
    choose_spans,
    delay_inputs,
    estimate_velocities,
    held_mean,
    lag_inputs,
    resample,
    settling,
    velocity_noise_gain,
)

from ._blind import BlindSpot, rows_in_spots
from ._logs import Log
from ._masking import Mask, mask
from ._spikes import find_spikes
from ._stuck import StuckRows


def rows_to_use(
    log: Log,
    description: Description,
    is_angle: np.ndarray,
    spots: Sequence[BlindSpot],
    stuck: Sequence[StuckRows] = (),
) -> Mask:
    """Choose the rows of a log that recordings are made of.

    Args:
        log: What was logged.
        description: What it means and what to do with it.
        is_angle: Whether each coordinate is an angle.
        spots: Dead spots of its sensors.
        stuck: Positions that stand still while their velocities do not.

    Returns:
        The choice, and what was left out.

    Raises:
        DataError: If the time stamps do not increase, or too little is left.
    """
    refuse_times_out_of_order(log.ts, log.time_column, place=log.place)
    chosen = mask(
        log,
        find_spikes(log, is_angle),
        rows_in_spots(log, spots, is_angle),
        stuck,
        resample=description.resample,
        delay=np.ptp([0.0, *description.input_delay])
        + max(description.position_delay)
        + settling(description.input_lag),
    )
    if len(chosen.pieces[0]) < 2:
        raise DataError(
            f"`{log.path}`: a recording must have at least 2 rows without a missing number; got "
            f"{len(chosen.pieces[0])} of {len(log)}. {_emptiest(log)}"
        )
    return chosen


def recordings_of(log: Log, chosen: Mask, description: Description, is_angle: np.ndarray) -> tuple[Trajectory, ...]:
    """Make the recordings of a log.

    Args:
        log: What was logged; without rates, velocities are estimated.
        chosen: Its rows that are used.
        description: What it means and what to do with it.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The recordings, named after the log, with `#1`, `#2`, … where there are several.

    Raises:
        DataError: If too little is left.
    """
    split_every = description.parts[log.part].split_every
    spans = _spans(log, chosen.pieces, is_angle)
    found: list[Trajectory] = []
    for rows in chosen.pieces:
        trajectory = _trajectory(log, rows, description, is_angle, spans=spans)
        found.extend((trajectory,) if split_every is None else segments(trajectory, split_every))
    if len(found) > 1:
        found = [dataclasses.replace(each, name=f"{log.name}#{k}") for k, each in enumerate(found, start=1)]
    return tuple(found)


def _trajectory(
    log: Log, rows: np.ndarray, description: Description, is_angle: np.ndarray, *, spans: np.ndarray
) -> Trajectory:
    """One piece of a log as a recording, its velocities estimated from so many samples where there are none."""
    ts, q = log.ts[rows], _unwrapped(log, rows, is_angle)
    if log.rates is None:
        rates = estimate_velocities(ts, q, name=log.name, spans=spans)
        gain, one_sided = velocity_noise_gain(ts, spans), int(max(spans)) // 2 * float(np.median(np.diff(ts)))
    else:
        rates, estimates = log.rates[rows], description.estimated_velocities
        gain, one_sided = (None, 0.0) if estimates is None else (np.array(estimates.noise_gain), estimates.one_sided)
    trajectory = Trajectory(
        name=log.name,
        ts=ts,
        q=q,
        rates=rates,
        us=_inputs(log, rows) if description.hold == "zero" else log.us[rows],
        initial_samples=description.initial_samples,
        noise_gain=gain,
        one_sided=one_sided,
    )
    trajectory = advance_positions(trajectory, description.position_delay)
    trajectory = delay_inputs(trajectory, description.input_delay, hold=description.hold)
    trajectory = lag_inputs(trajectory, description.input_lag, hold=description.hold)
    if description.resample is not None:
        trajectory = resample(trajectory, description.resample, hold=description.hold)
    return trajectory


def _inputs(log: Log, rows: np.ndarray) -> np.ndarray:
    """Held inputs of a piece: where rows were left out after one, their mean up to the next one, as far as known."""
    us = log.us[rows]
    before = np.flatnonzero(np.diff(rows) > 1)
    if len(before):
        span = np.arange(rows[0], rows[-1] + 1)
        ts = log.ts[span]
        at, widths = log.ts[rows[before]], np.diff(log.ts[rows])[before, None]
        for j, u in enumerate(log.us[span].T):
            known = np.isfinite(ts) & np.isfinite(u)
            us[before, j] = held_mean(ts[known], u[known, None], at, widths)[:, 0]
    return us


def _spans(log: Log, pieces: Sequence[np.ndarray], is_angle: np.ndarray) -> np.ndarray:
    """How many samples to estimate each velocity from, the same in all pieces; none where it was measured."""
    if log.rates is not None:
        return np.arange(0)
    return choose_spans([log.ts[rows] for rows in pieces], [_unwrapped(log, rows, is_angle) for rows in pieces])


def _unwrapped(log: Log, rows: np.ndarray, is_angle: np.ndarray) -> np.ndarray:
    """Positions of a piece, angles without jumps."""
    q = log.q[rows]
    q[:, is_angle] = np.unwrap(q[:, is_angle], axis=0)
    return q


def _emptiest(log: Log) -> str:
    """Name the column that lacks most numbers."""
    columns = {"time": log.ts[:, None], **log.signals}
    absent = {
        log.names[role][i]: int(np.isnan(signal[:, i]).sum())
        for role, signal in columns.items()
        if role in log.names
        for i in range(signal.shape[1])
    }
    name = max(absent, key=lambda column: absent[column])
    return f"Column `{name}` lacks {absent[name]}; leave it or the file out."
