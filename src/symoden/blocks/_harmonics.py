"""Functions made of the first harmonics of angles and low powers of lengths, as rigid bodies on joints have them."""

import dataclasses
import itertools
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from symoden.shapes import Coordinates
from symoden.spaces import Space

from ._functions import AbstractFunction, Coefficients
from ._known import Known


@final
class Harmonics(AbstractFunction):
    """Linear combination of products of one factor per coordinate: of 1, cos φ, sin φ or of 1, r, …, rᵖ.

    On joints that turn or slide, the Jacobians of rigid bodies are such combinations with p = 1, and their potential
    energy in gravity and against linear springs along lengths with p = 2.

    Attributes:
        weights: Coefficient of every product in every output.
        space: Configuration space.
        center: Subtracted from the embedded coordinates.
        scale: Divides them then.
        powers: Highest power p of a length; 0 leaves lengths out.
        order: Largest number of factors of a product that are not 1.
        sliding: Only products with a length among their factors.
    """

    weights: Float[Array, "f k"]
    space: Space
    center: Known
    scale: Known
    powers: int = eqx.field(static=True)
    order: int = eqx.field(static=True)
    sliding: bool = eqx.field(static=True, default=False)

    @classmethod
    def init(
        cls,
        space: Space,
        outputs: int,
        *,
        powers: int = 2,
        order: int = 3,
        spread: float = 0.1,
        center: np.ndarray | None = None,
        scale: np.ndarray | None = None,
        key: PRNGKeyArray,
    ) -> "Harmonics":
        """Draw small weights.

        Args:
            space: Configuration space.
            outputs: Number of coefficients k.
            powers: Highest power of a length; 0 leaves lengths out.
            order: Largest number of factors that are not 1; no more than coordinates are taken.
            spread: Standard deviation of the weights.
            center: Subtracted from the embedded coordinates; zeros if absent.
            scale: Divides them then; ones if absent.
            key: Source of the weights.

        Returns:
            The function.

        Example:
            >>> Harmonics.init(Space.parse("T2"), 1, key=jax.random.key(0)).weights.shape
            (9, 1)
        """
        order = min(order, space.size)
        return cls(
            weights=spread * jax.random.normal(key, (len(products(space, powers, order)), outputs), float),
            space=space,
            center=Known(jnp.asarray(np.zeros(space.embedded_size) if center is None else center, float)),
            scale=Known(jnp.asarray(np.ones(space.embedded_size) if scale is None else scale, float)),
            powers=powers,
            order=order,
        )

    def of_lengths(self) -> "Harmonics":
        """Those of the products that have a length among their factors.

        Returns:
            The function that is left.

        Example:
            >>> Harmonics.init(Space.parse("R1 T1"), 1, powers=1, key=jax.random.key(0)).of_lengths().weights.shape
            (3, 1)
        """
        count = len(products(self.space, self.powers, self.order, sliding=True))
        return dataclasses.replace(self, weights=self.weights[-count:], sliding=True)

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        r, cosines, sines = jnp.split(
            (self.space.embed(q) - self.center.value) / self.scale.value,
            np.cumsum([len(self.space.lengths), len(self.space.angles)]),
        )
        factors = [jnp.stack([x**power for power in range(1, self.powers + 1)]) for x in r] if self.powers else []
        factors += [jnp.stack(pair) for pair in zip(cosines, sines, strict=True)]
        # By how many factors are not 1, of the last coordinates: no gathers, which are slow to differentiate.
        found = [jnp.ones(1, q.dtype)] * (self.order + 1)
        for factor in reversed(factors):
            more = [jnp.outer(factor, fewer).ravel() for fewer in found[:-1]]
            found = found[:1] + [jnp.concatenate(pair) for pair in zip(found[1:], more, strict=True)]
        first = len(products(self.space, 0, self.order)) if self.sliding else 0  # Those without lengths come first.
        return found[-1][first:] @ self.weights


def products(space: Space, powers: int, order: int, *, sliding: bool = False) -> list[tuple[int, ...]]:
    """Products of one factor per coordinate, in the order of their weights.

    Args:
        space: Configuration space.
        powers: Highest power of a length; 0 leaves lengths out.
        order: Largest number of factors that are not 1.
        sliding: Only products with a length among their factors.

    Returns:
        For each product which factor of every length, then of every angle, it takes; the constant product first.

    Example:
        >>> products(Space.parse("R1 T1"), 1, 1)
        [(0, 0), (0, 1), (0, 2), (1, 0)]
    """
    highest = [powers] * len(space.lengths) + [2] * len(space.angles)
    found = []
    for count in range(min(order, space.size) + 1):
        for chosen in itertools.combinations(range(space.size), count):
            for factors in itertools.product(*(range(1, highest[i] + 1) for i in chosen)):
                product = np.zeros(space.size, int)
                product[list(chosen)] = factors
                found.append(tuple(product.tolist()))
    lengths = len(space.lengths)
    return sorted(product for product in found if any(product[:lengths]) or not sliding)
