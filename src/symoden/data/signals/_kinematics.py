"""Whether positions and velocities tell of the same motion."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from symoden.data._shapes import Times

from ._signals import deviation

_BLOCK = 0.1  # [s] over which steps of an encoder average out, and a motion of 5 Hz does not
_LEAST_STEPS, _LEAST_BLOCKS, _USUAL_BLOCKS = 4, 8, 12
_ABOVE = 5.0  # times its uncertainty that a displacement must be, to be compared
_VISIBLE, _FEWEST = 3.0, 4  # The same of a block that moves, and how many such there must be.
_SURE = 25.0  # times it, over the root of their number: then the factor is known to 5 %
TURN: Final = 2 * np.pi
AGREES: Final = 0.15  # relative deviation up to which a factor is 1
_LATEST: Final = 0.1  # [s] that filters delay a velocity by.
_LESS: Final = 0.5  # Share of the misfit that is left with a delay.
_ROUGH: Final = 0.2  # Misfit from which it is asked whether the position is late, which no unit makes up for.
_FAR_LESS: Final = 0.6  # Share of the misfit that is left then.
_BESIDE: Final = 3  # Steps on either side of one that say how fast it goes.
_NEARLY: Final = 1.15  # Times the least misfit: of delays that are about as good the shortest is named.
UNRELATED: Final = 0.5  # misfit beyond which a velocity is not that of the position


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """How exactly a signal is known.

    Attributes:
        quantum: Step to whose multiples it is rounded; 0 if there is none.
        noise: Standard deviation of its noise.
    """

    quantum: float
    noise: float

    @property
    def size(self) -> float:
        """The larger of both."""
        return max(self.quantum, self.noise)


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """The factor k that makes displacements k ∫v dt.

    Attributes:
        factor: k; 1 if velocities and positions agree, NaN where too little moves to tell.
        misfit: Share of a typical displacement that k ∫v dt does not explain; 0 if it explains all.
        behind: Time [s] by which the position follows ∫v dt, as a filtered one does, where that explains half of what
            nothing else does; 0 else.
    """

    factor: float
    misfit: float
    behind: float = 0.0

    @property
    def known(self) -> bool:
        """Whether there was enough motion to tell."""
        return bool(np.isfinite(self.factor))

    @property
    def agrees(self) -> bool:
        """Whether the velocity is that of the position."""
        return abs(self.factor - 1) < AGREES and self.misfit <= UNRELATED


def displacement(ts: Times, v: np.ndarray, *, longest: float) -> np.ndarray:
    """∫v dt from the first sample on, by the trapezoidal rule; gaps add nothing.

    Args:
        ts: Increasing time stamps [s].
        v: Velocity.
        longest: Longest step that is no gap [s].

    Returns:
        The integral at every sample.
    """
    steps = np.diff(ts)
    return np.append(0.0, np.cumsum(np.where(steps <= longest, steps, 0.0) * (v[1:] + v[:-1]) / 2))


def blocks(ts: Times, *, longest: float) -> np.ndarray:
    """First samples of consecutive blocks that span no gap, each with the one after its last.

    They last about 0.1 s; of a short recording less, so that there are a dozen.

    Args:
        ts: Increasing time stamps [s].
        longest: Longest step that is no gap [s].

    Returns:
        Pairs of samples (blocks, 2).
    """
    steps = np.diff(ts)
    size = max(_LEAST_STEPS, min(round(_BLOCK / float(np.median(steps))), len(steps) // _USUAL_BLOCKS))
    starts = np.arange(0, len(ts) - size, size)
    gaps = np.append(0, np.cumsum(steps > longest))
    whole = gaps[starts + size] == gaps[starts]
    return np.stack([starts, starts + size], axis=1)[whole]


def velocity_ratio(
    ts: Times, q: np.ndarray, v: np.ndarray, *, longest: float, accuracy: tuple[Accuracy, Accuracy]
) -> Ratio:
    """Compare displacements with integrated velocities.

    Filters of velocities make them late, which beside a fast motion looks like a factor: where both disagree, it is
    asked whether they agree some time apart. They make noise slow, too, which beside long rests looks like a motion:
    it is asked whether they agree where the position moves.

    Args:
        ts: Increasing time stamps [s].
        q: Position; of an angle that is wrapped often, what remains of it is no motion.
        v: Velocity.
        longest: Longest step that is no gap [s].
        accuracy: Of position and velocity.

    Returns:
        The factor and how well it fits.
    """
    at_once = _ratio(ts, q, v, longest=longest, accuracy=accuracy)
    if at_once.known and not at_once.agrees:
        moving = _ratio(ts, q, v, longest=longest, accuracy=accuracy, moving=True)
        at_once = moving if moving.agrees else at_once
    if not at_once.factor > 0 or at_once.agrees:  # Of opposite motions, too, another delay makes the same.
        return at_once

    def apart(late: float) -> Ratio:
        return _ratio(ts, q, v, longest=longest, accuracy=accuracy, late=late)

    later = map(apart, delays(ts)[1:])
    found = next((ratio for ratio in later if ratio.agrees and ratio.misfit < _LESS * at_once.misfit), at_once)
    if found.agrees or found.misfit < _ROUGH:
        return found
    earlier = [(float(late), apart(-late)) for late in delays(ts)[1:]]
    return dataclasses.replace(found, behind=_behind(found, earlier))


def _behind(at_once: Ratio, every: Sequence[tuple[float, Ratio]]) -> float:
    """Time by which a position follows its velocity, where that explains far more."""
    known = [(late, ratio.misfit) for late, ratio in every if ratio.factor > 0]
    least = min((misfit for _, misfit in known), default=np.inf)
    if least > min(_FAR_LESS * at_once.misfit, UNRELATED):
        return 0.0
    return next(late for late, misfit in known if misfit <= _NEARLY * least)


def delays(ts: Times) -> np.ndarray:
    """Delays of velocities that are looked for [s], from zero on: some a sample apart, or ten of them.

    Args:
        ts: Increasing time stamps [s].

    Returns:
        The delays.
    """
    return np.arange(0.0, _LATEST, max(float(np.median(np.diff(ts))), _LATEST / 10))


def _ratio(
    ts: Times,
    q: np.ndarray,
    v: np.ndarray,
    *,
    longest: float,
    accuracy: tuple[Accuracy, Accuracy],
    late: float = 0.0,
    moving: bool = False,
) -> Ratio:
    """Compare displacements with velocities some time later, perhaps of the blocks that move alone.

    The factor is that of least absolute deviations, a weighted median, so that a few jumps do not change it; blocks in
    which one of both does not change at all, at rest or stuck, do not count. Many machines mostly rest,
    and chatter where they do: if there is too little motion on the whole, the blocks that move are asked alone.

    Returns:
        The factor and how well it fits.
    """
    unknown = Ratio(factor=float("nan"), misfit=float("nan"))
    pairs = blocks(ts, longest=longest)
    pairs = pairs[
        _changes(q, pairs) & _changes(v, pairs) & (ts[pairs[:, 1]] + late <= ts[-1]) & (ts[pairs[:, 0]] + late >= ts[0])
    ]
    if len(pairs) < _LEAST_BLOCKS:
        return unknown
    way = displacement(ts, v, longest=longest)
    way = np.interp(ts + late, ts, way) if late else way
    dq, integral = np.diff(q[pairs], axis=1)[:, 0], np.diff(way[pairs], axis=1)[:, 0]
    step = float(np.median(np.diff(ts)))
    size = pairs[0, 1] - pairs[0, 0]
    uncertain = accuracy[0].size, accuracy[1].size * step * np.sqrt(size)
    if moving or not _is_above(dq, integral, uncertain):
        dq, integral, uncertain = _moving(dq, integral, uncertain)
        if len(dq) < _FEWEST or not _is_above(dq, integral, uncertain, times=max(_ABOVE, _SURE / np.sqrt(len(dq)))):
            return unknown
    weights = np.abs(integral)
    goes = weights > 0
    factor = _weighted_median(dq[goes] / integral[goes], weights[goes])
    unexplained, typical = (_weighted_median(x, weights) for x in (np.abs(dq - factor * integral), np.abs(dq)))
    return Ratio(factor=factor, misfit=unexplained / typical if typical else np.inf)


def _moving(
    dq: np.ndarray, integral: np.ndarray, uncertain: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Blocks in which something moves, and how uncertain displacements are; velocities at rest show what theirs are."""
    rests = np.abs(dq) <= _VISIBLE * uncertain[0]
    if np.count_nonzero(rests) >= _LEAST_BLOCKS:
        uncertain = uncertain[0], max(uncertain[1], float(deviation(integral[rests])))
    moving = ~rests | (np.abs(integral) > _VISIBLE * uncertain[1])
    return dq[moving], integral[moving], uncertain


def _is_above(dq: np.ndarray, integral: np.ndarray, uncertain: tuple[float, float], *, times: float = _ABOVE) -> bool:
    """Whether both displacements are on average so many times their uncertainty."""
    return all(np.abs(way).mean() > times * each for way, each in zip((dq, integral), uncertain, strict=True))


def _changes(signal: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Whether a signal changes within each block."""
    changes = np.append(0, np.cumsum(np.diff(signal) != 0))
    return changes[pairs[:, 1]] > changes[pairs[:, 0]]


def jumps(ts: Times, q: np.ndarray, *, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Find jumps of a position by more than half a turn from one sample to the next.

    By about a whole turn goes what is an eighth of one away from it, or from going on as fast as before and after: of a
    fast wheel an eighth of a turn is a step or two.

    Args:
        ts: Increasing time stamps [s].
        q: Position, not unwrapped.
        longest: Longest step that is no gap [s].

    Returns:
        Samples after which it jumps by about whole turns, and those after which it jumps by something else.
    """
    change = np.where(np.diff(ts) <= longest, np.diff(q), 0.0)
    rest = change - TURN * np.round(change / TURN)
    far = np.abs(change) > TURN / 2
    rest = np.fmin(np.abs(rest), np.abs(rest - _usual_rates(ts, rest) * np.diff(ts)))
    return np.flatnonzero(far & (rest < TURN / 8)), np.flatnonzero(far & (rest >= TURN / 8))


def _usual_rates(ts: Times, change: np.ndarray) -> np.ndarray:
    """Median of the rates of a few steps about each; NaN where none is known."""
    steps = np.diff(ts)
    if not len(steps):
        return steps
    near = np.pad(np.divide(change, steps, out=np.full(len(steps), np.nan), where=steps > 0), _BESIDE, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(near, 2 * _BESIDE + 1), axis=1)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """Value below which half of the weight lies."""
    order = np.argsort(values)
    return float(values[order][np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)])
