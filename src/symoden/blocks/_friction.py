"""Friction: dissipation matrices of configuration and velocity, passive by construction."""

import abc
from collections.abc import Callable
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates, DissipationMatrix, Velocities

from ._fields import AbstractBlock
from ._functions import AbstractFunction
from ._known import Known
from ._triangles import lower_triangle

ODD_SHAPES = 2
"""Number of coefficients of each joint's friction that depend on the direction."""

_ROUNDED = 1e-6  # The ε that rounds a joint's law off at zero; ε/2 of it remains where there is no such friction.


class AbstractFriction(eqx.Module):
    """Dissipation matrix as a function of configuration and velocity, positive semidefinite by construction."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""


@final
class ViscousFriction(AbstractFriction):
    """Friction D(q) that does not depend on the velocity; n × n on the momenta, or the paper's full 2n × 2n.

    Attributes:
        matrix: The block D(q).
    """

    matrix: AbstractBlock

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q`, whatever `v` is."""
        del v
        return self.matrix(q)


@final
class JointFriction(AbstractFriction):
    """Friction D(q, v) = S (B(q) B(q)ᵀ + diag ℓ(v)) S of viscous, dry and quadratic parts, passive by construction.

    The lower triangle B may depend on the configuration; ℓ is each joint's own law. With w = vᵢ / `speed`ᵢ it is
    ℓᵢ = ½ (x + √(x² + ε²)), x = Σₖ cᵢₖ ψₖ(w): close to x where x is positive and never negative. The shape
    ψₖ = (1 + (w/wₖ)²)^(−½) is dry (Coulomb) friction smoothed below the speed wₖ, (1 + (w/wₖ)²)^(−1) its excess at low
    speed (Stribeck), and √(1 + w²) − 1 quadratic drag. Dry and viscous friction simply add up, as on real joints; as
    squares of one sum they did not, and on a measured arm the errors over a second were a third larger.

    Gears and seals brake more in one direction than in the other. `directions` adds two odd shapes to x: that of dry
    friction, (w/w₁)/(1 + (w/w₁)²) at the least knee w₁, whose force is the same in both directions, as that of a torque
    that is off by a constant, and that of viscous friction, w/√(1 + w²). They brake less, but never push.

    Attributes:
        viscous: Entries of the lower triangle B(q), row by row.
        laws: The cᵢₖ, joint by joint, of either sign.
        directions: The coefficients of the odd shapes, joint by joint; none where friction has no direction.
        scale: Diagonal of S: square roots of the physical units.
        speed: Typical speed of each joint.
        knees: The wₖ.
        open: Derivatives are those of the x, also where x is below zero: there those of ℓ say that no coefficient
            matters, whatever x may rise to.

    References:
        Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), *A survey of models, analysis tools and compensation
        methods for the control of machines with friction*, Automatica 30(7), for the shapes of dry friction.
    """

    viscous: AbstractFunction
    laws: AbstractFunction
    scale: Known
    speed: Known
    knees: tuple[float, ...] = eqx.field(static=True)
    directions: AbstractFunction | None = None
    open: bool = eqx.field(static=True, default=False)

    @staticmethod
    def shapes(knees: tuple[float, ...]) -> int:
        """Number of coefficients of each joint's law."""
        return 2 * len(knees) + 1

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""
        w = v / self.speed.value
        knee = 1 + (w[:, None] / jnp.asarray(self.knees, w.dtype)[None]) ** 2
        bend = jnp.sqrt(1 + w**2)
        shapes = jnp.concatenate([knee**-0.5, 1 / knee, (bend - 1)[:, None]], axis=1)
        x = jnp.sum(self.laws(q).reshape(shapes.shape) * shapes, axis=1)
        if self.directions is not None:
            odd = self._odd(w)
            x = x + jnp.sum(self.directions(q).reshape(odd.shape) * odd, axis=1)
        joint = (x + jnp.sqrt(x**2 + _ROUNDED**2)) / 2
        if self.open:
            joint = x + jax.lax.stop_gradient(joint - x)
        scale = self.scale.value
        factor = scale[:, None] * lower_triangle(self.viscous(q), size=w.shape[0])
        return factor @ factor.T + jnp.diag(joint * scale**2)

    def _odd(self, w: Velocities) -> Float[Array, "n 2"]:
        """The shapes that depend on the direction, at velocities relative to the typical ones."""
        least = min(self.knees)
        return jnp.stack([w / least / (1 + (w / least) ** 2), w / jnp.sqrt(1 + w**2)], axis=1)

    def whole_directions(self, q: Coordinates) -> Float[Array, " 2*n"]:
        """Coefficients that each make an odd shape as large as the whole friction is at the typical speed.

        Args:
            q: Configuration.

        Returns:
            The coefficients, joint by joint.
        """
        size = jnp.diag(self(q, self.speed.value)) / self.scale.value**2
        return (size[:, None] / self._odd(jnp.ones_like(size))).ravel()


@final
class KnownFriction(AbstractFriction):
    """A given function of configuration and velocity.

    Attributes:
        function: Maps (q, v) to D in physical units. It is code, hence not saved with a model.
    """

    function: Callable[[Coordinates, Velocities], DissipationMatrix] = eqx.field(static=True)

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""
        return jnp.asarray(self.function(q, v)).astype(q.dtype)  # It may be a constant of another precision.


@final
class NoFriction(AbstractFriction):
    """The zero matrix of a conservative system."""

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Zero matrix of the size of `q`."""
        del v
        return jnp.zeros((q.shape[0], q.shape[0]), q.dtype)
