"""A model as one vector of its trainable parameters, and back."""

from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree

from symoden.blocks import is_silent, trainable, without_silent


@final
class Flattening(eqx.Module):
    """Restores a model from the vector of its free parameters.

    Attributes:
        fixed: The model with None in place of its free parameters.
        structure: Tree of the free parameters.
        shapes: Their shapes, in the order of the vector.
        corrections: Which kinds of terms marked as `Correction` are free, as flags.
    """

    fixed: PyTree
    structure: Any = eqx.field(static=True)
    shapes: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    corrections: int = eqx.field(static=True)

    @classmethod
    def of(
        cls, model: PyTree, *, corrections: int, dtype: DTypeLike = float
    ) -> tuple["Flattening", Float[Array, " P"]]:
        """Split a model.

        Args:
            model: Any tree of modules.
            corrections: Which kinds of terms marked as `Correction` are free, as flags.
            dtype: Precision of the vector and of the arrays that stay.

        Returns:
            What restores the model, and its free parameters.
        """
        free, fixed = eqx.partition(model, trainable(model, corrections=corrections))
        fixed = cast(fixed, dtype)
        leaves, structure = jax.tree.flatten(free)
        theta = cast(np.concatenate([np.ravel(leaf) for leaf in leaves]), dtype)
        return cls(fixed, structure, tuple(leaf.shape for leaf in leaves), corrections), theta

    def lean(self, theta: Float[Array, " P"]) -> "Flattening":
        """The same without corrections that are neither free nor anything but zero: what it restores takes less time.

        Args:
            theta: Any parameters.

        Returns:
            What restores models of the same values from the same parameters.
        """
        model = without_silent(self(theta), corrections=self.corrections)
        return Flattening.of(model, corrections=self.corrections, dtype=theta.dtype)[0]

    def __call__(self, theta: Float[Array, " P"]) -> PyTree:
        """Model with these parameters, in their precision unless it is double where that is switched off."""
        ends = np.cumsum([int(np.prod(shape)) for shape in self.shapes])[:-1]
        traced = isinstance(theta, Tracer)
        parts = jnp.split(theta, ends) if traced else np.split(np.asarray(theta), ends)
        leaves = [part.reshape(shape) for part, shape in zip(parts, self.shapes, strict=True)]
        leaves = leaves if traced else jax.device_put(leaves)  # See `cast`.
        return eqx.combine(jax.tree.unflatten(self.structure, leaves), self.fixed)


def drawn(model: PyTree, corrections: int) -> Float[np.ndarray, " P"]:
    """Middle of the priors of what is free: where networks that are still zero were drawn, else zero."""
    # As long as its last layer is zero the data tell nothing of a network's others, and a prior about zero would take
    # these there in one step, from where there is no way back.
    middles = jax.tree.map(
        lambda node: node if is_silent(node) else jax.tree.map(jnp.zeros_like, node), model, is_leaf=is_silent
    )
    return np.asarray(Flattening.of(middles, corrections=corrections)[1])


def cast(model: PyTree, dtype: DTypeLike) -> PyTree:
    """Change the precision of every array of floats.

    Args:
        model: A model, or any tree with arrays in it.
        dtype: Precision; double needs `jax_enable_x64`.

    Returns:
        The same; what is too large for its precision is infinite.
    """
    # On the host: on a device every shape is a program, which takes 20 ms to compile.
    with np.errstate(over="ignore"):
        return jax.tree.map(lambda x: jax.device_put(np.asarray(x, dtype)) if eqx.is_inexact_array(x) else x, model)
