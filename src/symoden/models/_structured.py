"""Port-Hamiltonian model with kinetic plus potential energy: the paper's dissipative SymODEN, and SymODEN without D."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.blocks import AbstractBlock, AbstractFriction, InverseBlock, Parameters, with_parameters
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
        parameters: Learned parameters that given formulas in the blocks share; None without any.

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
    parameters: Parameters | None = None

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Learned M⁻¹, or the inverse of the given M."""
        return with_parameters(self.inverse_mass, self.parameters)(q)

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the learned M⁻¹, or the given M."""
        block = with_parameters(self.inverse_mass, self.parameters)
        return block.matrix(q) if isinstance(block, InverseBlock) else jnp.linalg.inv(block(q))

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Learned V, known up to a constant, or the given one."""
        return with_parameters(self.potential, self.parameters)(q)

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Learned or given g."""
        return with_parameters(self.actuation, self.parameters)(q)

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Learned or given D."""
        return with_parameters(self.friction, self.parameters)(q, v)
