"""Polynomials of lengths, as springs have them."""

import math
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.shapes import Coordinates

from ._functions import AbstractFunction, Coefficients
from ._known import Known


@final
class Polynomial(AbstractFunction):
    """Linear combination of all monomials of the coordinates up to a total degree.

    The energy of linear springs between anything that slides has degree 2, that of springs that harden on both sides
    alike degree 4.

    Far from the data a polynomial falls as it may, ever steeper, and what slides down there is gone in no time. Beyond
    `reach` it therefore is one of the logarithm of the distance, with a continuous slope: forces stay bounded.

    Attributes:
        weights: Coefficient of every monomial in every output, by their degree; the constant first.
        center: Subtracted from the coordinates.
        scale: Divides them then.
        degree: Highest total degree.
        reach: How far it is a polynomial on either side of the center, in units of the scale; None for everywhere.
    """

    weights: Float[Array, "f k"]
    center: Known
    scale: Known
    degree: int = eqx.field(static=True)
    reach: Known | None = None

    @classmethod
    def init(
        cls,
        outputs: int,
        *,
        degree: int,
        center: Float[np.ndarray, " n"],
        scale: Float[np.ndarray, " n"],
        reach: Float[np.ndarray, " n"] | None = None,
    ) -> "Polynomial":
        """Make the polynomial that is zero: any other may fall without end, and a first rollout with it.

        Args:
            outputs: Number of coefficients k.
            degree: Highest total degree.
            center: Subtracted from the n coordinates.
            scale: Divides them then.
            reach: How far it is a polynomial, in units of the scale; None for everywhere.

        Returns:
            The function.

        Example:
            >>> Polynomial.init(1, degree=4, center=np.zeros(2), scale=np.ones(2)).weights.shape
            (15, 1)
        """
        return cls(
            weights=jnp.zeros((monomials(len(center), degree), outputs), float),
            center=Known.of(center),
            scale=Known.of(scale),
            degree=degree,
            reach=None if reach is None else Known.of(reach),
        )

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        # By total degree, of the last coordinates: no gathers, which are slow to differentiate.
        found = [jnp.ones(1, q.dtype)] + [jnp.zeros(0, q.dtype)] * self.degree
        xs = (q - self.center.value) / self.scale.value
        if self.reach is not None:
            distance, reach = jnp.abs(xs), self.reach.value
            beyond = jnp.log1p(jnp.maximum(distance - reach, 0.0))
            xs = jnp.where(distance > reach, jnp.sign(xs) * (reach + beyond), xs)
        for x in xs[::-1]:
            powers = [x**power for power in range(self.degree + 1)]
            found = [
                jnp.concatenate([powers[degree - rest] * found[rest] for rest in range(degree + 1)])
                for degree in range(self.degree + 1)
            ]
        return jnp.concatenate(found) @ self.weights


def monomials(size: int, degree: int) -> int:
    """Number of monomials of so many variables up to a total degree.

    Args:
        size: Number of variables.
        degree: Highest total degree.

    Returns:
        The number.

    Example:
        >>> monomials(3, 4)
        35
    """
    return math.comb(size + degree, degree)
