"""Blocks: fields on the configuration space, in physical units, made of functions or given."""

import abc
from collections.abc import Callable
from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates, DissipationMatrix, Scalar, SquareMatrix

from ._functions import AbstractFunction, as_precise_as
from ._known import Known
from ._triangles import inverse_of_positive, lower_triangle


class AbstractBlock(eqx.Module):
    """Field on the configuration space in physical units: M⁻¹, V, g or viscous friction."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""


@final
class KnownValue(AbstractBlock):
    """A given constant.

    Attributes:
        value: The constant in physical units.
    """

    value: Known

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """The constant, whatever `q` is."""
        return as_precise_as(q, self.value.value)


@final
class KnownFunction(AbstractBlock):
    """A given function of the configuration.

    Attributes:
        function: Maps q to the value in physical units, by JAX's functions and depending on nothing else. It is code,
            hence not saved with a model.
    """

    function: Callable[[Coordinates], Float[Array, "..."]] = eqx.field(static=True)

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""
        return jnp.asarray(self.function(q)).astype(q.dtype)  # It may be a constant of another precision.


@final
class ScalarBlock(AbstractBlock):
    """A scalar field, such as the potential energy.

    Attributes:
        function: Gives one coefficient.
        scale: Physical unit of the coefficient.
    """

    function: AbstractFunction
    scale: Known

    def __call__(self, q: Coordinates) -> Scalar:
        """Value at `q`."""
        return self.scale.value * self.function(q)[0]


@final
class MatrixBlock(AbstractBlock):
    """A matrix field, such as the input matrix.

    Attributes:
        function: Gives the entries, row by row.
        scale: Physical unit of each entry; its shape is the matrix's.
    """

    function: AbstractFunction
    scale: Known

    def __call__(self, q: Coordinates) -> Float[Array, "n m"]:
        """Matrix at `q`."""
        scale = self.scale.value
        return scale * self.function(q).reshape(scale.shape)


@final
class CholeskyBlock(AbstractBlock):
    """A symmetric matrix field S (L Lᵀ + ε I) S, positive definite for ε > 0 and semidefinite for ε = 0.

    Attributes:
        function: Gives the entries of the lower triangle L, row by row.
        scale: Diagonal of S: square roots of the physical units.
        floor: The constant ε that bounds the scaled eigenvalues from below.
    """

    function: AbstractFunction
    scale: Known
    floor: float = eqx.field(static=True, default=0.0)

    def __check_init__(self) -> None:
        """Refuse a negative floor.

        Raises:
            ValueError: If `floor` is negative, for the matrix could then be indefinite.
        """
        if self.floor < 0:
            raise ValueError(f"`floor` must be at least 0; got {self.floor}.")

    def __call__(self, q: Coordinates) -> DissipationMatrix:
        """Matrix at `q`."""
        scale = self.scale.value
        factor = scale[:, None] * lower_triangle(self.function(q), size=scale.shape[0])
        return factor @ factor.T + jnp.diag(self.floor * scale**2)


@final
class GramBlock(AbstractBlock):
    """A symmetric positive definite matrix field S (Jᵀ J + ε I) S, such as a mass matrix.

    Kinetic energy is a sum of squares, ½ Σ m |velocity|², of velocities J(q) v. The Jacobian J of rigid bodies on
    joints is a simpler function than M⁻¹ or a Cholesky factor.

    Attributes:
        function: Gives the entries of J, row by row; any number of rows.
        scale: Diagonal of S: square roots of the physical units.
        floor: The constant ε that bounds the scaled eigenvalues from below.
    """

    function: AbstractFunction
    scale: Known
    floor: float = eqx.field(static=True)

    def __check_init__(self) -> None:
        """Refuse a floor that does not bound.

        Raises:
            ValueError: If `floor` is not positive, for the matrix could then be singular.
        """
        if self.floor <= 0:
            raise ValueError(f"`floor` must be positive; got {self.floor}.")

    def __call__(self, q: Coordinates) -> SquareMatrix:
        """Matrix at `q`."""
        scale = self.scale.value
        jacobian = self.function(q).reshape(-1, scale.shape[0]) * scale[None]
        return jacobian.T @ jacobian + jnp.diag(self.floor * scale**2)


@final
class InverseBlock(AbstractBlock):
    """The inverse of a matrix field: M⁻¹ where M is given.

    Attributes:
        matrix: The field; NaN comes out where it is not symmetric positive definite.
    """

    matrix: AbstractBlock

    def __call__(self, q: Coordinates) -> SquareMatrix:
        """Inverse matrix at `q`."""
        return inverse_of_positive(self.matrix(q))
