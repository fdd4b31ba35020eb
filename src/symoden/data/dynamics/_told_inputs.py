"""Inputs that positions and velocities tell."""

from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset

from ._regression import unseen_residuals

_CONSTANT: Final = 1e-12  # Variance that is rounding, relative to the mean square.
_MANY: Final = 5  # Samples for each number of the regression.


def shares_told(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Find how much of each input is a function of positions and velocities.

    A regression on 1, q and q² (of angles cosine and sine) and velocities sees most controllers. Every other stretch is
    predicted from the rest: in a short, smooth motion anything follows anything.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        Shares of the inputs' variances; 0 of one that is constant, and where there are too few rows to tell.
    """
    if not dataset.train:
        return np.zeros(dataset.inputs)
    q, rates, us = (np.concatenate([getattr(each, name) for each in dataset.train]) for name in ("q", "rates", "us"))
    where = np.where(is_angle, np.cos(q), q), np.where(is_angle, np.sin(q), q**2)
    regressors = np.concatenate([np.ones((len(q), 1)), *where, rates], axis=1)
    if not us.shape[1] or len(q) < 2 * _MANY * regressors.shape[1]:
        return np.zeros(us.shape[1])
    left = unseen_residuals(regressors, us)
    spread = np.var(us, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        told = 1 - np.mean(left**2, axis=0) / spread
    return np.where(spread > _CONSTANT * np.mean(us**2, axis=0), told, 0.0)
