"""Given parts that are only nearly right, and what corrects them."""

from typing import final

import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates, DissipationMatrix, SquareMatrix, Velocities

from ._fields import AbstractBlock
from ._friction import AbstractFriction
from ._functions import AbstractFunction
from ._known import Known
from ._triangles import lower_triangle


@final
class CorrectedBlock(AbstractBlock):
    """Sum of a given field and its correction: for the potential energy and the input matrix.

    Attributes:
        given: The field as it is known.
        correction: What is added.
    """

    given: AbstractBlock
    correction: AbstractBlock

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Sum at `q`."""
        return self.given(q) + self.correction(q)


@final
class Congruence(AbstractBlock):
    """The matrix I + S L(q) S⁻¹ that corrects a given inertia or friction X as C X Cᵀ, which stays positive.

    Attributes:
        function: Entries of the lower triangle L, row by row.
        scale: Diagonal of S: square roots of the physical units of X.
    """

    function: AbstractFunction
    scale: Known

    def __call__(self, q: Coordinates) -> SquareMatrix:
        """Matrix C at `q`."""
        scale = self.scale.value
        triangle = lower_triangle(self.function(q), size=scale.shape[0])
        return jnp.eye(scale.shape[0], dtype=triangle.dtype) + triangle * scale[:, None] / scale[None]


@final
class CorrectedMatrix(AbstractBlock):
    """A given symmetric matrix field X as C X Cᵀ: for the inertia.

    Attributes:
        given: The field as it is known.
        correction: The matrix C.
    """

    given: AbstractBlock
    correction: Congruence

    def __call__(self, q: Coordinates) -> SquareMatrix:
        """Matrix at `q`."""
        C = self.correction(q)
        return C @ self.given(q) @ C.T


@final
class CorrectedFriction(AbstractFriction):
    """A given dissipation matrix D as C D Cᵀ.

    Attributes:
        given: Friction as it is known.
        correction: The matrix C.
    """

    given: AbstractFriction
    correction: Congruence

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""
        C = self.correction(q)
        return C @ self.given(q, v) @ C.T
