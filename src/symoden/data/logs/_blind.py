"""Dead spots of sensors: positions at which a potentiometer or an encoder does not follow the motion."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symoden.data._errors import DataError
from symoden.data.description import of_column
from symoden.data.signals import TURN, jumps, longest_step

from ._logs import Log
from ._spikes import COARSEST, counts, deviations, unwrapped

Interval = tuple[float, float]

_SECTORS: Final = 48  # Of a turn, or of the range of a length; two of them are looked at together.
_FEWEST, _CROSSINGS = 5, 3  # Passages through a spot, and those of them that go on to its other side.
_SHARE: Final = 0.25  # Of the passages, that may look as if nothing were there.
_LOUDER: Final = 4.0  # Times what is usual elsewhere, that the others stand out by.
_COARSE: Final = 0.05  # Of the largest step beside it: less is what a cubic makes of a motion with few samples.
# Samples and sectors to come from and go on for: nearer than that, a stop shakes what is before it.
_REACH, _BEYOND = 5, 2
_WIDEST: Final = 10  # Sectors.
_ENDS: Final = (0.001, 0.999)  # Quantiles.
_MOST: Final = 2**18  # Samples that are looked at; the beginnings of long logs.
_ALIKE: Final = 0.2  # Share of the samples that tell what is usual at a speed,
_ENOUGH: Final = 51  # and the fewest of them.
_LEVELS: Final = 33  # Speeds at which that is told.
_QUIET: Final = 0.25
_NORMAL: Final = 0.3186  # That quantile of the absolute value of a standard normal variable.


@dataclass(frozen=True, kw_only=True, eq=False)
class BlindSpot:
    """Positions that a sensor does not tell.

    Attributes:
        channel: Name of the column.
        interval: From where to where, in SI or rad; of an angle, as far as the second number counted upwards.
        loud: How far the sample that stands out most does in three of four passages, relative to passages elsewhere;
            None where the description names the spot.
        passages: Number of times that the motion enters it; 0 likewise.
    """

    channel: str
    interval: Interval
    loud: float | None = None
    passages: int = 0

    def covers(self, positions: Float[np.ndarray, " T"], *, is_angle: bool) -> Bool[np.ndarray, " T"]:
        """Tell positions in it.

        Args:
            positions: Positions in SI or rad.
            is_angle: Whether they repeat after a turn.

        Returns:
            Whether each is in it.
        """
        start, stop = self.interval
        return (
            np.mod(positions - start, TURN) <= stop - start if is_angle else (positions >= start) & (positions <= stop)
        )


class BlindRows(NamedTuple):
    """Rows of a log that lie in a dead spot."""

    spot: BlindSpot
    rows: Int[np.ndarray, " k"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Column:
    """One position of one log, at the rows that have all numbers.

    Attributes:
        places: Sector of each sample.
        loud: How far each stands out from its neighbours, relative to what is usual at its speed.
        coarse: The same relative to the steps beside it.
    """

    places: Int[np.ndarray, " T"]
    loud: Float[np.ndarray, " T"]
    coarse: Float[np.ndarray, " T"]

    def passages(self, first: int, *, is_angle: bool) -> Float[np.ndarray, "k 3"]:
        """Largest `loud` and `coarse` of each passage through two sectors, and whether it goes on beyond them."""
        side = self.places - first
        side = np.mod(side + _SECTORS // 2, _SECTORS) - _SECTORS // 2 if is_angle else side
        inside = (side == 0) | (side == 1)
        start, stop = np.flatnonzero(np.diff(inside, prepend=False, append=False)).reshape(-1, 2).T
        edges = np.concatenate([[0], np.stack([start, stop], axis=1).ravel(), [len(inside)]])
        between = (start > 0) & (stop < len(inside))
        before, start, stop, after = np.stack([edges[:-2:2], start, stop, edges[3::2]])[:, between]
        if not len(start):
            return np.zeros((0, 3))
        largest = [_most(x, start - 1, stop + 1) for x in (self.loud, self.coarse)]
        crosses = (side[start - 1] < 0) != (side[stop] < 0)
        beyond = np.maximum(side - 1, -side)  # Sectors away.
        for since, until in ((before, start), (stop, after)):
            crosses &= (until - since >= _REACH) & (_most(beyond, since, until) >= _BEYOND)
        return np.nan_to_num(np.stack([*largest, crosses], axis=1))


def _most(signal: np.ndarray, start: Int[np.ndarray, " k"], stop: Int[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Largest number in each of some stretches, none of which is empty; NaN where there is none."""
    ends = np.stack([start, stop], axis=1).ravel()
    return np.fmax.reduceat(np.append(signal, np.nan), ends)[::2]


def blind_spots(
    logs: Sequence[Log], is_angle: np.ndarray, described: Mapping[str, Sequence[Interval]]
) -> tuple[BlindSpot, ...]:
    """Take what a description says of columns, and look for dead spots in the others.

    A sample is compared with the cubic through two neighbours on each side. In a dead spot it stands out, whatever the
    speed, nearly every time that the motion comes there, from either side; elsewhere it does not. A stop is no such
    place, for nothing goes on beyond it, nor is a fast stretch of a motion with few samples in it.

    Args:
        logs: What was logged.
        is_angle: Whether each coordinate is an angle.
        described: Intervals by the name of a column or variable; none of a column says that it has no dead spot.

    Returns:
        The spots of every column.

    Raises:
        DataError: If a described interval of an angle is a turn or more.
    """
    found: list[BlindSpot] = []
    for i, name in enumerate(logs[0].names["positions"] if logs else ()):
        told = of_column(name, described)
        if told is None:
            found.extend(_search(name, logs, i, is_angle=bool(is_angle[i])))
            continue
        for start, stop in told:
            if is_angle[i] and stop - start >= TURN:
                raise DataError(
                    f"`blind` of `{name}` must be shorter than a turn, in rad after `units` and `zeros`; got "
                    f"{(start, stop)}. Write degrees as rad."
                )
            found.append(BlindSpot(channel=name, interval=(start, stop)))
    return tuple(found)


def rows_in_spots(log: Log, spots: Sequence[BlindSpot], is_angle: np.ndarray) -> tuple[BlindRows, ...]:
    """Find the rows of a log that lie in dead spots.

    Args:
        log: What was logged.
        spots: The spots.
        is_angle: Whether each coordinate is an angle.

    Returns:
        Each spot that has any, and its rows.
    """
    columns = dict(zip(log.names["positions"], zip(log.q.T, map(bool, is_angle), strict=True), strict=True))
    found = []
    for spot in spots:
        positions, turns = columns[spot.channel]
        found.append(BlindRows(spot, np.flatnonzero(spot.covers(positions, is_angle=turns))))
    return tuple(each for each in found if len(each.rows))


def _search(name: str, logs: Sequence[Log], i: int, *, is_angle: bool) -> Iterator[BlindSpot]:
    """Find the spots of one column."""
    most = max(_ENOUGH, _MOST // len(logs))
    paths = [(log.ts[rows], log.q[rows, i]) for log in logs if len(rows := _ordered(log)[:most]) >= _ENOUGH]
    if not paths:
        return
    if not is_angle and any(_wraps(*path) for path in paths):
        return  # An angle that is called a length: where it is wrapped it jumps at every passage.
    ends = np.concatenate([q for _, q in paths])
    least, largest = np.quantile(ends, _ENDS)  # A glitch is no end of the range.
    low, width = (-np.pi, TURN / _SECTORS) if is_angle else (least, (largest - least) / _SECTORS)
    if not width:
        return
    columns = _columns(paths, low, width, is_angle=is_angle)
    every = [_look(columns, b, is_angle=is_angle) for b in range(_SECTORS if is_angle else _SECTORS - 1)]
    usual, sure, count = np.array(every).T
    if np.count_nonzero(usual) < 2 * _WIDEST:
        return
    loud = sure / np.median(usual[usual > 0])
    for first, last in _runs(loud > _LOUDER, count == 0, around=is_angle):
        numbers = np.arange(first, last + 1) % len(loud)
        if len(numbers) < _WIDEST:
            start, stop = low + first * width, low + (last + 2) * width
            loudest, passages = float(loud[numbers].max()), int(count[numbers].max())
            yield BlindSpot(channel=name, interval=(start, stop), loud=loudest, passages=passages)


def _wraps(ts: np.ndarray, q: np.ndarray) -> bool:
    """Whether a position jumps by turns and nothing else."""
    turns, others = jumps(ts, q, longest=longest_step(np.diff(ts)))
    return len(turns) > 0 and not len(others)


def _ordered(log: Log) -> Int[np.ndarray, " k"]:
    """Rows that have all numbers; none where time stamps do not increase."""
    rows = np.flatnonzero(log.complete)
    return rows if (np.diff(log.ts[rows]) > 0).all() else rows[:0]


def _columns(
    paths: Sequence[tuple[np.ndarray, np.ndarray]], low: float, width: float, *, is_angle: bool
) -> list[_Column]:
    """How far the samples of every log stand out; what is usual at a speed is told by all together."""
    places, off, steps, speeds = [], [], [], []
    for ts, q in paths:
        smooth = unwrapped(q[:, None], np.array([is_angle]))[:, 0]
        place = np.floor((np.mod(q - low, TURN) if is_angle else q - low) / width).astype(int)
        places.append(np.clip(place, 0, _SECTORS - 1))
        found, weights = deviations(ts, smooth)
        found = np.abs(found) / np.sqrt(1 + np.sum(weights**2, axis=1))
        beside = np.lib.stride_tricks.sliding_window_view(np.diff(ts), 4).max(axis=1)
        found[2:-2][beside > longest_step(np.diff(ts))] = np.nan
        found[:2] = found[-2:] = np.nan
        off.append(found)
        change = np.abs(np.diff(smooth))
        steps.append(np.maximum(np.append(change, 0), np.append(0, change)))
        speed = np.zeros(len(ts))
        speed[2:-2] = np.abs(smooth[4:] - smooth[:-4]) / (ts[4:] - ts[:-4])
        speeds.append(speed)
    ends = np.cumsum([len(x) for x in off])[:-1]
    joined, step = np.concatenate(off), np.concatenate(steps)
    there = np.flatnonzero(np.isfinite(joined))
    order = there[np.argsort(np.concatenate(speeds)[there], kind="stable")]
    rounded = max(counts(q, COARSEST["positions"]) for _, q in paths) / 2
    loud, coarse = np.full((2, len(joined)), np.nan)
    tiny = np.finfo(float).tiny
    with np.errstate(over="ignore"):  # Beside exact samples a wrong one stands out without bound.
        loud[order] = joined[order] / np.maximum(_usual(joined[order]), max(rounded, tiny))
        coarse[order] = joined[order] / np.maximum(step[order], tiny)
    parts = zip(places, np.split(loud, ends), np.split(coarse, ends), strict=True)
    return [_Column(places=p, loud=x, coarse=y) for p, x, y in parts]


def _usual(off: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """How far samples that are as fast stand out, in the order of their speeds.

    A time stamp that is off matters the more, the faster the motion. Most that is so fast may lie in the spot.

    Returns:
        A standard deviation for each.
    """
    size = min(len(off), max(_ENOUGH, int(_ALIKE * len(off))))
    starts = np.linspace(0, len(off) - size, _LEVELS).astype(int)
    levels = [np.quantile(off[start : start + size], _QUIET) / _NORMAL for start in starts]
    return np.interp(np.arange(len(off)), starts + size / 2, levels)


def _look(columns: Sequence[_Column], first: int, *, is_angle: bool) -> tuple[float, float, int]:
    """How far passages through two sectors stand out: usually, and all but a quarter of them; their number.

    Returns:
        All three; zeros where there are too few, and a second zero where a motion with few samples explains it.
    """
    every = np.concatenate([column.passages(first, is_angle=is_angle) for column in columns])
    loud, coarse, crosses = every.T
    through = crosses > 0
    if len(every) < _FEWEST or np.count_nonzero(through) < _CROSSINGS:
        return 0.0, 0.0, len(every)
    sure, rough = (min(np.quantile(x, _SHARE), np.quantile(x[through], _SHARE)) for x in (loud, coarse))
    return float(np.median(loud)), float(sure) if rough > _COARSE else 0.0, len(every)


def _runs(chosen: Bool[np.ndarray, " k"], empty: Bool[np.ndarray, " k"], *, around: bool) -> Iterator[tuple[int, int]]:
    """First and last index of every run of what is chosen, over what is empty in between.

    Yields:
        Both; around a circle the last one may be past its end.
    """
    size, numbers = len(chosen), np.flatnonzero(chosen)
    shift = int(np.flatnonzero(~chosen & ~empty)[0]) if around and not (chosen | empty).all() else 0
    numbers = np.sort(np.mod(numbers - shift, size))
    filled = np.cumsum(np.roll(~chosen & ~empty, -shift))  # Apart where one is between them that is neither.
    for run in np.split(numbers, np.flatnonzero(np.diff(filled[numbers])) + 1):
        if len(run):
            first = (int(run[0]) + shift) % size
            yield first, first + int(run[-1] - run[0])
