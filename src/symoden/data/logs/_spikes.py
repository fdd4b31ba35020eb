"""Single samples of a sensor that cannot be: glitches of a bus or an encoder."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from symoden.data._shapes import Signals, Times
from symoden.data.signals import TURN, least_change, longest_step, quantum

from ._logs import Log

_OFFSETS: Final = (-2, -1, 1, 2)  # Neighbours of which a cubic predicts a sample.
_LOUD: Final = 8.0  # Standard deviations of what cubics leave, beyond which a sample stands out.
_ROUNDED: Final = 3.0  # Times the most that rounding makes of it, likewise.
_FEWEST: Final = 3 * len(_OFFSETS)  # Samples.
_SEEN: Final = 0.01  # Share of the signal's range, of an angle of a turn at most: what is smaller does no harm.
COARSEST: Final = {"positions": 0.02, "rates": 0.2}
"""Largest step of rounding that a sensor may have, in SI or rad, by role."""
_LIKE, _NOISE = 0.12, 2.0  # Of the deviation, and standard deviations, by which neighbours may differ from a spike's.
_AROUND: Final = 101  # Samples.
_SEVERAL: Final = 2 * TURN  # [rad]
_DEGREES: Final = 360.0  # of a turn
_SAME: Final = 0.5  # Of the deviation.
_FAR: Final = 2.0  # Steps.
_LINE: Final = 0.25  # Of the deviation, by which samples may be off a straight line.
_QUANTILE: Final = 0.8
_NORMAL: Final = 1.2816  # That quantile of the absolute value of a standard normal variable.


@dataclass(frozen=True, kw_only=True, eq=False)
class Spikes:
    """Samples of one column that stand out alone.

    Attributes:
        channel: Name of the column.
        rows: Rows of the log.
        largest: Largest deviation from what the neighbours say, in SI or rad.
    """

    channel: str
    rows: Int[np.ndarray, " k"]
    largest: float

    @classmethod
    def of(
        cls, channel: str, rows: Int[np.ndarray, " r"], alone: Int[np.ndarray, " k"], off: Float[np.ndarray, " r"]
    ) -> "Spikes":
        """Those of a column.

        Args:
            channel: Name of the column.
            rows: Rows of the log that were looked at.
            alone: Which of these stand out.
            off: How far each is from what its neighbours say.

        Returns:
            What stands out, which may be nothing.
        """
        return cls(channel=channel, rows=rows[alone], largest=float(np.abs(off[alone]).max(initial=0.0)))


@runtime_checkable
class HasRows(Protocol):
    """Something wrong with rows of a log: spikes, impossible numbers, a dead spot."""

    @property
    def rows(self) -> Int[np.ndarray, " k"]:
        """Rows of the log."""
        ...


def rows_of(found: Sequence[HasRows]) -> Int[np.ndarray, " k"]:
    """Rows of a log with which anything is wrong, each once.

    Args:
        found: What is wrong.

    Returns:
        The rows, in order.
    """
    return np.unique(np.concatenate([np.zeros(0, int), *(each.rows for each in found)]))


def find_spikes(log: Log, is_angle: np.ndarray) -> tuple[Spikes, ...]:
    """Find single samples of positions and rates that their neighbours on both sides contradict.

    Inputs are left alone: a command may well be an impulse.

    Args:
        log: What was logged; its time stamps increase where they are known.
        is_angle: Whether each coordinate is an angle.

    Returns:
        Those of each column that has any.
    """
    rows = np.flatnonzero(log.complete)
    found = _of_positions(log, rows, is_angle)
    # Rates are often differences of positions: a wrong one makes two of them wrong, that beside it seemingly right.
    return (*found, *_of_rates(log, np.setdiff1d(rows, rows_of(found)), is_angle))


def _of_positions(log: Log, rows: Int[np.ndarray, " k"], is_angle: np.ndarray) -> tuple[Spikes, ...]:
    """Wrong positions among some rows of a log."""
    if len(rows) < _FEWEST:
        return ()
    ts, q = log.ts[rows], unwrapped(log.q[rows], is_angle)
    found = []
    for name, column, angle in zip(log.names["positions"], q.T, is_angle, strict=True):
        # However often an angle has gone round, a wrong one is as wrong.
        alone, off = lone_samples(ts, column, "positions", reach=TURN if angle else np.inf)
        found.append(Spikes.of(name, rows, alone, off))
    return tuple(each for each in found if len(each.rows))


def _of_rates(log: Log, rows: Int[np.ndarray, " k"], is_angle: np.ndarray) -> tuple[Spikes, ...]:
    """Wrong rates among some rows of a log, apart from those that positions agree with."""
    if log.rates is None or len(rows) < _FEWEST:
        return ()
    ts = log.ts[rows]
    slopes = np.diff(unwrapped(log.q[rows], is_angle), axis=0) / np.diff(ts)[:, None]
    found = []
    for name, column, slope in zip(log.names["rates"], log.rates[rows].T, slopes.T, strict=True):
        alone, off = lone_samples(ts, column, "rates")
        found.append(Spikes.of(name, rows, alone[~_confirmed(column, off, slope, alone)], off))
    return tuple(each for each in found if len(each.rows))


def lone_samples(
    ts: Times, signal: Float[np.ndarray, " T"], role: str, *, reach: float = np.inf
) -> tuple[Int[np.ndarray, " k"], np.ndarray]:
    """Find single samples of one column that their neighbours on both sides contradict, none of them beside a gap.

    Args:
        ts: Increasing time stamps [s], at least five.
        signal: The column, an angle without jumps.
        role: "positions" or "rates".
        reach: The most that its range counts for.

    Returns:
        Their indices, and how far each sample is from what its neighbours say.
    """
    steps = np.diff(ts)
    gaps = np.flatnonzero(steps > longest_step(steps))
    near_gap = np.isin(np.arange(len(ts)), np.concatenate([gaps + k for k in range(-3, 5)]))
    off, weights = deviations(ts, signal)
    alone = _spikes(signal, off, weights, coarsest=COARSEST[role], reach=reach)
    alone = alone[~near_gap[alone] & ~_goes_on(ts, signal, off, alone)]
    return alone, off


def _goes_on(ts: Times, signal: np.ndarray, off: np.ndarray, alone: Int[np.ndarray, " k"]) -> np.ndarray:
    """Tell samples where a straight motion ends or begins, as a sharp start or stop between rare samples looks.

    Returns:
        Whether each is such a one.
    """

    def from_straight(side: int) -> np.ndarray:
        """Distance from the straight line through two samples on a side, where a third one is on it."""
        near, next_, far = (alone + k * side for k in (1, 2, 3))
        off_line = np.abs(signal[near] - _straight(ts, signal, near, next_, far))
        distance = np.abs(signal[alone] - _straight(ts, signal, alone, near, next_))
        return np.where(off_line < _LINE * np.abs(off[alone]), distance, np.inf)

    return np.minimum(from_straight(-1), from_straight(1)) < _SAME * np.abs(off[alone])


def _straight(
    ts: Times, signal: np.ndarray, at: Int[np.ndarray, " k"], near: Int[np.ndarray, " k"], far: Int[np.ndarray, " k"]
) -> np.ndarray:
    """What the straight line through two samples says of another one; infinite where it is far from both."""
    steps = (ts[at] - ts[near]) / (ts[near] - ts[far])
    # Of samples close together, noise is all that it shows.
    return np.where(steps < _FAR, signal[near] + steps * (signal[near] - signal[far]), np.inf)


def unwrapped(q: Signals, is_angle: np.ndarray) -> Signals:
    """Positions whose angles do not jump by a turn.

    Those of several turns are not wrapped to one, and may be degrees taken for rad: their jumps are of 360.

    Args:
        q: One column per coordinate.
        is_angle: Whether each is an angle.

    Returns:
        The positions.
    """
    way = q.copy()
    for i in np.flatnonzero(is_angle):
        low, high = np.quantile(q[:, i], (0.01, 0.99))
        way[:, i] = np.unwrap(q[:, i], period=_DEGREES if high - low > _SEVERAL else TURN)
    return way


def _confirmed(rates: np.ndarray, off: np.ndarray, slopes: np.ndarray, alone: np.ndarray) -> np.ndarray:
    """Tell rates that the positions beside them agree with: there a time stamp is late, and sums are still right.

    Returns:
        Whether each is such a one.
    """
    beside = np.stack([slopes[alone - 1], slopes[alone]])
    return np.any(np.abs(beside - rates[alone]) < _SAME * np.abs(off[alone]), axis=0)


def deviations(ts: Times, signal: Float[np.ndarray, " T"]) -> tuple[np.ndarray, np.ndarray]:
    """Deviation of each sample from the cubic through two neighbours on each side, and the cubics' weights.

    Args:
        ts: Increasing time stamps [s], at least five.
        signal: Samples.

    Returns:
        Deviations (T,), zero at the ends; weights (T, 4) of the neighbours.
    """
    size = len(ts)
    index = np.arange(2, size - 2)
    near = np.stack([ts[index + k] for k in _OFFSETS], axis=1) - ts[index, None]
    weights = np.zeros((size, len(_OFFSETS)))
    for j in range(len(_OFFSETS)):
        others = np.delete(near, j, axis=1)
        weights[index, j] = np.prod(-others / (near[:, j : j + 1] - others), axis=1)
    off = np.zeros(size)
    values = np.stack([signal[index + k] for k in _OFFSETS], axis=1)
    off[index] = signal[index] - np.sum(weights[index] * values, axis=1)
    return off, weights


def _spikes(
    signal: np.ndarray, off: np.ndarray, weights: np.ndarray, *, coarsest: float, reach: float
) -> Int[np.ndarray, " k"]:
    """Samples that deviate as nothing else does, and whose neighbours deviate as one wrong sample makes them.

    A wrong sample enters the cubics of its neighbours by their weights; a kink at an impact does so otherwise.

    Returns:
        Their indices.
    """
    from scipy.ndimage import percentile_filter  # slow to import

    # White noise makes each deviation `gain` times its own size: more, where time stamps are close together.
    gain = np.sqrt(1 + np.sum(weights**2, axis=1))
    size = np.abs(off) / gain
    # A velocity's noise may grow with the speed: what is usual around a sample counts too.
    around = percentile_filter(size, 100 * _QUANTILE, size=min(_AROUND, len(off)), mode="nearest")
    level = gain * np.maximum(around, np.quantile(size, _QUANTILE)) / _NORMAL
    low, high = np.quantile(signal, (0.01, 0.99))
    rounding = counts(signal, coarsest) / 2 * (1 + np.sum(np.abs(weights), axis=1))
    usual = np.maximum(_LOUD * level, _ROUNDED * rounding)
    loud = np.flatnonzero(np.abs(off) > np.maximum(usual, _SEEN * min(high - low, reach)))
    loud = loud[(loud >= 4) & (loud < len(signal) - 4)]
    alone = np.ones(len(loud), bool)
    for j, k in enumerate(_OFFSETS):
        # The wrong sample is neighbour −k of its neighbour k, in place len − 1 − j of the weights.
        expected = -weights[loud + k, len(_OFFSETS) - 1 - j] * off[loud]
        alone &= np.abs(off[loud + k] - expected) <= _LIKE * np.abs(off[loud]) + _NOISE * level[loud + k]
    return loud[alone]


def counts(signal: np.ndarray, coarsest: float) -> float:
    """Step of rounding, also of a sensor at rest that flickers by one now and then, too seldom for `quantum`.

    Args:
        signal: Consecutive samples.
        coarsest: What no step of a sensor is beyond, see `COARSEST`.

    Returns:
        The step; 0 where there is none.
    """
    least = least_change(signal)
    return max(quantum(signal), least if least <= coarsest else 0.0)
