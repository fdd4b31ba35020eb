"""Inverse of a mass matrix of two coordinates."""

import jax.numpy as jnp

from symoden.shapes import SquareMatrix


def inverse_of_symmetric_2x2(M: SquareMatrix) -> SquareMatrix:
    """Invert by the adjugate: several times faster than a factorization, and as accurate for two coordinates."""
    a, b, c = M[0, 0], M[0, 1], M[1, 1]
    return jnp.array([[c, -b], [-b, a]]) / (a * c - b * b)
