"""Port-Hamiltonian model with one network for the whole energy: the paper's unstructured dissipative SymODEN."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp

from symoden.blocks import AbstractBlock, AbstractFriction, Known, Perceptron
from symoden.mechanics import AbstractPortHamiltonian
from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Momenta, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space


@final
class UnstructuredModel(AbstractPortHamiltonian):
    """Learned H(q, p) without the form of kinetic plus potential energy; g and D as in the structured model.

    Attributes:
        space: Configuration space.
        inputs: Number of inputs.
        momenta: Whether the rates in the data are momenta.
        energy: Network of (embedded q, p).
        energy_scale: Unit of the network's output.
        inverse_mass: Block of the M⁻¹(q) that turns velocities into momenta; None where the data are momenta, and
            the inertia is then read off H as ∂²H/∂p² at p = 0.
        actuation: Block of g(q).
        friction: D(q, v).

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 4: "Unstructured Dissipative SymODEN".
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    energy: Perceptron
    energy_scale: Known
    inverse_mass: AbstractBlock | None
    actuation: AbstractBlock
    friction: AbstractFriction

    def __check_init__(self) -> None:
        """Refuse velocity data without an inertia.

        Raises:
            ValueError: If neither the data nor a block give the momenta.
        """
        if self.inverse_mass is None and not self.momenta:
            raise ValueError("Velocity data need `inverse_mass` to turn them into momenta; got None. Give its block.")

    def hamiltonian(self, q: Coordinates, p: Momenta) -> Scalar:
        """Learned H."""
        return self.energy_scale.value * self.energy(jnp.concatenate([self.space.embed(q), p]))[0]

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Learned M⁻¹, or the Hessian of H in p at rest (symmetric; positive only if learned so)."""
        if self.inverse_mass is None:
            return jax.hessian(self.hamiltonian, argnums=1)(q, jnp.zeros_like(q))
        return self.inverse_mass(q)

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of M⁻¹."""
        return jnp.linalg.inv(self.inverse_mass_matrix(q))

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Learned or given g."""
        return self.actuation(q)

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Learned D."""
        return self.friction(q, v)
