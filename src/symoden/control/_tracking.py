"""Trajectory tracking for fully actuated systems by passivity-based computed torque."""

from collections.abc import Callable
from typing import TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.mechanics import AbstractPortHamiltonian, friction_matrix, gradient
from symoden.shapes import Coordinates, Inputs, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, as_array, check_positive, input_limits, saturate
from ._motion import terms
from ._scales import bandwidth

Reference: TypeAlias = Callable[[Scalar], Coordinates]
"""Motion to follow: coordinates as a function of time [s], written in JAX."""


@final
class Tracking(AbstractController):
    """Follows a reference q_d(t), whose derivatives are taken automatically.

    With e = q − q_d the short way round, v_r = q̇_d − Λ e and s = v − v_r,

        g u = M v̇_r + C(q, v) v_r + ∇V + D v_r − K s,

    so that H_d = ½ sᵀ M s + eᵀ Λ K e falls: Ḣ_d = −sᵀ D s − ėᵀ K ė − eᵀ Λ K Λ e, for diagonal Λ and K. C is that of
    Christoffel's symbols, with which Ṁ − 2 C is skew.

    Attributes:
        model: System or learned model.
        reference: q_d(t), written in JAX.
        rate: λ, with Λ = λ 1 [1/s].
        damping: Diagonal of K.
        limits: Largest magnitude of each input.

    References:
        Slotine & Li (1987), *On the adaptive control of robot manipulators*.
        Ortega & Spong (1989), *Adaptive motion control of rigid robots: a tutorial*.
    """

    model: AbstractPortHamiltonian
    reference: Reference = eqx.field(static=True)
    rate: Scalar
    damping: Velocities
    limits: Inputs

    @classmethod
    def of(
        cls,
        model: AbstractPortHamiltonian,
        reference: Reference,
        *,
        frequency: float | None = None,
        limits: Limits = None,
    ) -> "Tracking":
        """Choose gains from the inertia at the start of the reference: Λ = ω, K = ω diag M.

        Args:
            model: System or learned model with as many inputs as coordinates.
            reference: q_d(t), written in JAX.
            frequency: ω [rad/s]; the fastest of the potential energy there if absent.
            limits: Largest magnitude of the inputs; None for none.

        Returns:
            The controller.

        Raises:
            ValueError: If the model is not fully actuated, or the frequency is not positive.
        """
        check_positive(frequency=frequency)
        n = model.space.size
        if model.inputs != n:
            raise ValueError(
                f"Tracking needs an input for each of the {n} coordinates; the model has {model.inputs}. "
                "Only fully actuated systems follow any reference."
            )
        start = reference(as_array(0.0))
        omega = bandwidth(model, start) if frequency is None else frequency
        return cls(
            model=model,
            reference=reference,
            rate=as_array(omega),
            damping=as_array(omega * np.diag(np.asarray(model.mass_matrix(start)))),
            limits=as_array(input_limits(limits, n)),
        )

    def wanted(self, t: Scalar) -> tuple[Coordinates, Velocities, Velocities]:
        """Reference at a time.

        Args:
            t: Time [s].

        Returns:
            q_d and its first two derivatives.
        """

        def velocity(t: Scalar) -> Velocities:
            return jax.jvp(self.reference, (t,), (jnp.ones_like(t),))[1]

        rate, acceleration = jax.jvp(velocity, (t,), (jnp.ones_like(t),))
        return self.reference(t), rate, acceleration

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """H_d = ½ sᵀ M s + eᵀ Λ K e, of the error."""
        goal, goal_rate, _ = self.wanted(jnp.zeros((), q.dtype) if t is None else t)
        e = self.model.space.difference(q, goal)
        s = v - goal_rate + self.rate * e
        return 0.5 * s @ self.model.mass_matrix(q) @ s + self.rate * e @ (self.damping * e)

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        goal, goal_rate, goal_acceleration = self.wanted(jnp.zeros((), q.dtype) if t is None else t)
        e = self.model.space.difference(q, goal)
        wanted_v = goal_rate - self.rate * e
        wanted_a = goal_acceleration - self.rate * (v - goal_rate)
        motion = terms(self.model, q, v)
        D = friction_matrix(self.model, q, v)
        forces = motion.M @ wanted_a + _coriolis(self.model, q, v) @ wanted_v + gradient(self.model, q)
        forces = forces + D @ wanted_v - self.damping * (v - wanted_v)
        return saturate(jnp.linalg.solve(motion.g, forces), self.limits)


def _coriolis(model: AbstractPortHamiltonian, q: Coordinates, v: Velocities) -> SquareMatrix:
    """C(q, v) by Christoffel's symbols of the first kind."""
    by_q = jax.jacfwd(model.mass_matrix)(q)  # ∂M_ij/∂q_k at [i, j, k]
    gamma = 0.5 * (by_q + jnp.swapaxes(by_q, 1, 2) - jnp.transpose(by_q, (2, 1, 0)))
    return jnp.einsum("ijk,k->ij", gamma, v)
