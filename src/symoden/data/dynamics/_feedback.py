"""Inputs that follow the state: by feedback, because the machine moves slowly, or at one frequency alone."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding

from ._targets import targets_of
from ._told_inputs import shares_told

_FOLLOWS: Final = 0.8  # Share of an input's variance; 0.87 on a measured ball on a beam whose input training lost.
_CONFUSED: Final = {"V": "potential_energy", "D": "dissipation_matrix"}  # What may do the same as such an input.


def find_feedback(dataset: Dataset, units: Mapping[str, float], is_angle: np.ndarray) -> list[Finding]:
    """Say which inputs are nearly a function of positions and velocities.

    What such an input does cannot be told from what a spring or a damper does, unless both are known: a model may
    explain the motion without it. The target that a servo follows is told by its motion by rights.

    Args:
        dataset: Recordings as training sees them.
        units: Units of columns that the description gives.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    known = dataset.known
    confused = [letter for letter, part in _CONFUSED.items() if known is None or part not in known.fixed]
    if not dataset.train or not dataset.inputs or not confused:
        return []
    share = shares_told(dataset, is_angle)
    is_target = [j is not None for j in targets_of(dataset, units)]
    follows = np.flatnonzero((share > _FOLLOWS) & ~np.array(is_target))
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
