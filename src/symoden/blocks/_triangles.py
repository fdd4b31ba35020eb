"""Lower triangles as flat vectors of their entries, row by row."""

import jax
import jax.numpy as jnp
import numpy as np

from symoden.shapes import Scalar, SquareMatrix

from ._functions import Coefficients

_UNROLLED = 4


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


@jax.custom_jvp
def inverse_of_positive(matrix: SquareMatrix) -> SquareMatrix:
    """Invert a symmetric positive definite matrix; NaN where it is not positive definite.

    Nothing is left to LAPACK, whose batches of triangular systems may wait for each other without end (see
    `symoden._jaxlib`). Small matrices go by their Cholesky factor, written out, which XLA fuses with the rest; larger
    ones are swept, pivot by pivot, which compiles in less time. The derivative is written down too,
    dA⁻¹ = −A⁻¹ dA A⁻¹: that of the factorization takes twice as long to compile.

    Args:
        matrix: The matrix; its lower triangle is read, and its differentials must be symmetric.

    Returns:
        The inverse, symmetric.

    References:
        Goodnight (1979), *A tutorial on the SWEEP operator*.

    Example:
        >>> inverse_of_positive(jnp.array([[4.0, 0.0], [0.0, 16.0]])).tolist()
        [[0.25, 0.0], [0.0, 0.0625]]
    """
    return _by_factor(matrix) if matrix.shape[0] <= _UNROLLED else _by_sweeps(matrix)


def _by_factor(matrix: SquareMatrix) -> SquareMatrix:
    """A⁻¹ = L⁻ᵀ L⁻¹, entry by entry."""
    n = matrix.shape[0]
    L: dict[tuple[int, int], Scalar] = {}
    W: dict[tuple[int, int], Scalar] = {}  # L⁻¹
    zero = jnp.zeros((), matrix.dtype)
    for j in range(n):
        for i in range(j, n):
            rest = matrix[i, j] - sum((L[i, k] * L[j, k] for k in range(j)), start=zero)
            L[i, j] = jnp.sqrt(rest) if i == j else rest / L[j, j]
    for i in range(n):
        W[i, i] = 1 / L[i, i]
        for j in range(i):
            W[i, j] = -W[i, i] * sum((L[i, k] * W[k, j] for k in range(j, i)), start=zero)
    rows = jnp.stack([jnp.stack([W.get((i, j), zero) for j in range(n)]) for i in range(n)])
    return rows.T @ rows


def _by_sweeps(matrix: SquareMatrix) -> SquareMatrix:
    """A⁻¹ by a sweep of each pivot; these are the squares of the Cholesky factor's diagonal, so positive."""
    A = jnp.tril(matrix) + jnp.tril(matrix, -1).T
    for k in range(len(A)):
        here = np.arange(len(A)) == k
        pivot = jnp.where(A[k, k] > 0, A[k, k], jnp.nan)
        column, row = jnp.where(here, -1, A[:, k]), jnp.where(here, 1, A[k]) / pivot
        A = jnp.where(here[:, None] | here, 0, A) - jnp.outer(column, row)
    return (A + A.T) / 2


@inverse_of_positive.defjvp
def _differential(at: tuple[SquareMatrix], by: tuple[SquareMatrix]) -> tuple[SquareMatrix, SquareMatrix]:
    """The inverse and its differential."""
    inverse = inverse_of_positive(*at)
    return inverse, -inverse @ by[0] @ inverse
