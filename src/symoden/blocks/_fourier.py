"""Harmonics of single angles, as cogging, detents and springs about a joint have them."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates
from symoden.spaces import Space

from ._functions import AbstractFunction, Coefficients


@final
class FourierSeries(AbstractFunction):
    """Sum of cos kφ / k and sin kφ / k over every angle φ, for k = 2, …, K.

    The first harmonics are left to `Harmonics`. Of an energy, weights of the same size are torques of the same size
    then, whatever k is.

    Attributes:
        weights: Coefficients of the first angle's cosines, of its sines, of the second angle's cosines, and so on, in
            every output.
        space: Configuration space.
        order: K.
    """

    weights: Float[Array, "f k"]
    space: Space
    order: int = eqx.field(static=True)

    @classmethod
    def init(cls, space: Space, outputs: int, *, order: int) -> "FourierSeries":
        """Make the series that is zero.

        Args:
            space: Configuration space.
            outputs: Number of coefficients.
            order: K, at least 2.

        Returns:
            The function.

        Example:
            >>> FourierSeries.init(Space.parse("R1 T2"), 1, order=24).weights.shape
            (92, 1)
        """
        return cls(jnp.zeros((2 * (order - 1) * len(space.angles), outputs), float), space, order)

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        k = jnp.arange(2, self.order + 1, dtype=q.dtype)
        phases = [k * q[i] for i in self.space.angles.tolist()]
        waves = [wave(phase) / k for phase in phases for wave in (jnp.cos, jnp.sin)]
        return jnp.concatenate(waves) @ self.weights
