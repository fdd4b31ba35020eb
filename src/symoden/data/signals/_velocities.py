"""Velocities from positions, where a recording has none."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float64, Int

from symoden.data._errors import DataError
from symoden.data._shapes import Positions, Rates, Times
from symoden.data._trajectory import finite_numbers, refuse_times_out_of_order

from ._cubics import LEAST
from ._signals import longest_step
from ._spans import choose_spans, fit_span

MOST_SAMPLES: Final = 50_000_000
"""Samples of a recording: of more its time stamps are wrong, or in another unit."""


def estimate_velocities(ts: Times, q: Positions, *, name: str, spans: Int[np.ndarray, " n"] | None = None) -> Rates:
    """Slope of the cubic that fits the positions best around each sample (Savitzky and Golay's smoother).

    `choose_spans` says how many samples a fit spans: enough of them to average out noise and an encoder's steps, and no
    more than the motion's fastest part allows. The window is centred, so that nothing is delayed, and any cubic motion
    is reproduced exactly, at uneven time stamps too: the bias is of order 4 in the window's width. No window spans a
    gap in time: fewer than 5 samples between two gaps have the slope of the line that fits them best, and a sample
    alone, which has none, that of the sample nearest in time.

    Args:
        ts: Time stamps [s].
        q: Positions; angles without jumps.
        name: Name of the recording, for messages.
        spans: Number of samples that the fit spans, for each coordinate; absent, they are chosen.

    Returns:
        Velocities at the time stamps.

    Raises:
        DataError: If the recording is too short, its time stamps do not increase or are too uneven, or the arrays are
            not finite numbers of these shapes.

    References:
        Savitzky and Golay (1964), *Smoothing and differentiation of data by simplified least squares procedures*.
    """
    ts, q = finite_numbers(ts, f"`{name}`: `ts`", axes=1), finite_numbers(q, f"`{name}`: `q`", axes=2)
    if len(ts) < 2:
        raise DataError(f"`{name}`: velocities are estimated from at least 2 samples; got {len(ts)}.")
    if len(ts) != len(q):
        raise DataError(f"`{name}`: `ts` (T,) and `q` (T, n) must agree in T; got shapes {ts.shape} and {q.shape}.")
    refuse_times_out_of_order(ts, f"`{name}`: `ts`")
    parts = _parts(ts, name)
    long = [part for part in parts if part.stop - part.start >= LEAST]
    if spans is None and long:
        spans = choose_spans([ts[part] for part in long], [q[part] for part in long])
    slopes = np.full(q.shape, np.nan)
    for span in set() if spans is None else set(spans.tolist()):
        for part in long:
            alike = spans == span
            cubics = fit_span(ts[part], q[part][:, alike], span)
            slopes[part, alike] = cubics.slopes(ts[part], cubics.near(ts[part])).T
    for part in parts:
        if 2 <= part.stop - part.start < LEAST:
            apart = ts[part] - ts[part].mean()
            slopes[part] = apart @ (q[part] - q[part][0]) / (apart @ apart)
    return slopes[_nearest_with_others(ts, parts)]


def velocity_noise_gain(ts: Times, spans: Int[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Standard deviation of the noise of estimated velocities over that of the positions, which is white.

    It is the norm of the weights with which `estimate_velocities` adds up positions.

    Args:
        ts: Time stamps [s], at least 5.
        spans: Number of samples that the fit spans, for each coordinate.

    Returns:
        The gain [1/s] of each coordinate.

    Example:
        >>> velocity_noise_gain(0.002 * np.arange(100), np.array([15])).round().tolist()
        [76.0]
    """
    nothing = np.empty((len(ts), 0))
    variances = [fit_span(ts, nothing, span).covariance[0, 0].mean() for span in spans.tolist()]
    return np.sqrt(np.array(variances, dtype=np.float64))


def one_sided_errors(ts: Times, q: Positions, *, span: int) -> Float64[np.ndarray, " n"]:
    """How far velocities are off that are estimated from samples on one side alone, as at a recording's ends.

    Every window inside ends somewhere: what its cubic says of its first and last sample is compared with what the one
    around that sample says, which is far more accurate.

    Args:
        ts: Time stamps [s].
        q: Positions; angles without jumps.
        span: Number of samples that the fit spans, an odd one.

    Returns:
        Root mean square of the difference, for each coordinate; NaN where the recording is shorter than two windows.
    """
    span = max(span, LEAST)
    if len(ts) < 2 * span:
        return np.full(q.shape[1], np.nan)
    cubics, reach = fit_span(ts, q, span), span // 2
    centres = np.searchsorted(ts, cubics.ts)
    errors = []
    for edge in (centres - reach, centres + reach):
        which = np.flatnonzero((edge >= reach) & (edge < len(ts) - reach))
        at = ts[edge[which]]
        errors.append(cubics.slopes(at, which) - cubics.slopes(at, cubics.near(at)))
    return np.sqrt(np.mean(np.concatenate(errors, axis=1) ** 2, axis=1))


def averaged_noise_gain(ts: Times, gains: Float64[np.ndarray, " n"], *, averaged: float) -> Float64[np.ndarray, " n"]:
    """Gain in noise of estimated velocities, where positions and velocities are averaged afterwards.

    Args:
        ts: Time stamps before [s], at least 2.
        gains: Gain of each coordinate before [1/s].
        averaged: Width of the window over which positions and velocities are averaged [s].

    Returns:
        The gains [1/s].
    """
    step = float((ts[-1] - ts[0]) / (len(ts) - 1))
    mean = np.ones(max(1, round(averaged / step)))
    return np.array([gain * _correlated(gain * step, mean) for gain in gains])


def _correlated(gain: float, mean: np.ndarray) -> float:
    """What averaging makes of a gain: noise of velocities averages out less than that of the positions."""
    # The window with this gain: its variance per sample is 75/w³ for w samples, nearly.
    half = max(LEAST, round((75 / gain**2) ** (1 / 3))) // 2
    j = np.arange(-half, half + 1.0)
    fourth, sixth = (j**4).sum(), (j**6).sum()
    weights = j * sixth - j**3 * fourth
    return float(np.linalg.norm(np.convolve(weights, mean)) / np.linalg.norm(weights) / np.linalg.norm(mean))


def _nearest_with_others(ts: Times, parts: Sequence[slice]) -> Int[np.ndarray, " T"]:
    """For each sample itself, or the nearest one that is not alone between gaps: most steps are none."""
    nearest = np.arange(len(ts))
    alone = np.array([part.start for part in parts if part.stop - part.start == 1], int)
    others = np.setdiff1d(nearest, alone)
    after = np.searchsorted(others, alone).clip(1, len(others) - 1)
    before = ts[alone] - ts[others[after - 1]] <= ts[others[after]] - ts[alone]
    nearest[alone] = others[np.where(before, after - 1, after)]
    return nearest


def _parts(ts: Times, name: str) -> list[slice]:
    """Stretches without a gap."""
    steps = np.diff(ts)
    extreme = len(ts) >= LEAST and not LEAST - 1 <= (ts[-1] - ts[0]) / np.median(steps) + 0.5 < MOST_SAMPLES
    if len(ts) < LEAST or extreme:
        raise DataError(
            f"`{name}`: velocities are estimated from at least {LEAST} samples without extreme gaps; got {len(ts)} "
            f"samples {steps.min():.6g} to {steps.max():.6g} s apart. Name the columns of `velocities`, or take other "
            "rows."
        )
    starts = [0, *(np.flatnonzero(steps > longest_step(steps)) + 1).tolist()]
    return [slice(start, stop) for start, stop in zip(starts, [*starts[1:], len(ts)], strict=True)]
