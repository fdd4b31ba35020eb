"""Regressions: by least squares, near zero where hardly anything tells, and judged by what they did not see."""

from typing import Final

import numpy as np
from jaxtyping import Bool, Float

_RANK: Final = 1e-6  # Singular value beside the largest one from which a direction tells something.
_WEAK: Final = 1e-3  # Beside what tells of a number: one that hardly anything tells is near zero.
_STRETCHES: Final = 8


def inverse(regressors: Float[np.ndarray, "T k"]) -> Float[np.ndarray, "k T"]:
    """What makes the numbers of a regression of its targets, by least squares.

    Args:
        regressors: A column for each number of the regression.

    Returns:
        The pseudo-inverse A, in the units of the columns: the numbers are A y, their covariance is σ² A Aᵀ. Along what
        nothing tells both are zero.
    """
    size = _largest(regressors)
    return np.linalg.pinv(regressors / size, rcond=_RANK) / size[:, None]


def held_near_zero(
    regressors: Float[np.ndarray, "r k"], targets: Float[np.ndarray, "r n"], count: int
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k k"]]:
    """Fit columns of usual size one, those near zero that hardly anything tells (ridge regression).

    Args:
        regressors: A column for each number of the regression.
        targets: What to fit.
        count: How many samples the rows stand for, which may be those of a triangular factor.

    Returns:
        The numbers, and the mean products of the columns, with what holds the numbers.
    """
    products = regressors.T @ regressors / count + _WEAK * np.eye(regressors.shape[1])
    return np.linalg.solve(products, regressors.T @ targets / count), products


def unseen_residuals(
    regressors: Float[np.ndarray, "T k"], targets: Float[np.ndarray, "T n"]
) -> Float[np.ndarray, "T n"]:
    """What is left of targets where every other of eight stretches is predicted from the rest.

    In a short, smooth motion anything follows anything that was fitted to it.

    Args:
        regressors: A column for each number of the regression.
        targets: What to predict.

    Returns:
        The residuals, of the first half of the stretches and then of the second.
    """
    scaled = regressors / _largest(regressors)
    both = interleaved(len(targets))
    return np.concatenate(
        [targets[a] - scaled[a] @ np.linalg.lstsq(scaled[b], targets[b], rcond=_RANK)[0] for a, b in (both, both[::-1])]
    )


def _largest(regressors: Float[np.ndarray, "T k"]) -> Float[np.ndarray, " k"]:
    """What to divide columns of several units by.

    Args:
        regressors: The columns.

    Returns:
        The largest absolute value of each; hardly more than zero where all are zero.
    """
    return np.maximum(np.abs(regressors).max(axis=0), np.finfo(float).tiny)


def usual_sizes(columns: Float[np.ndarray, "r k"], count: int) -> Float[np.ndarray, " k"]:
    """Root mean squares of columns.

    Args:
        columns: The columns.
        count: How many samples their rows stand for, which may be those of a triangular factor.

    Returns:
        One for each; one where it is zero.
    """
    size = np.linalg.norm(columns, axis=0) / np.sqrt(count)
    return np.where(size > 0, size, 1.0)


def interleaved(count: int, stretches: int = _STRETCHES) -> list[Bool[np.ndarray, " T"]]:
    """Every other of some stretches, and the others.

    Args:
        count: Number of rows.
        stretches: Number of stretches, two at least.

    Returns:
        Which rows belong to each half.
    """
    return [np.arange(count) * stretches // count % 2 == k for k in (0, 1)]
