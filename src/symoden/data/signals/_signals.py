"""Facts of one logged signal: its steps, its noise, whether it stands still or is cut off."""

from typing import Final

import numpy as np

from symoden.data._shapes import Times

_ORDER: Final = 5
_SIGMA: Final = 1.4826  # standard deviation of a Gaussian over the median of its absolute value
_MODES, _PARTS, _RECURS = 5, 6, 0.003
_ON_GRID, _ON_GRID_TOO, _NEAR, _TINY = 0.85, 0.6, 0.1, 1e-3
_LEAST_CHANGES = 0.01  # share of the samples; a staircase changes more seldom, and is no rounding
_FEWEST_OTHERS = 3  # changes beside these, pauses included
_LEAST_AT_EXTREME, _FEWEST_AT_EXTREME, _EDGE = 0.01, 3, 0.05
_EQUAL: Final = 1e-9  # of the signal's range: changes that are no more are errors of floats
_USUAL: Final = 0.95  # share of the steps that are at most a usual one
_FAR_LONGER: Final = 5  # usual steps: real loggers hiccup by 3 to 4 of them, which interpolation bridges


def longest_step(steps: Times, *, resample: float | None = None) -> float:
    """Longest time between samples that is no gap: 5 usual steps, those that 95 % of the steps keep to.

    The median would not do: of time stamps that come in bursts it is the step within one.

    Args:
        steps: Times from sample to sample [s], at least one.
        resample: Step of the grid that a recording is brought to [s]; two of them are no gap either.

    Returns:
        The time [s].
    """
    return max(_FAR_LONGER * usual_step(steps), 2 * (resample or 0.0))


def usual_step(steps: Times) -> float:
    """Time between samples that 95 % of the steps keep to.

    Args:
        steps: Times from sample to sample [s], at least one.

    Returns:
        The time [s].
    """
    return float(np.quantile(steps, _USUAL, method="lower"))


def whole_steps(elapsed: np.ndarray, step: float, *, rounded: float = 1e-9) -> np.ndarray:
    """How many whole steps fit into a time, one that rounding makes too short included.

    Args:
        elapsed: Times [s].
        step: The step [s].
        rounded: What times may lack to a whole step, as a share of it.

    Returns:
        The numbers.
    """
    return np.floor(elapsed / step * (1 + 1e-12) + rounded)


def least_change(signal: np.ndarray) -> float:
    """Smallest change from one sample to the next.

    Args:
        signal: Consecutive samples.

    Returns:
        The change; 0 where there is none.
    """
    changes = np.abs(np.diff(signal))
    changes = changes[changes > _EQUAL * np.ptp(signal)]
    return float(changes.min()) if len(changes) else 0.0


def quantum(signal: np.ndarray) -> float:
    """Step to whose multiples a signal is rounded.

    It is the largest number, among the commonest changes from sample to sample, the smallest that recurs and whole
    fractions of them, of which 85 % of all changes are multiples. What moves steadily changes by the same from sample
    to sample, too, but by anything where it sets off: of the other changes most must be multiples, too, pauses being
    some.

    Args:
        signal: Consecutive samples.

    Returns:
        The step; 0 where there is none, or the signal changes too seldom to tell.
    """
    every = np.abs(np.diff(signal))
    span = float(np.ptp(signal))
    changes = every[every > _EQUAL * span]
    if span == 0 or len(changes) < max(10, _LEAST_CHANGES * len(signal)):
        return 0.0
    binned = np.round(np.log10(changes), 2)
    bins, counts = np.unique(binned, return_counts=True)
    recurs = np.flatnonzero(counts >= max(3.0, _RECURS * len(changes)))[:1]
    modes = [np.median(changes[binned == bins[i]]) for i in (*np.argsort(counts)[-_MODES:], *recurs)]
    candidates = sorted({float(mode) / part for mode in modes for part in range(1, _PARTS + 1)}, reverse=True)
    return next((step for step in candidates if _is_grid(every / step)), 0.0)


def _is_grid(changes: np.ndarray) -> bool:
    """Whether changes from sample to sample, in steps, are those of a signal that is rounded to these steps."""
    nearest = np.round(changes)
    moves = changes > _TINY
    on_grid = (np.abs(changes - nearest) < _NEAR) & (nearest >= 1)
    if not on_grid.sum() >= _ON_GRID * moves.sum():
        return False
    multiples, counts = np.unique(nearest[on_grid], return_counts=True)
    usual = on_grid & (nearest == multiples[np.argmax(counts)])
    pauses = np.count_nonzero(np.diff(~moves, prepend=False) & ~moves)
    others = moves & ~usual
    count = pauses + others.sum()
    return bool(count >= _FEWEST_OTHERS and pauses + np.sum(on_grid & others) >= _ON_GRID_TOO * count)


def noise_level(
    ts: Times,
    signal: np.ndarray,
    *,
    longest: float,
    order: int = _ORDER,
    causes: np.ndarray | None = None,
    bursts: bool = False,
) -> float:
    """Standard deviation of what is too fast for a motion, at uneven time stamps too.

    Divided differences of high order, scaled to unit weight, vanish on every smooth motion and leave white noise its
    size; their median does not see single jumps.

    Args:
        ts: Increasing time stamps [s].
        signal: Samples.
        longest: Longest step that is no gap [s]; no window spans a gap.
        order: Of the differences; they see no motion that is a polynomial of lower degree.
        causes: Signals (T, k) that move this one, as fast as they like: what is proportional to them is no noise.
        bursts: Take the root mean square of all but the largest 0.5 % instead of the median, which tells nothing of
            noise that comes and goes, such as an encoder's, which grows with its speed.

    Returns:
        The level; 0 where there are too few samples.
    """
    size = order + 1
    if len(ts) < 2 * size:
        return 0.0
    times = np.lib.stride_tricks.sliding_window_view(ts, size)
    apart = times[:, :, None] - times[:, None, :] + np.eye(size)
    weights = 1 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    signals = np.concatenate([signal[:, None], np.zeros((len(ts), 0)) if causes is None else causes], axis=1)
    rest = np.einsum("wi,wki->wk", weights, np.lib.stride_tricks.sliding_window_view(signals, size, axis=0))
    rest = rest[(np.diff(times, axis=1) <= longest).all(axis=1)]
    rest, moved = rest[:, 0], rest[:, 1:]
    if len(rest) > 2 * moved.shape[1] > 0:
        rest = rest - moved @ np.linalg.lstsq(moved, rest, rcond=None)[0]
    if not len(rest):
        return 0.0
    if bursts:
        return float(np.sqrt(np.mean(np.sort(rest**2)[: -(-len(rest) * 995 // 1000)])))
    return float(deviation(rest))


def deviation(errors: np.ndarray) -> np.ndarray:
    """Standard deviation of Gaussian errors about zero along the first axis, whatever a few outliers do.

    Args:
        errors: Errors (T, …).

    Returns:
        The deviation (…).
    """
    return np.asarray(_SIGMA * np.median(np.abs(errors), axis=0))


def standstills(ts: Times, signal: np.ndarray, *, least: int, longest: float) -> list[tuple[int, int]]:
    """Stretches of bit-identical samples.

    Args:
        ts: Increasing time stamps [s].
        signal: Samples.
        least: Least number of samples of a stretch.
        longest: Longest step that is no gap [s]; no stretch spans a gap.

    Returns:
        First and last sample of each.
    """
    edges = np.flatnonzero((np.diff(signal) != 0) | (np.diff(ts) > longest))
    starts, ends = np.append(0, edges + 1), np.append(edges, len(signal) - 1)
    long = ends - starts + 1 >= least
    return list(zip(starts[long].tolist(), ends[long].tolist(), strict=True))


def shares_cut_off(signal: np.ndarray) -> dict[float, float]:
    """Shares of samples at the largest and the smallest value of a signal that is cut off there.

    A signal is cut off at an extreme value, other than 0, that holds three samples and more than the 5 % of the range
    next to it. One with few different values, such as a switched one, is not.

    Args:
        signal: Samples.

    Returns:
        The share at each value at which it is cut off, from the smallest on; none where it is not.
    """
    span = float(np.ptp(signal))
    if span == 0 or len(np.unique(signal)) < 10:
        return {}
    shares: dict[float, float] = {}
    for depth, extreme in ((signal - signal.min(), signal.min()), (signal.max() - signal, signal.max())):
        count = int((depth <= 1e-6 * span).sum())
        at = count / len(signal)
        beside = float(((depth > 1e-6 * span) & (depth <= _EDGE * span)).mean())
        if count >= _FEWEST_AT_EXTREME and at >= _LEAST_AT_EXTREME and at > beside and abs(extreme) > 1e-6 * span:
            shares[float(extreme)] = at
    return shares
