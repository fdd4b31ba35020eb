"""Equations of motion in velocities, as controllers need them: M v̇ + c(q, v) + ∇V + D v = g u."""

import math
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, friction_matrix, gradient
from symoden.shapes import Coordinates, InputMatrix, Inputs, SquareMatrix, Velocities

_STEP: Final = 0.01
_ROUNDING: Final = 1e-9


class Terms(NamedTuple):
    """What the equations of motion are made of at one state.

    Attributes:
        M: Mass matrix.
        coriolis: Ṁ v − ½ ∇(vᵀ M v).
        gradient: ∇V, of V(q) = H(q, 0).
        friction: D v.
        g: Input matrix.
    """

    M: SquareMatrix
    coriolis: Velocities
    gradient: Velocities
    friction: Velocities
    g: InputMatrix

    @property
    def bias(self) -> Velocities:
        """Forces without input, to the left of the equality sign."""
        return self.coriolis + self.gradient + self.friction


def terms(model: AbstractPortHamiltonian, q: Coordinates, v: Velocities) -> Terms:
    """Terms of the equations of motion.

    Args:
        model: System or model.
        q: Coordinates.
        v: Velocities.

    Returns:
        The terms.
    """
    M, M_dot = jax.jvp(model.mass_matrix, (q,), (v,))
    twice_kinetic = jax.grad(lambda q: v @ model.mass_matrix(q) @ v)(q)
    return Terms(
        M=M,
        coriolis=M_dot @ v - 0.5 * twice_kinetic,
        gradient=gradient(model, q),
        friction=friction_matrix(model, q, v) @ v,
        g=model.input_matrix(q),
    )


def velocity_field(
    dynamics: AbstractDynamics, q: Coordinates, v: Velocities, u: Inputs
) -> tuple[Velocities, Velocities]:
    """Rates of configuration and velocities of any dynamics, one without energy included.

    Args:
        dynamics: System or model.
        q: Coordinates.
        v: Velocities.
        u: Inputs.

    Returns:
        q̇ and v̇.
    """
    state = dynamics.encode(q, rates_of(dynamics, q, v))
    slope = dynamics.derivative(jnp.zeros((), q.dtype), state, u)
    _, (q_dot, v_dot) = jax.jvp(lambda state: velocities_of(dynamics, state), (state,), (slope,))
    return q_dot, v_dot


def state_rates(dynamics: AbstractDynamics, q: Coordinates, v: Velocities, u: Inputs) -> Float[Array, " s"]:
    """The same in a row.

    Args:
        dynamics: System or model.
        q: Coordinates.
        v: Velocities.
        u: Inputs.

    Returns:
        q̇, then v̇.
    """
    return jnp.concatenate(velocity_field(dynamics, q, v, u))


def jacobians(
    dynamics: AbstractDynamics, q: Coordinates, v: Velocities, u: Inputs
) -> tuple[Float[Array, "s s"], Float[Array, "s m"]]:
    """How the rates of (q, v) change with these and with the inputs.

    Args:
        dynamics: System or model.
        q: Coordinates.
        v: Velocities.
        u: Inputs.

    Returns:
        A and B of the linearised system.
    """
    by_q, by_v, by_u = jax.jacfwd(state_rates, argnums=(1, 2, 3))(dynamics, q, v, u)
    return jnp.concatenate([by_q, by_v], axis=1), by_u


def rates_of(dynamics: AbstractDynamics, q: Coordinates, v: Velocities) -> Velocities:
    """Rates as the dynamics' data have them: velocities, or momenta M(q) v.

    Args:
        dynamics: System or model.
        q: Coordinates.
        v: Velocities.

    Returns:
        The rates.

    Raises:
        ValueError: If they are momenta of a model that has no M to tell velocities by.
    """
    if not dynamics.momenta:
        return v
    return _of_momenta(dynamics).mass_matrix(q) @ v


def velocities_of(dynamics: AbstractDynamics, state: jax.Array) -> tuple[Coordinates, Velocities]:
    """Configuration and velocities of a state, of momentum data too.

    Args:
        dynamics: System or model.
        state: Its state.

    Returns:
        q and v.

    Raises:
        ValueError: If the state has momenta, of a model that has no M to tell velocities by.
    """
    q, rates = dynamics.decode(state)
    return q, _of_momenta(dynamics).inverse_mass_matrix(q) @ rates if dynamics.momenta else rates


def moved(
    dynamics: AbstractDynamics, q: Coordinates, v: Velocities, u: Inputs, seconds: float
) -> tuple[Coordinates, Velocities]:
    """Configuration and velocities after a while under a held input.

    Args:
        dynamics: System or model.
        q: Coordinates.
        v: Velocities.
        u: Inputs.
        seconds: For how long [s].

    Returns:
        q and v then.
    """
    if seconds == 0:
        return q, v
    solver = RK4(max(1, math.ceil(seconds / _STEP - _ROUNDING)), unroll=True)
    start, still = dynamics.encode(q, rates_of(dynamics, q, v)), jnp.zeros((), q.dtype)
    return velocities_of(dynamics, solver.step(dynamics.derivative, start, still, jnp.asarray(seconds, q.dtype), u, u))


def _of_momenta(dynamics: AbstractDynamics) -> AbstractPortHamiltonian:
    """Dynamics of momentum data, refused where they have no M."""
    if isinstance(dynamics, AbstractPortHamiltonian):
        return dynamics
    raise ValueError(
        f"A model of momenta must have an inertia, for controllers go by velocities; {type(dynamics).__name__} has "
        "none. Train it on velocities, or a kind with an energy."
    )
