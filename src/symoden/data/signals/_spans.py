"""How many samples a fit of the slope should span, told from the positions."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Int

from symoden.data._shapes import Signals, Times

from ._cubics import LEAST, MOST_CELLS, Cells, Cubics, SlopeFilter, cell_starts, fit_cubics
from ._noise import rounding_and_noise

_OCTAVE: Final = (9, 11, 13, 15, MOST_CELLS)
_CAUTION: Final = 1.25  # Of the noise's share in the criterion: half of it left out would choose the narrowest window.
_PAST: Final = 3  # Multiples of the noise's share by which the error must have risen to end the search.
_BUDGET, _BLOCK = 8_192, 512  # Cells that are looked at, in blocks.
_OFFSETS: Final = (0.2, 0.7)  # Steps by which a path is shifted before it is rounded.
_ROUNDS, _BACK = 3, 4  # How often a path is smoothed and rounded again, and how much narrower the next span may be.


class _Band(NamedTuple):
    """Windows that are compared with each other, by the same narrow one."""

    size: int  # Samples in a cell.
    windows: tuple[int, ...]  # Cells of the others; the first one is the last one of the band before.


class _Joined:
    """Recordings one after another; no window spans two.

    Attributes:
        ts: Time stamps of all [s], increasing.
        lengths: Number of samples of each.
    """

    def __init__(self, ts: Sequence[np.ndarray]) -> None:
        """Put the recordings one after another, far from each other."""
        apart = 2 * max(float(np.ptp(each)) for each in ts)
        self.ts = np.concatenate([each - each[0] + k * apart for k, each in enumerate(ts)])
        self.lengths = tuple(len(each) for each in ts)
        self._filters: dict[_Band, dict[int, SlopeFilter]] = {}  # The same for every coordinate and path.

    def cells(self, signals: Signals, size: int) -> tuple[Cells, list["_Block"]]:
        """Cells of so many samples; of many cells, some blocks."""
        starts = [cell_starts(length, size) for length in self.lengths]
        before = np.cumsum(self.lengths) - self.lengths
        owner = np.repeat(np.arange(len(starts)), [len(each) for each in starts])
        edges = np.append(np.concatenate([a + b for a, b in zip(starts, before, strict=True)]), len(self.ts))
        chosen = np.arange(len(owner))
        if len(owner) > _BUDGET:
            begins = np.linspace(0, len(owner) - _BLOCK, _BUDGET // _BLOCK).astype(int)
            chosen = (begins[:, None] + np.arange(_BLOCK)).ravel()
        sizes = np.diff(edges)[chosen]
        first = np.cumsum(sizes) - sizes
        rows = np.repeat(edges[chosen] - first, sizes) + np.arange(sizes.sum())
        border = np.append(np.diff(owner, prepend=-1) != 0, [True])
        cuts = np.flatnonzero((np.diff(chosen) != 1) | border[chosen[1:]]) + 1
        blocks = [
            _Block(a, b, bool(border[chosen[a]]), bool(border[chosen[b - 1] + 1]))
            for a, b in zip([0, *cuts.tolist()], [*cuts.tolist(), len(chosen)], strict=True)
        ]
        return Cells.of(self.ts[rows], signals[rows], first), blocks

    def slope_filters(
        self, band: _Band, cells: Cells, blocks: Sequence["_Block"], windows: Sequence[int]
    ) -> dict[int, SlopeFilter]:
        """What makes slopes, of the narrowest window and a band's, where the widest lies within a block."""
        if band not in self._filters:
            ts = cells.ts[np.concatenate([block.inside(windows[-1]) for block in blocks])]
            centres = {
                w: np.concatenate([block.centres(w, windows[-1]) for block in blocks]) for w in (LEAST, *windows)
            }
            self._filters[band] = {w: SlopeFilter.of(cells, w, ts, at - w // 2) for w, at in centres.items()}
        return self._filters[band]


class _Block(NamedTuple):
    """Consecutive cells of a recording."""

    start: int
    stop: int
    begins: bool  # Whether it begins where the recording begins.
    ends: bool

    def inside(self, window: int) -> np.ndarray:
        """Cells whose windows are the same as in the whole recording."""
        if self.stop - self.start < window:
            return np.arange(0)
        reach = window // 2
        return np.arange(self.start + (0 if self.begins else reach), self.stop - (0 if self.ends else reach))

    def centres(self, window: int, widest: int) -> np.ndarray:
        """Centres of the windows that serve the cells inside the widest one's, which at the ends are not central."""
        reach = window // 2
        return np.clip(self.inside(widest), self.start + reach, self.stop - 1 - reach)


def choose_spans(ts: Sequence[np.ndarray], q: Sequence[np.ndarray]) -> Int[np.ndarray, " n"]:
    """Choose for each coordinate how many samples the cubics span whose slopes are its velocities.

    Too narrow a window leaves noise, too wide a one takes motion away. The mean squared error of the slopes v_h of
    windows h is, up to a constant, the mean of v_h² − 2 v_h v₀ plus 2 cov(v_h, v₀) of the noise, where v₀ are slopes of
    a narrow window, noisy but without bias. As v_h is the best linear estimate from a window that holds the other's,
    white noise has cov(v_h, v₀) = var(v_h), which the fit tells; of rounding, which at low speeds is anything but
    white, a path alike is rounded. Windows are compared by octaves from the narrowest on, until the error has risen.

    Nothing here is a number of seconds or metres: in other units the choice is the same.

    Args:
        ts: Time stamps (T,) of each recording of the same motion [s].
        q: Positions (T, n) of each.

    Returns:
        Number of samples for each coordinate.

    References:
        Charnigo, Hall and Srinivasan (2011), *A generalized Cp criterion for derivative estimation*.
    """
    joined = _Joined(ts)
    columns = np.concatenate(q)
    spans = []
    for k in range(columns.shape[1]):
        rounding, noise = rounding_and_noise(ts, [each[:, k] for each in q])
        spans.append(_choose(joined, columns[:, k], rounding=rounding, noise=noise))
    return np.array(spans)


def fit_span(ts: Times, signals: Signals, span: int) -> Cubics:
    """Fit cubics that span so many samples, as many as there are at most.

    Args:
        ts: Time stamps [s], at least 5.
        signals: One column per signal.
        span: Number of samples.

    Returns:
        The cubics.
    """
    size = -(-min(span, len(ts)) // MOST_CELLS)
    starts = cell_starts(len(ts), size)
    most = len(starts) - 1 + len(starts) % 2
    return fit_cubics(Cells.of(ts, signals, starts), min(max(LEAST, 2 * round((span / size - 1) / 2) + 1), most))


def _choose(joined: _Joined, column: np.ndarray, *, rounding: float, noise: float) -> int:
    """Span for one coordinate."""
    if not rounding:
        return _search(joined, column[:, None], noise**2, rounding=0.0)
    path = _through_steps(joined.ts, column)
    spans = [_search(joined, _rounded(column, path, rounding), noise**2, rounding=rounding)]
    while len(spans) <= _ROUNDS and spans[-1] not in spans[:-1]:
        path = _smoothed(joined, column, spans[-1])
        signals = _rounded(column, path, rounding)
        spans.append(_search(joined, signals, noise**2, rounding=0.0, least=spans[-1] // _BACK))
    return max(spans)  # What a smoothed path still has of its steps passes for motion, and makes the span too narrow.


def _search(joined: _Joined, signals: Signals, variance: float, *, rounding: float, least: int = 0) -> int:
    """Span with the least error: of the positions in the first column, errors of rounding alike in the others."""
    curve: list[tuple[float, float, int]] = []  # Error, the noise's share in it, and the span.
    for band in _bands():
        if band.size * band.windows[-1] < least:
            continue
        found = _compare(joined, signals, band, variance, rounding=rounding)
        if len(found) < 1 + bool(curve):
            break
        level = curve[-1][0] - found[0][0] if curve else 0.0
        curve.extend((error + level, share, span) for error, share, span in found)
        best = min(curve)
        if curve[-1][0] > best[0] + _PAST * best[1]:
            break
    return min(curve)[2] if curve else max(LEAST, least)


def _compare(
    joined: _Joined, signals: Signals, band: _Band, variance: float, *, rounding: float
) -> list[tuple[float, float, int]]:
    """Error, the noise's share in it, and the span, of each window of a band."""
    cells, blocks = joined.cells(signals, band.size)
    longest = max(block.stop - block.start for block in blocks)
    windows = [window for window in band.windows if window <= max(LEAST, longest // 2)]
    if not windows or longest < windows[-1]:
        return []
    filters = joined.slope_filters(band, cells, blocks, windows)
    fits = {window: each.slopes(cells.means) for window, each in filters.items()}
    narrow = fits[LEAST]
    found = []
    for window in windows:
        slopes, gain = fits[window], float(np.mean(filters[window].variances))
        share = variance * gain
        if signals.shape[1] > 1:
            share += max(float(np.mean(slopes[1:] * narrow[1:])), rounding**2 / 12 * gain)
        error = float(np.mean(slopes[0] * (slopes[0] - 2 * narrow[0])))
        found.append((error + 2 * _CAUTION * share, share, window * band.size))
    return found


def _bands() -> Iterator[_Band]:
    """Octaves of windows, from the narrowest on."""
    yield _Band(1, (5, 7, 9))
    size = 1
    while True:
        yield _Band(size, _OCTAVE)
        size *= 2


def _rounded(column: np.ndarray, path: np.ndarray, step: float) -> Signals:
    """Positions, and errors of rounding that a path would have."""
    shifted = [path + offset * step for offset in _OFFSETS]
    return np.stack([column, *(np.round(each / step) * step - each for each in shifted)], axis=1)


def _through_steps(ts: Times, column: np.ndarray) -> np.ndarray:
    """Path in straight lines through the middle of every change, which a staircase is the rounding of."""
    before = np.flatnonzero(np.diff(column))
    return np.interp(ts, (ts[before] + ts[before + 1]) / 2, (column[before] + column[before + 1]) / 2)


def _smoothed(joined: _Joined, column: np.ndarray, span: int) -> np.ndarray:
    """Values of the cubics of a span."""
    ends = np.cumsum(joined.lengths)
    path = column.copy()
    for start, stop in zip(ends - joined.lengths, ends, strict=True):
        if stop - start >= LEAST:
            ts = joined.ts[start:stop]
            cubics = fit_span(ts, column[start:stop, None], span)
            path[start:stop] = cubics.values(ts, cubics.near(ts))[0]
    return path
