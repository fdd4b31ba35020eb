"""Which parts of a model training may change."""

import functools
import operator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ._fourier import FourierSeries
from ._functions import CORRECTIONS, AbstractFunction, Correction, Network, Perceptron, Sum
from ._harmonics import Harmonics
from ._known import Known


def trainable(model: PyTree, *, corrections: int = CORRECTIONS) -> PyTree:
    """Say which leaves training may change.

    Args:
        model: Any tree of modules.
        corrections: Which kinds of terms marked as `Correction` are free, as flags; 0 for none of them.

    Returns:
        Tree prefix of booleans, for `eqx.partition`: false for `Known` arrays, for whatever is no array of floats,
        and for frozen corrections.
    """
    is_fixed = functools.partial(_is_fixed, corrections=corrections)
    return jax.tree.map(lambda leaf: not is_fixed(leaf) and eqx.is_inexact_array(leaf), model, is_leaf=is_fixed)


def _is_fixed(node: object, *, corrections: int) -> bool:
    """Whether training may change nothing in a part of a model."""
    return isinstance(node, Known) or (isinstance(node, Correction) and not node.kind & corrections)


def without_silent(model: PyTree, *, corrections: int = 0) -> PyTree:
    """Leave out the terms that are zero, for the time that it takes to evaluate them.

    Args:
        model: Any tree of modules.
        corrections: Kinds that stay though they are zero, since their derivatives are not.

    Returns:
        A model of the same values. The parameters of these kinds are the same ones in the same order.
    """
    lean = functools.partial(_lean, corrections=corrections)
    return jax.tree.map(lean, model, is_leaf=lambda node: isinstance(node, Sum))


def _lean(node: object, *, corrections: int) -> object:
    """A sum without its silent terms, but for corrections of these kinds; any other part as it is."""
    if not isinstance(node, Sum):
        return node
    terms = tuple(term for term in node.terms if _is_one_of(term, corrections) or not is_silent(term))
    return terms[0] if len(terms) == 1 else Sum(terms)


def _is_one_of(term: AbstractFunction, corrections: int) -> bool:
    """Whether a term is a correction of these kinds."""
    return isinstance(term, Correction) and bool(term.kind & corrections)


def is_silent(node: object) -> bool:
    """Whether a part of a model is a correction by a network or by harmonics, and zero everywhere.

    Args:
        node: Anything.

    Returns:
        Whether its last layer, or all its weights, are zero.
    """
    if not isinstance(node, Correction):
        return False
    return isinstance(node.function, Network | Harmonics | FourierSeries) and _is_zero(node)


def silenced(model: PyTree, kinds: int) -> PyTree:
    """A model without the corrections of some kinds, which may be set free again.

    Args:
        model: Any tree of modules.
        kinds: Which, as flags.

    Returns:
        The model, with zeros in their last layers, or in all their weights.
    """

    def zero(node: object) -> object:
        if not isinstance(node, Correction) or not node.kind & kinds:
            return node
        if isinstance(node.function, Network):
            return eqx.tree_at(lambda each: each.function.perceptron, node, replace_fn=Perceptron.silenced)
        learned, given = eqx.partition(node, trainable(node))
        return eqx.combine(jax.tree.map(jnp.zeros_like, learned), given)

    return jax.tree.map(zero, model, is_leaf=lambda node: isinstance(node, Correction))


def kinds_in_use(model: PyTree) -> int:
    """Which corrections training has set free and kept.

    Args:
        model: Any tree of modules.

    Returns:
        The kinds of those that are not zero everywhere, as flags; 0 if all are.
    """
    parts = jax.tree.leaves(model, is_leaf=lambda node: isinstance(node, Correction))
    used = (part.kind for part in parts if isinstance(part, Correction) and not _is_zero(part))
    return functools.reduce(operator.or_, used, 0)


def _is_zero(correction: Correction) -> bool:
    """Whether a correction is zero everywhere, by its weights: at single places one that is free may be zero."""
    match correction.function:
        case Network(perceptron=last):
            numbers = [last.weights[-1], last.biases[-1]]
        case function:
            numbers = jax.tree.leaves(eqx.filter(function, trainable(function)))
    return not any(np.any(np.asarray(each)) for each in numbers)


def count_active(model: PyTree) -> int:
    """Number of trainable parameters that do something: without those of corrections that were never needed.

    Args:
        model: Any tree of modules.

    Returns:
        Number of scalars.
    """
    return count_parameters(model, corrections=kinds_in_use(model))


def count_parameters(model: PyTree, *, corrections: int = CORRECTIONS) -> int:
    """Number of trainable parameters.

    Args:
        model: Any tree of modules.
        corrections: Of which kinds those of terms marked as `Correction` count, as flags.

    Returns:
        Number of scalars that training may change.
    """
    return sum(leaf.size for leaf in jax.tree.leaves(eqx.filter(model, trainable(model, corrections=corrections))))
