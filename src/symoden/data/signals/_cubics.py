"""Cubics fitted around every sample, at uneven time stamps."""

from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float64, Int

from symoden.data._shapes import Signals, Times

LEAST: Final = 5  # Samples of the narrowest window: the fourth-order difference formula.
MOST_CELLS: Final = 17  # Of a window; a wider one is fitted to means of samples, which costs next to nothing.
_TERMS: Final = 4
_RIDGE: Final = 1e-13  # Keeps windows solvable whose times cluster, such as those that span a gap.
_CHUNK: Final = 16_384  # Windows at once: their sums stay in the processor's cache.


class Cells(NamedTuple):
    """Consecutive samples, averaged a few at a time.

    A cubic's mean over a cell is linear in its coefficients, so that fits to cells are exact for cubics too.

    Attributes:
        ts: Mean time of each cell [s].
        spread: Second and third central moments of the times in each cell [s², s³].
        weights: Number of samples in each.
        means: Mean of each signal, one row per signal.
    """

    ts: Float64[np.ndarray, " C"]
    spread: Float64[np.ndarray, "2 C"]
    weights: Float64[np.ndarray, " C"]
    means: Float64[np.ndarray, "k C"]

    @classmethod
    def of(cls, ts: Times, signals: Signals, starts: np.ndarray) -> "Cells":
        """Average the samples from each start to the next one."""
        weights = np.diff(np.append(starts, len(ts)))
        mean = np.add.reduceat(ts, starts) / weights
        if len(starts) == len(ts):
            return cls(mean, np.zeros((2, len(ts))), weights.astype(np.float64), np.ascontiguousarray(signals.T))
        apart = ts - np.repeat(mean, weights)
        spread = np.stack([np.add.reduceat(apart**2, starts), np.add.reduceat(apart**3, starts)]) / weights
        means = np.add.reduceat(np.ascontiguousarray(signals.T), starts, axis=1) / weights
        return cls(mean, spread, weights.astype(np.float64), means)

    def part(self, start: int, stop: int) -> "Cells":
        """Consecutive ones."""
        return Cells(*(each[..., start:stop] for each in self))


class Cubics(NamedTuple):
    """Cubics Σ c_k (t − t₀)ᵏ about the centres of all windows.

    Attributes:
        ts: Centres t₀ [s].
        coefficients: c_k, one row per power and signal.
        covariance: Of c₁, c₂ and c₃, for signals with white noise of variance 1.
    """

    ts: Float64[np.ndarray, " N"]
    coefficients: Float64[np.ndarray, "4 k N"]
    covariance: Float64[np.ndarray, "3 3 N"]

    def near(self, ts: Times) -> Int[np.ndarray, " T"]:
        """Which centre is nearest to each time."""
        return np.searchsorted((self.ts[1:] + self.ts[:-1]) / 2, ts)

    def values(self, ts: Times, which: Int[np.ndarray, " T"]) -> Float64[np.ndarray, "k T"]:
        """Values of some of the cubics, one time each."""
        apart = ts - self.ts[which]
        c0, c1, c2, c3 = self.coefficients[:, :, which]
        return c0 + apart * (c1 + apart * (c2 + apart * c3))

    def slopes(self, ts: Times, which: Int[np.ndarray, " T"]) -> Float64[np.ndarray, "k T"]:
        """Slopes of some of the cubics, one time each."""
        apart = ts - self.ts[which]
        _, c1, c2, c3 = self.coefficients[:, :, which]
        return c1 + apart * (2 * c2 + 3 * apart * c3)

    def variances(self, ts: Times, which: Int[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
        """Variances of these slopes, for signals with white noise of variance 1 [1/s²]."""
        apart = ts - self.ts[which]
        weights = np.stack([np.ones_like(apart), 2 * apart, 3 * apart**2])
        return np.einsum("it,ijt,jt->t", weights, self.covariance[:, :, which], weights)


def cell_starts(samples: int, size: int) -> np.ndarray:
    """First samples of cells of about so many samples.

    Args:
        samples: Number of samples.
        size: Least number of samples of a cell; no sample is left over.

    Returns:
        The first sample of each cell.
    """
    cells = max(1, samples // size)
    return np.arange(cells) * samples // cells


def fit_cubics(cells: Cells, window: int) -> Cubics:
    """Fit a cubic by least squares to every run of so many cells.

    Args:
        cells: At least `window` of them.
        window: Number of cells of a run, an odd one, at least 5.

    Returns:
        The cubics, from the first to the last window that lies within the cells.
    """
    windows = len(cells.ts) - window + 1
    parts = [
        _fit(cells.part(start, min(start + _CHUNK, windows) + window - 1), window)
        for start in range(0, windows, _CHUNK)
    ]
    ts, coefficients, covariance = zip(*parts, strict=True)
    return Cubics(np.concatenate(ts), np.concatenate(coefficients, axis=2), np.concatenate(covariance, axis=2))


class SlopeFilter(NamedTuple):
    """Slopes as weighted sums of cells: of many signals at the same times, quicker than a fit to each.

    Attributes:
        first: First cell of each slope's window.
        weights: Of the cells of a window, one row per place in it [1/s].
        variances: Of the slopes, for signals with white noise of variance 1 [1/s²].
    """

    first: Int[np.ndarray, " T"]
    weights: Float64[np.ndarray, "w T"]
    variances: Float64[np.ndarray, " T"]

    @classmethod
    def of(cls, cells: Cells, window: int, ts: Times, which: Int[np.ndarray, " T"]) -> "SlopeFilter":
        """What `fit_cubics(cells, window).slopes(ts, which)` and `variances` are, whatever the means of the cells.

        Args:
            cells: At least `window` of them.
            window: Number of cells of a run, an odd one, at least 5.
            ts: Times [s].
            which: Which window serves each time.

        Returns:
            The weights.
        """
        centres, half, inverse, _ = _normal_equations(cells._replace(means=cells.means[:0]), window)
        centre, scale = centres[which], half[which]
        apart = (ts - centre) / scale
        slope = np.stack([np.zeros_like(apart), np.ones_like(apart), 2 * apart, 3 * apart**2]) / scale
        mixed = np.einsum("it,tij->jt", slope, inverse[which])
        weights = np.empty((window, len(ts)))
        for place in range(window):
            at = which + place
            terms = _terms(cells, at, centre, scale)
            weights[place] = cells.weights[at] * sum(part * term for part, term in zip(mixed, terms, strict=True))
        return cls(which, weights, np.sum(slope * mixed, axis=0))

    def slopes(self, means: Float64[np.ndarray, "k C"]) -> Float64[np.ndarray, "k T"]:
        """Slopes of signals, given by their means in the cells."""
        total = np.zeros((len(means), len(self.first)))
        for place, weight in enumerate(self.weights):
            total += weight * means[:, self.first + place]
        return total


def _fit(cells: Cells, window: int) -> Cubics:
    """Cubics of one chunk."""
    centres, half, inverse, moments = _normal_equations(cells, window)
    coefficients = np.einsum("nij,jkn->ikn", inverse, moments) / half ** np.arange(_TERMS)[:, None, None]
    powers = half ** np.arange(1, _TERMS)[:, None]
    return Cubics(centres, coefficients, inverse[:, 1:, 1:].transpose(1, 2, 0) / (powers[:, None] * powers))


def _normal_equations(
    cells: Cells, window: int
) -> tuple[
    Float64[np.ndarray, " N"], Float64[np.ndarray, " N"], Float64[np.ndarray, "N 4 4"], Float64[np.ndarray, "4 k N"]
]:
    """Centres of all windows, half their widths, inverses of the Gram matrices, and moments of the signals.

    Sums run over the places in a window; powers are of times relative to its half width.

    Returns:
        The four.
    """
    count = len(cells.ts) - window + 1
    centres = cells.ts[window // 2 :][:count]
    half = (cells.ts[window - 1 :] - cells.ts[:count]) / 2
    gram = np.zeros((_TERMS, _TERMS, count))
    moments = np.zeros((_TERMS, len(cells.means), count))
    for place in range(window):
        at = slice(place, place + count)
        terms = _terms(cells, at, centres, half)
        for i, term in enumerate(terms):
            weighted = cells.weights[at] * term
            for j in range(i, _TERMS):
                gram[i, j] += weighted * terms[j]
            moments[i] += weighted * cells.means[:, at]
    for i in range(_TERMS):
        gram[i + 1 :, i] = gram[i, i + 1 :]
        gram[i, i] += _RIDGE * gram[0, 0]
    return centres, half, np.linalg.inv(gram.transpose(2, 0, 1)), moments


def _terms(
    cells: Cells,
    at: slice | Int[np.ndarray, " N"],
    centres: Float64[np.ndarray, " N"],
    half: Float64[np.ndarray, " N"],
) -> tuple[float | Float64[np.ndarray, " N"], ...]:
    """Means over some cells, one of each window, of the powers of time about its centre, relative to its half width."""
    s = (cells.ts[at] - centres) / half
    second = cells.spread[0, at] / half**2
    return 1.0, s, s * s + second, s * (s * s + 3 * second) + cells.spread[1, at] / half**3
