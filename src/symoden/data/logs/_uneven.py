"""Time stamps that scatter about an even clock, by which positions go on more smoothly."""

from typing import Final

import numpy as np

from symoden.data._findings import Finding
from symoden.data._shapes import Times
from symoden.data.signals import longest_step, quantum

from ._logs import Log
from ._spikes import deviations, unwrapped

_FEWEST: Final = 100  # Rows.
_JITTER: Final = 0.1  # Standard deviation of the steps, relative to their mean, below which it matters little.
_COUNTS: Final = 2  # Of its encoder that a position must usually go from row to row, or what is left is rounding.
_SMOOTHER: Final = 0.6  # Share of what neighbours leave of a position: more may be chance, or noise.


def find_uneven(log: Log, is_angle: np.ndarray) -> list[Finding]:
    """Say that stamps scatter where positions do not.

    A program that is late at one message is early at the next: its stamps scatter, and slopes over them are noise. If a
    cubic through neighbours predicts positions far better where rows are numbered than where they are stamped, rows
    were taken evenly. Noise hides that: then either predicts as badly.

    Args:
        log: What was logged.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The finding, or none.
    """
    rows = np.flatnonzero(log.complete)
    if len(rows) < _FEWEST or "time" not in log.names or log.arrivals is not None:
        return []
    ts, q = log.ts[rows], log.q[rows]
    steps = np.diff(ts)
    if (steps <= 0).any():
        return []  # Which is said already.
    usual = steps[steps <= longest_step(steps)]
    mean = float(usual.mean())
    if np.std(usual) < _JITTER * mean:
        return []
    moving = [one for one in unwrapped(q, is_angle).T if np.median(np.abs(np.diff(one))) > _COUNTS * quantum(one)]
    if not moving:
        return []
    stamped, even = (np.array([_left(at, one) for one in moving]) for at in (ts, mean * np.arange(len(ts))))
    ratio = even / np.maximum(stamped, np.finfo(float).tiny)
    if np.median(ratio) > _SMOOTHER:
        return []
    (name,) = log.names["time"]
    low, high = 1000 * np.quantile(usual, (0.05, 0.95))
    return [
        Finding(
            kind="clocks",
            level="warning",
            channel=name,
            text=f"`{name}` says that rows are {low:.3g} to {high:.3g} ms apart, but positions go on as if all were "
            f"{1000 * mean:.3g} ms: neighbours then predict them {1 / np.median(ratio):.2g} times as well. Stamps of "
            "arrival?",
            advice=f"If the sensor measures at an even rate, write `dt = {mean:.3g}` beside `time`, as exactly as you "
            "know it.",
        )
    ]


def _left(ts: Times, signal: np.ndarray) -> float:
    """What cubics through neighbours usually leave of a signal, as the deviation that one sample would have."""
    off, weights = deviations(ts, signal)
    return float(np.median(np.abs(off[2:-2]) / np.sqrt(1 + np.sum(weights[2:-2] ** 2, axis=1))))
