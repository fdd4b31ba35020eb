"""The one interface of analytic and learned systems: energy, vector field, power balance, encode and decode."""

import abc
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from .shapes import (
    Coordinates,
    DissipationMatrix,
    InputMatrix,
    Inputs,
    Momenta,
    Observation,
    Rates,
    Scalar,
    SquareMatrix,
    State,
    Velocities,
)
from .spaces import Space


class AbstractDynamics(eqx.Module):
    """What can be rolled out: encode an observation into a state, differentiate it, decode it back.

    Attributes:
        space: Configuration space of the coordinates q.
        inputs: Number of inputs m.
        momenta: Whether the rates in the data are momenta p; otherwise they are velocities v.
    """

    space: eqx.AbstractVar[Space]
    inputs: eqx.AbstractVar[int]
    momenta: eqx.AbstractVar[bool]

    @abc.abstractmethod
    def encode(self, q: Coordinates, rates: Rates) -> State:
        """State of a measured configuration and its rates."""

    @abc.abstractmethod
    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """Time derivative of the state under the input `u` at time `t` [s], counted from a rollout's first sample."""

    @abc.abstractmethod
    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """Configuration and rates of a state."""

    @abc.abstractmethod
    def observe(self, state: State) -> Observation:
        """Embedded configuration (r, cos φ, sin φ), then the rates: what losses and metrics compare."""


def refuse_no_system(model: object) -> None:
    """Refuse anything but a system or a learned model, such as the name of its file.

    Args:
        model: What was given.

    Raises:
        TypeError: If it is none.
    """
    if not isinstance(model, AbstractDynamics):
        raise TypeError(
            f"`model` must be a system or a learned model; got {type(model).__name__}. `fit` has one as `.model`, "
            "`load` reads one from a file."
        )


class PowerBalance(NamedTuple):
    """Powers [W] at one state; `stored` = `supplied` − `dissipated` for every port-Hamiltonian system.

    Attributes:
        stored: Rate of the energy, Ḣ.
        supplied: Power through the port, yᵀu.
        dissipated: Power lost to friction, never negative.
    """

    stored: Scalar
    supplied: Scalar
    dissipated: Scalar


class AbstractPortHamiltonian(AbstractDynamics):
    """Input-state-output port-Hamiltonian system with state (q, p).

    With ∇H = (∂H/∂q, ∂H/∂p),

        (q̇, ṗ) = (J − R) ∇H + (0, g(q) u),   y = g(q)ᵀ ∂H/∂p,

    where R = diag(0, D) if D = `dissipation_matrix` is n × n (friction on momenta), and R = D if it is 2n × 2n.

    References:
        van der Schaft & Jeltsema (2014), *Port-Hamiltonian Systems Theory*, eq. (4.40).
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, eq. (7): the 2n × 2n form.
    """

    @abc.abstractmethod
    def hamiltonian(self, q: Coordinates, p: Momenta) -> Scalar:
        """Total energy H [J]."""

    @abc.abstractmethod
    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inertia M, symmetric positive definite; p = M v."""

    @abc.abstractmethod
    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse inertia M⁻¹, symmetric positive definite; v = M⁻¹ p."""

    @abc.abstractmethod
    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Map g from inputs to generalized forces."""

    @abc.abstractmethod
    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Friction D, symmetric positive semidefinite, n × n or 2n × 2n."""

    def vector_field(self, q: Coordinates, p: Momenta, u: Inputs) -> tuple[Velocities, Momenta]:
        """Right-hand side of the equations of motion.

        Args:
            q: Coordinates; lengths [m], angles [rad].
            p: Momenta [kg m/s or kg m²/s].
            u: Inputs, [N] or [N m] where g is known.

        Returns:
            q̇ and ṗ.
        """
        dH_dq, dH_dp = jax.grad(self.hamiltonian, argnums=(0, 1))(q, p)
        driven = self.input_matrix(q) @ u - dH_dq
        D = self.dissipation_matrix(q, dH_dp)
        if D.shape[0] == self.space.size:
            return dH_dp, driven - D @ dH_dp
        loss_q, loss_p = jnp.split(D @ jnp.concatenate([dH_dq, dH_dp]), 2)
        return dH_dp - loss_q, driven - loss_p

    def output(self, q: Coordinates, p: Momenta) -> Inputs:
        """Passive output y = gᵀ ∂H/∂p, conjugate to the input: yᵀu is the power supplied [W].

        Args:
            q: Coordinates.
            p: Momenta.

        Returns:
            Outputs, one for each input.
        """
        return self.input_matrix(q).T @ jax.grad(self.hamiltonian, argnums=1)(q, p)

    def power_balance(self, q: Coordinates, p: Momenta, u: Inputs) -> PowerBalance:
        """Where the energy goes at one state: Ḣ = yᵀu − (∇H)ᵀ R ∇H.

        Args:
            q: Coordinates.
            p: Momenta.
            u: Inputs.

        Returns:
            Stored, supplied and dissipated power; each is computed on its own, so that a test of their sum can fail.
        """
        _, stored = jax.jvp(self.hamiltonian, (q, p), self.vector_field(q, p, u))
        dH_dq, dH_dp = jax.grad(self.hamiltonian, argnums=(0, 1))(q, p)
        D = self.dissipation_matrix(q, dH_dp)
        effort = dH_dp if D.shape[0] == self.space.size else jnp.concatenate([dH_dq, dH_dp])
        return PowerBalance(stored=stored, supplied=self.output(q, p) @ u, dissipated=effort @ D @ effort)

    def encode(self, q: Coordinates, rates: Rates) -> State:
        """Stack (q, p), with p = M(q) v where the data are velocities."""
        return jnp.concatenate([q, rates if self.momenta else self.mass_matrix(q) @ rates])

    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """Stack (q̇, ṗ)."""
        del t
        q, p = jnp.split(state, 2)
        return jnp.concatenate(self.vector_field(q, p, u))

    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """Split the state into q and its rates: v = M⁻¹(q) p, or p itself where the data are momenta."""
        q, p = jnp.split(state, 2)
        return q, p if self.momenta else self.inverse_mass_matrix(q) @ p

    def observe(self, state: State) -> Observation:
        """Embedded configuration, then the rates."""
        q, rates = self.decode(state)
        return jnp.concatenate([self.space.embed(q), rates])


class AbstractMechanical(AbstractPortHamiltonian):
    """Port-Hamiltonian system with kinetic plus potential energy, H(q, p) = ½ pᵀ M⁻¹(q) p + V(q)."""

    @abc.abstractmethod
    def potential_energy(self, q: Coordinates) -> Scalar:
        """Potential energy V [J]."""

    def hamiltonian(self, q: Coordinates, p: Momenta) -> Scalar:
        """Kinetic plus potential energy [J]."""
        return 0.5 * p @ self.inverse_mass_matrix(q) @ p + self.potential_energy(q)


def potential(system: AbstractPortHamiltonian, q: Coordinates) -> Scalar:
    """Potential energy V(q) = H(q, 0), for models without a block of its own too.

    Args:
        system: Analytic system or learned model.
        q: Coordinates.

    Returns:
        The energy at rest.
    """
    return system.hamiltonian(q, jnp.zeros_like(q))


def gradient(system: AbstractPortHamiltonian, q: Coordinates) -> Velocities:
    """Force of the potential energy with its sign turned, ∇V.

    Args:
        system: Analytic system or learned model.
        q: Coordinates.

    Returns:
        The gradient.
    """
    return jax.grad(potential, argnums=1)(system, q)


def friction_matrix(system: AbstractPortHamiltonian, q: Coordinates, v: Velocities) -> SquareMatrix:
    """Friction on the momenta, n × n; of a full 2n × 2n D, that block.

    Args:
        system: Analytic system or learned model.
        q: Coordinates.
        v: Velocities.

    Returns:
        The matrix.
    """
    n = system.space.size
    return system.dissipation_matrix(q, v)[-n:, -n:]
