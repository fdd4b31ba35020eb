"""Lower triangles as flat vectors of their entries, row by row."""

import jax.numpy as jnp
import numpy as np

from symoden.shapes import SquareMatrix

from ._functions import Coefficients


def lower_triangle(coefficients: Coefficients, *, size: int) -> SquareMatrix:
    """Fill a lower triangle row by row.

    Args:
        coefficients: `size` (`size` + 1) / 2 entries.
        size: Number of rows.

    Returns:
        The matrix, zero above the diagonal.

    Example:
        >>> lower_triangle(jnp.array([1.0, 2.0, 3.0]), size=2).tolist()
        [[1.0, 0.0], [2.0, 3.0]]
    """
    # Stacking beats scattering: XLA fuses it, and its derivative is a slice.
    rows = np.split(np.arange(size * (size + 1) // 2), np.cumsum(np.arange(1, size)))
    zero = jnp.zeros((), coefficients.dtype)
    return jnp.stack([jnp.stack([*(coefficients[i] for i in row), *[zero] * (size - len(row))]) for row in rows])


def identity_triangle(size: int) -> np.ndarray:
    """Entries of the identity's Cholesky factor, as `lower_triangle` reads them."""
    return np.eye(size)[np.tril_indices(size)]
