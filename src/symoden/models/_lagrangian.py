"""Equations of motion from M instead of M⁻¹: half the price, and derivatives at a third."""

from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar, cast, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.blocks import InverseBlock, forces, momenta, with_parameters
from symoden.mechanics import AbstractDynamics
from symoden.shapes import (
    Coordinates,
    Inputs,
    Momenta,
    Observation,
    Rates,
    Scalar,
    SquareMatrix,
    State,
    Velocities,
)
from symoden.spaces import Space

from ._structured import StructuredModel, traced_once

_MANY: Final = 3  # Coordinates.
_Dynamics = TypeVar("_Dynamics", bound=AbstractDynamics)


class Tangent(NamedTuple):
    """What the derivative of the equations of motion by the parameters takes from that by the state.

    Attributes:
        v: Velocities.
        inverse: M⁻¹.
        by_v: Derivative of the forces by the velocities.
    """

    v: Velocities
    inverse: SquareMatrix
    by_v: SquareMatrix


@final
class Lagrangian(AbstractDynamics):
    """The dynamics of a structured model whose M is what is learned, by Lagrange's equations.

    With p = M(q) v and F(q, v, u) = ∂/∂q (½ vᵀ M v − V) + g u − D v, they are q̇ = v and ṗ = F, the same as from the
    gradient of H. But M⁻¹ is not differentiated, and ∂F/∂v is the transpose of ∂(M v)/∂q but for friction.

    Attributes:
        space: That of the model.
        inputs: Their number.
        momenta: As of the model.
        model: The model.
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    model: StructuredModel

    @classmethod
    def of(cls, model: StructuredModel) -> "Lagrangian":
        """Wrap a model.

        Args:
            model: Model; its M⁻¹ is the inverse of a block.

        Returns:
            Its dynamics.
        """
        return cls(model.space, model.inputs, model.momenta, model)

    def encode(self, q: Coordinates, rates: Rates) -> State:
        """As the model does."""
        return self.model.encode(q, rates)

    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """As the model does."""
        return self.model.decode(state)

    def observe(self, state: State) -> Observation:
        """As the model does."""
        return self.model.observe(state)

    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """Stack (q̇, ṗ)."""
        del t
        q, p = jnp.split(state, 2)
        v = self.model.inverse_mass_matrix(q) @ p
        return jnp.concatenate([v, self.forces(q, v, u)[1]])

    @traced_once
    def forces(self, q: Coordinates, v: Velocities, u: Inputs) -> tuple[Momenta, Momenta]:
        """Momenta M v and forces F."""
        mass, potential = (
            with_parameters(block, self.model.parameters) for block in (self.model.inverse_mass, self.model.potential)
        )
        if not isinstance(mass, InverseBlock):
            raise TypeError("A Lagrangian must have an M of its own; `lagrangian` looks for it.")
        p, slope = momenta(mass.matrix, q, v)
        return p, slope + forces(potential, q) + self.model.input_matrix(q) @ u - self._friction(q, v)

    def linearize(self, state: State, u: Inputs) -> tuple[Float[Array, "s s"], Tangent]:
        """Derivative of (q̇, ṗ) by the state.

        Args:
            state: State.
            u: Inputs.

        Returns:
            The derivative, and what `pull_back` needs of it.
        """
        q, p = jnp.split(state, 2)
        inverse = self.model.inverse_mass_matrix(q)
        v = inverse @ p
        p_by_q, by_q = jax.jacfwd(lambda q: self.forces(q, v, u))(q)
        by_v = p_by_q.T - jax.jacfwd(lambda v: self._friction(q, v))(v)
        v_by_q = -inverse @ p_by_q
        by_state = jnp.block([[v_by_q, inverse], [by_q + by_v @ v_by_q, by_v @ inverse]])
        return by_state, Tangent(v, inverse, by_v)

    def _friction(self, q: Coordinates, v: Velocities) -> Momenta:
        """D v."""
        return self.model.dissipation_matrix(q, v) @ v


def lagrangian(dynamics: _Dynamics) -> _Dynamics | Lagrangian:
    """The same dynamics by Lagrange's equations, if that takes less time.

    Args:
        dynamics: Any.

    Returns:
        Those of a structured model that learns M, with friction on the momenta, so; any others as they are, and those
        of few coordinates, of which it gains less than it takes longer to compile (`benchmarks/`).
    """
    if not isinstance(dynamics, StructuredModel) or not isinstance(dynamics.inverse_mass, InverseBlock):
        return dynamics
    if dynamics.space.size < _MANY:
        return dynamics
    numbers = jax.tree.leaves(eqx.filter(dynamics, eqx.is_inexact_array))
    still = jax.ShapeDtypeStruct((dynamics.space.size,), jnp.result_type(*numbers) if numbers else float)
    friction = eqx.filter_eval_shape(lambda q: dynamics.dissipation_matrix(q, q), still)
    return Lagrangian.of(dynamics) if friction.shape[0] == dynamics.space.size else dynamics


def pull_back(
    restore: Callable[[Float[Array, " P"]], Lagrangian],
    theta: Float[Array, " P"],
    states: Float[Array, "k s"],
    us: Float[Array, "k m"],
    tangents: Tangent,
    weights: Float[Array, "k r s"],
) -> Float[Array, "r P"]:
    """Σ Wᵢ ∂(q̇, ṗ)ᵢ/∂θ over states.

    A row (a, b) of W gives a ∂v/∂θ + b (∂F/∂θ + ∂F/∂v ∂v/∂θ), where ∂v/∂θ = −M⁻¹ ∂(M v)/∂θ with v as it is.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters θ.
        states: The states.
        us: Inputs at each.
        tangents: What `linearize` found there.
        weights: The matrices W.

    Returns:
        The sum.
    """
    n = tangents.v.shape[1]
    on_v, on_p = weights[:, :, :n], weights[:, :, n:]
    on_momenta = -(on_v + on_p @ tangents.by_v) @ tangents.inverse

    def both(theta: Float[Array, " P"]) -> tuple[Float[Array, "k n"], Float[Array, "k n"]]:
        return jax.vmap(restore(theta).forces)(states[:, :n], tangents.v, us)

    _, pull = jax.vjp(both, theta)
    return cast("Array", jax.vmap(pull, in_axes=1)((on_momenta, on_p))[0])
