"""Arrays that are given."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


@final
class Known(eqx.Module):
    """An array that training leaves alone: a unit's scale, a given input matrix.

    Attributes:
        array: The value.
    """

    array: Float[Array, "..."]

    @classmethod
    def of(cls, values: np.ndarray | float) -> "Known":
        """Constants in the default precision."""
        return cls(jnp.asarray(values, float))

    @property
    def value(self) -> Float[Array, "..."]:
        """The array, cut off from differentiation."""
        return jax.lax.stop_gradient(self.array)

    def times(self, factor: float | int | np.ndarray) -> "Known":
        """The array multiplied, in its own precision.

        Args:
            factor: The factor, or one for each entry.

        Returns:
            The product.
        """
        return Known(self.array * jnp.asarray(factor, self.array.dtype))
