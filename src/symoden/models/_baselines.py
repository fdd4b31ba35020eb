"""The paper's two baselines: networks for the flow, without energy."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.blocks import AbstractBlock, Known, Perceptron
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, Observation, Rates, Scalar, State
from symoden.spaces import Space


@final
class NaiveModel(AbstractDynamics):
    """One network (x, u) → ẋ whose state x = (r, cos φ, sin φ, rates) is the observation itself.

    Nothing keeps an angle on its circle; `decode` takes the angle of the nearest point of the circle.

    Attributes:
        space: Configuration space.
        inputs: Number of inputs.
        momenta: Whether the rates in the data are momenta.
        flow: Network of (x, u).
        scale: Units of ẋ.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 4: "Naive Baseline".
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    flow: Perceptron
    scale: Known

    def encode(self, q: Coordinates, rates: Rates) -> State:
        """Embed the configuration and append the rates."""
        return jnp.concatenate([self.space.embed(q), rates])

    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """Learned ẋ."""
        del t
        return self.scale.value * self.flow(jnp.concatenate([state, u]))

    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """Nearest configuration, in the principal chart, and rates."""
        embedding, rates = jnp.split(state, [self.space.embedded_size])
        return self.space.project(embedding), rates

    def observe(self, state: State) -> Observation:
        """The state itself."""
        return state


@final
class GeometricModel(AbstractDynamics):
    """One network (embedded q, p, u) → (q̇, ṗ), so that angles stay angles; M⁻¹(q) turns velocities into momenta.

    Attributes:
        space: Configuration space.
        inputs: Number of inputs.
        momenta: Whether the rates in the data are momenta.
        flow: Network of (embedded q, p, u).
        scale: Units of (q̇, ṗ).
        inverse_mass: Block of M⁻¹(q).

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 4: "Geometric Baseline".
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    flow: Perceptron
    scale: Known
    inverse_mass: AbstractBlock

    def encode(self, q: Coordinates, rates: Rates) -> State:
        """Stack (q, p), with p = M(q) v where the data are velocities."""
        return jnp.concatenate([q, rates if self.momenta else jnp.linalg.solve(self.inverse_mass(q), rates)])

    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """Learned (q̇, ṗ)."""
        del t
        q, p = jnp.split(state, 2)
        return self.scale.value * self.flow(jnp.concatenate([self.space.embed(q), p, u]))

    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """Split the state into q and its rates."""
        q, p = jnp.split(state, 2)
        return q, p if self.momenta else self.inverse_mass(q) @ p

    def observe(self, state: State) -> Observation:
        """Embedded configuration, then the rates."""
        q, rates = self.decode(state)
        return jnp.concatenate([self.space.embed(q), rates])
