"""A regression that is judged by what it did not see."""

from typing import Final

import numpy as np
from jaxtyping import Bool, Float

_BLOCKS: Final = 8  # Stretches.
RANK: Final = 1e-6
"""Singular value beside the largest one from which a direction tells something."""


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
    scaled = regressors / sizes(regressors)
    both = halves(len(targets))
    return np.concatenate(
        [targets[a] - scaled[a] @ np.linalg.lstsq(scaled[b], targets[b], rcond=RANK)[0] for a, b in (both, both[::-1])]
    )


def sizes(regressors: Float[np.ndarray, "T k"]) -> Float[np.ndarray, " k"]:
    """What to divide columns of several units by.

    Args:
        regressors: The columns.

    Returns:
        The largest absolute value of each; hardly more than zero where all are zero.
    """
    return np.maximum(np.abs(regressors).max(axis=0), np.finfo(float).tiny)


def halves(count: int) -> list[Bool[np.ndarray, " T"]]:
    """Every other of eight stretches, and the others.

    Args:
        count: Number of rows.

    Returns:
        Which rows belong to each half.
    """
    return [np.arange(count) * _BLOCKS // count % 2 == k for k in (0, 1)]
