"""What the analytic systems have in common beside their energy: places in a vertical plane."""

import abc
from collections.abc import Sequence
from typing import TypeAlias

import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.mechanics import AbstractMechanical
from symoden.shapes import Coordinates

from ._parameters import Parameter

Points: TypeAlias = Float[Array, "k 2"]


class AbstractPlanarMechanism(AbstractMechanical):
    """Mechanism in a vertical plane whose joints have known places: what pictures need beside the energy."""

    @abc.abstractmethod
    def points(self, q: Coordinates) -> Points:
        """Places (horizontal, upward) of the first hinge, the joints after it and the last link's tip [m]."""


def hanging_chain(lengths: Sequence[Parameter], q: Coordinates) -> Points:
    """Places of the joints and the tip of links below a hinge at the origin.

    Args:
        lengths: Lengths of the links [m].
        q: The first link's angle from the downward vertical, each other's from the link before it [rad].

    Returns:
        One place more than there are links.
    """
    angles = jnp.cumsum(q)
    links = jnp.asarray(lengths, q.dtype)[:, None] * jnp.stack([jnp.sin(angles), -jnp.cos(angles)], axis=1)
    return jnp.concatenate([jnp.zeros((1, 2), q.dtype), jnp.cumsum(links, axis=0)])
