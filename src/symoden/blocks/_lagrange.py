"""What Lagrange's equations need of M and V, without differentiating what can be written down."""

import jax

from symoden.shapes import Coordinates, Momenta, Velocities

from ._fields import AbstractBlock
from ._links import LinksBlock


def momenta(mass: AbstractBlock, q: Coordinates, v: Velocities) -> tuple[Momenta, Momenta]:
    """M v, and the slope of ½ vᵀ M(q) v along the coordinates where the velocities stay.

    Args:
        mass: Block of M.
        q: Configuration.
        v: Velocities.

    Returns:
        Both.
    """
    if isinstance(mass, LinksBlock) and mass.links is not None:
        p, slope = mass.links.momenta(q, v)
        return mass.unit.value * p, mass.unit.value * slope
    # A vector for reverse mode, for M is wide where v is short.
    p, pull_back = jax.vjp(lambda q: mass(q) @ v, q)
    return p, pull_back(v / 2)[0]


def forces(potential: AbstractBlock, q: Coordinates) -> Momenta:
    """−∂V/∂q.

    Args:
        potential: Block of V.
        q: Configuration.

    Returns:
        The forces.
    """
    if isinstance(potential, LinksBlock) and potential.links is not None:
        return potential.unit.value * potential.links.weights(q)
    return -jax.grad(potential)(q)
