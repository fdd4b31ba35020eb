"""Inputs that push the other way round than the given g says."""

from typing import Final

import numpy as np
from jaxtyping import Float

from ._bumps import bumps_of, stacked
from ._dataset import Dataset
from ._description import Description
from ._findings import Finding
from ._regression import RANK, halves, sizes
from ._units import entry

_CLEAR: Final = 5.0  # Standard errors, in either half of the recordings: arms and drives have 10 to 40.


def find_input_signs(dataset: Dataset, description: Description, is_angle: np.ndarray) -> list[Finding]:
    """Say which inputs accelerate the mechanism the other way round than `input_matrix` has it.

    Whatever the inertia, gᵀ M⁻¹ g has a positive diagonal. The effects M⁻¹ g of the inputs are told by a regression of
    accelerations on functions of single positions, friction, products of velocities and inputs, as they are alike on
    the whole. A model would bend V and D around the wrong sign, and predict not much worse. What acts later than it was
    logged may seem to act the other way round: look for delays first.

    Args:
        dataset: Recordings as training sees them.
        description: What it means.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    if not dataset.train or not dataset.inputs or dataset.momenta or dataset.input_matrix is None:
        return []
    parts = bumps_of(dataset.train, is_angle, held=dataset.hold == "zero")
    if not parts:
        return []
    motion, pushed, gained = stacked(parts)
    pushed = pushed.reshape(len(motion), dataset.inputs, -1)[:, :, 0]
    effects = [
        _effects(motion[half], pushed[half], gained[half], np.asarray(dataset.input_matrix))
        for half in halves(len(motion))
    ]
    wrong = np.flatnonzero(np.max(effects, axis=0) < -_CLEAR)
    if not len(wrong):
        return []
    names = [dataset.input_names[j] for j in wrong]
    several = len(names) > 1
    return [
        Finding(
            kind="sign",
            level="warning",
            channel="" if several else names[0],
            text=f"in [train] {', '.join(f'`{name}`' for name in names)} {'accelerate' if several else 'accelerates'} "
            f"the other way round than `input_matrix` says, by {-np.max(effects, axis=0)[wrong].max():.2g} standard "
            "errors or more",
            advice=f"Write {entry(dict.fromkeys(names, -1.0), description.units)}, or turn the signs in "
            "`input_matrix`; or else those of positions and velocities.",
        )
    ]


def _effects(
    motion: Float[np.ndarray, "B k"],
    pushed: Float[np.ndarray, "B m"],
    gained: Float[np.ndarray, "B n"],
    g: Float[np.ndarray, "n m"],
) -> Float[np.ndarray, " m"]:
    """Diagonal of gᵀ M⁻¹ g, beside its standard errors; zero where nothing tells."""
    m = g.shape[1]
    size = sizes(pushed)
    regressors = np.concatenate([motion / sizes(motion), pushed / size], axis=1)
    U, s, Vt = np.linalg.svd(regressors, full_matrices=False)
    told = s > RANK * s[0]
    root = Vt[told].T / s[told]
    found = root @ (U[:, told].T @ gained)
    left = np.sum((gained - regressors @ found) ** 2, axis=0) / max(1, len(gained) - told.sum())
    spread = np.sum(root[-m:] ** 2, axis=1)[:, None] * left
    effect = np.einsum("ij,ji->j", g, found[-m:])
    error = np.sqrt(np.einsum("ij,ji->j", g**2, spread))
    return np.where(error > 0, effect / np.maximum(error, np.finfo(float).tiny), 0.0)
