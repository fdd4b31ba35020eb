"""Smooth functions about a configuration, linear in their coefficients: what matching conditions are solved with."""

import itertools
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.shapes import Coordinates
from symoden.spaces import Space

_POWERS = 2  # Of a length: higher ones would run away where a cart rolls.


@final
class Expansion(eqx.Module):
    """Products of sin(k e), 1 − cos(k e) of angles and powers of lengths, e being the way from a configuration.

    Attributes:
        space: Configuration space.
        target: The configuration.
        coefficients: Of every product in every output.
        order: Largest sum of the degrees k of a product.
    """

    space: Space
    target: Coordinates
    coefficients: Float[Array, "f k"]
    order: int = eqx.field(static=True)

    def products(self, q: Coordinates) -> Float[Array, " f"]:
        """Values of the products; the first one is constant, the others vanish at the target.

        Args:
            q: Coordinates.

        Returns:
            The values.
        """
        e = self.space.difference(q, self.target)
        degrees = range(1, self.order + 1)
        chosen = np.array(_products(self.space, self.order))
        factors = []
        for i, angle in enumerate(self.space.is_angle):
            if angle:
                pairs = [(jnp.sin(k * e[i]) / k, (1 - jnp.cos(k * e[i])) / k**2) for k in degrees]
                values = [value for pair in pairs for value in pair]
            else:
                values = [e[i] ** k for k in range(1, _POWERS + 1)]
            factors.append(jnp.stack([jnp.ones_like(e[i]), *values])[chosen[:, i]])
        return jnp.prod(jnp.stack(factors), axis=0)

    def degrees(self) -> Float[np.ndarray, " f"]:
        """Degree of every product; 1 for the constant.

        Returns:
            The degrees.
        """
        return np.array([max(1, _degree(self.space, product)) for product in _products(self.space, self.order)], float)

    def __call__(self, q: Coordinates) -> Float[Array, " k"]:
        """Values at the configuration `q`."""
        return self.products(q) @ self.coefficients


def _products(space: Space, order: int) -> list[tuple[int, ...]]:
    """Which factor of every coordinate each product takes; the constant product first."""
    choices = [range(2 * order + 1) if angle else range(_POWERS + 1) for angle in space.is_angle]
    return [choice for choice in itertools.product(*choices) if _degree(space, choice) <= order]


def _degree(space: Space, product: tuple[int, ...]) -> int:
    """Sum of the degrees of a product's factors."""
    return sum((k + 1) // 2 if angle else k for k, angle in zip(product, space.is_angle, strict=True))
