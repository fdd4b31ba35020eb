"""Which parts of a model training may change."""

import equinox as eqx
import jax
from jaxtyping import PyTree

from ._functions import Correction
from ._known import Known


def trainable(model: PyTree, *, corrections: bool = True) -> PyTree:
    """Say which leaves training may change.

    Args:
        model: Any tree of modules.
        corrections: Whether terms marked as `Correction` are free.

    Returns:
        Tree prefix of booleans, for `eqx.partition`: false for `Known` arrays, for whatever is no array of floats,
        and for frozen corrections.
    """
    fixed = (Known,) if corrections else (Known, Correction)
    return jax.tree.map(
        lambda leaf: not isinstance(leaf, fixed) and eqx.is_inexact_array(leaf),
        model,
        is_leaf=lambda node: isinstance(node, fixed),
    )


def count_parameters(model: PyTree, *, corrections: bool = True) -> int:
    """Number of trainable parameters.

    Args:
        model: Any tree of modules.
        corrections: Whether those of terms marked as `Correction` count.

    Returns:
        Number of scalars that training may change.
    """
    return sum(leaf.size for leaf in jax.tree.leaves(eqx.filter(model, trainable(model, corrections=corrections))))
