"""Port-Hamiltonian model with kinetic plus potential energy: the paper's dissipative SymODEN, and SymODEN without D."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.blocks import AbstractBlock, AbstractFriction
from symoden.mechanics import AbstractMechanical
from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space


@final
class StructuredModel(AbstractMechanical):
    """Learned H(q, p) = ½ pᵀ M⁻¹(q) p + V(q), input matrix g(q) and friction D(q, v).

    Attributes:
        space: Configuration space.
        inputs: Number of inputs.
        momenta: Whether the rates in the data are momenta.
        inverse_mass: Block of M⁻¹(q).
        potential: Block of V(q).
        actuation: Block of g(q).
        friction: D(q, v); `NoFriction` makes it the paper's SymODEN.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 3.
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    inverse_mass: AbstractBlock
    potential: AbstractBlock
    actuation: AbstractBlock
    friction: AbstractFriction

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Learned M⁻¹."""
        return self.inverse_mass(q)

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the learned M⁻¹."""
        return jnp.linalg.inv(self.inverse_mass(q))

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Learned V, known up to a constant."""
        return self.potential(q)

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Learned or given g."""
        return self.actuation(q)

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Learned D."""
        return self.friction(q, v)
