"""Inputs that follow the state: by feedback, because the machine moves slowly, or at one frequency alone."""

from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data.dynamics import unseen_residuals

_FOLLOWS: Final = 0.8  # Share of an input's variance; 0.87 on a measured ball on a beam whose input training lost.
_CONSTANT: Final = 1e-12  # Variance that is rounding, relative to the mean square.
_CONFUSED: Final = {"V": "potential_energy", "D": "dissipation_matrix"}  # What may do the same as such an input.
_MANY: Final = 5  # Samples for each number of the regression.


def find_feedback(dataset: Dataset, is_angle: np.ndarray) -> list[Finding]:
    """Say which inputs are nearly a function of positions and velocities.

    What such an input does cannot be told from what a spring or a damper does, unless both are known: a model may
    explain the motion without it. A regression on 1, q and q² (of angles cosine and sine) and velocities sees most
    controllers. Every other stretch is predicted from the rest: in a short, smooth motion anything follows anything.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    known = dataset.known
    confused = [letter for letter, part in _CONFUSED.items() if known is None or part not in known.fixed]
    if not dataset.train or not dataset.inputs or not confused:
        return []
    q, rates, us = (np.concatenate([getattr(each, name) for each in dataset.train]) for name in ("q", "rates", "us"))
    where = np.where(is_angle, np.cos(q), q), np.where(is_angle, np.sin(q), q**2)
    regressors = np.concatenate([np.ones((len(q), 1)), *where, rates], axis=1)
    if len(q) < 2 * _MANY * regressors.shape[1]:
        return []
    left = unseen_residuals(regressors, us)
    spread = np.var(us, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(spread > _CONSTANT * np.mean(us**2, axis=0), 1 - np.mean(left**2, axis=0) / spread, 0.0)
    follows = np.flatnonzero(share > _FOLLOWS)
    if not len(follows):
        return []
    acts = dataset.input_matrix is not None or (known is not None and "input_matrix" in known.given)
    part = " and ".join(confused) if acts else "g"
    plural = acts and len(confused) > 1
    more = " or ".join(confused) if acts else ", ".join(["`input_matrix`", *confused[:1]])
    named = ", ".join(f"`{dataset.input_names[i]}` to {share[i]:.0%}" for i in follows)
    return [
        Finding(
            kind="feedback",
            level="warning",
            channel=dataset.input_names[follows[0]] if len(follows) == 1 else "",
            text=f"in [train] positions and velocities tell {named}: by feedback, slow motion, or a single frequency. "
            "What these inputs do may not be told from springs and dampers",
            advice=f"Look after training whether `symoden inspect` finds {part} larger than "
            f"{'their bands' if plural else 'its band'}. If not, record with a signal of its own on top (steps, a "
            f"chirp, noise), or give what is known: {more} under [known].",
        )
    ]
