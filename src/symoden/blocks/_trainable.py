"""Which parts of a model training may change."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from symoden.shapes import Coordinates

from ._functions import AbstractFunction, Correction, Network, Sum
from ._known import Known

FRICTION = 1
"""Rung of corrections that are laws of friction: dry and quadratic parts."""
DIRECTIONS = 2
"""Rung of what makes friction depend on the direction."""
RUNGS = 3
"""Number of rungs of the ladder that corrections are set free on: the last is that of networks."""


def trainable(model: PyTree, *, corrections: int = RUNGS) -> PyTree:
    """Say which leaves training may change.

    Args:
        model: Any tree of modules.
        corrections: Up to which rung terms marked as `Correction` are free; 0 for none of them.

    Returns:
        Tree prefix of booleans, for `eqx.partition`: false for `Known` arrays, for whatever is no array of floats,
        and for frozen corrections.
    """

    def is_fixed(node: object) -> bool:
        return isinstance(node, Known) or (isinstance(node, Correction) and node.rung > corrections)

    return jax.tree.map(lambda leaf: not is_fixed(leaf) and eqx.is_inexact_array(leaf), model, is_leaf=is_fixed)


def without_silent(model: PyTree, *, corrections: int = 0) -> PyTree:
    """Leave out the terms that are zero, for the time that it takes to evaluate them.

    Args:
        model: Any tree of modules.
        corrections: Up to which rung they stay though they are zero, since their derivatives are not.

    Returns:
        A model of the same values. The parameters up to that rung are the same ones in the same order.
    """

    def lean(node: object) -> object:
        if not isinstance(node, Sum):
            return node
        terms = tuple(term for term in node.terms if not _is_silent(term, corrections))
        return terms[0] if len(terms) == 1 else Sum(terms)

    return jax.tree.map(lean, model, is_leaf=lambda node: isinstance(node, Sum))


def _is_silent(term: AbstractFunction, corrections: int) -> bool:
    """Whether a term is a correction beyond a rung, and its last layer is zero."""
    if not isinstance(term, Correction) or term.rung <= corrections or not isinstance(term.function, Network):
        return False
    last = term.function.perceptron
    return not (np.any(np.asarray(last.weights[-1])) or np.any(np.asarray(last.biases[-1])))


def highest_rung(model: PyTree, q: Coordinates) -> int:
    """Which corrections training has set free and kept.

    Args:
        model: Any tree of modules.
        q: Any configuration of its space; there a correction that was never free is zero.

    Returns:
        The highest rung of a correction that is not silent; 0 if all are.
    """
    leaves = jax.tree.leaves(model, is_leaf=lambda node: isinstance(node, Correction))
    found = [leaf for leaf in leaves if isinstance(leaf, Correction)]
    return max((correction.rung for correction in found if np.any(np.asarray(correction(q)))), default=0)


def count_active(model: PyTree, q: Coordinates) -> int:
    """Number of trainable parameters that do something: without those of corrections that were never needed.

    Args:
        model: Any tree of modules.
        q: Any configuration of its space.

    Returns:
        Number of scalars.
    """
    return count_parameters(model, corrections=highest_rung(model, q))


def count_parameters(model: PyTree, *, corrections: int = RUNGS) -> int:
    """Number of trainable parameters.

    Args:
        model: Any tree of modules.
        corrections: Up to which rung those of terms marked as `Correction` count.

    Returns:
        Number of scalars that training may change.
    """
    return sum(leaf.size for leaf in jax.tree.leaves(eqx.filter(model, trainable(model, corrections=corrections))))
