"""One controller far from the target, a regulator near it."""

from typing import final

import jax.numpy as jnp

from symoden.shapes import Coordinates, Flag, Inputs, Scalar, Velocities
from symoden.spaces import Space

from ._controller import AbstractController
from ._regulator import Regulator


@final
class Handover(AbstractController):
    """Regulator where its cost to go is below a level, another controller elsewhere; without memory.

    Attributes:
        far: What brings the system near its target.
        near: What holds it there.
        level: Cost to go below which the regulator acts, such as `attraction` finds it.
        limits: Largest magnitude of each input.
    """

    far: AbstractController
    near: Regulator
    level: Scalar
    limits: Inputs

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.near.space

    def handed_over(self, q: Coordinates, v: Velocities) -> Flag:
        """Whether the regulator acts.

        Args:
            q: Coordinates.
            v: Velocities.

        Returns:
            Whether the cost to go is below the level.
        """
        return self.near.desired_energy(q, v) < self.level

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """That of the controller which acts; it may jump where control is handed over."""
        return jnp.where(self.handed_over(q, v), self.near.desired_energy(q, v), self.far.desired_energy(q, v, t))

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        return jnp.where(self.handed_over(q, v), self.near(q, v), self.far(q, v, t))
