"""Energy shaping and damping injection for fully actuated systems."""

import math
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.mechanics import AbstractPortHamiltonian, gradient
from symoden.shapes import Coordinates, Inputs, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, check_positive, input_limits, saturate
from ._judge import Tolerance
from ._scales import bandwidth, configurations, slow_friction, static_load

_COMPENSATED = 0.5  # A friction learned twice too large is not made up for more than wholly.
_SHARE = 0.5  # of what the limits leave beside the static load; the rest is for damping.
_BRISK = 0.25  # of it acts 1 rad or 1 m from the target, at least: where V is flat, it has no rate.
_SAMPLED = 0.25  # Largest ω times the control period, as damping 2ωM, held for a period, must not push.


@final
class EnergyShaping(AbstractController):
    """Replaces the potential energy by one with its minimum at the target, and adds damping.

    With y = gᵀ v the passive output and e the way from the target to q, angles the short way round,

        u = g⁻¹ (∇V(q) − ∇V_d(q)) − s √w K y + c κ g⁻¹ D v,   V_d = s_e / (1 + √(1 + s_e/δ²)),   s_e = eᵀ K_p e,

    so that H_d = ½ vᵀ M v + V_d falls: Ḣ_d = −(1 − c κ) vᵀ D v − s √w yᵀ K y. Dry friction would make the way to the
    target a creep; the input makes up for κ of it, and less than all, since it is known but roughly. (A D of 2n × 2n
    takes energy out of more than the momenta: it is not made up for.)

    V_d is ½ eᵀ K_p e near the target and grows linearly far from it: δ is such that g⁻¹ ∇V_d needs half of what the
    limits leave beside the static load; where the force of V_d is w times the linear one, √w keeps the damping ratio.
    The factors s(q, v) and then c(q, v) ∈ [0, 1] are the largest with which inputs stay within the limits, so that
    Ḣ_d ≤ 0 holds under limits too.

    Attributes:
        model: System or learned model.
        target: Configuration to go to.
        stiffness: K_p, diagonal so that V_d is continuous where an angle's short way changes sides.
        damping: K, symmetric positive definite.
        curving: 1/δ²; zero without limits.
        compensation: κ.
        limits: Largest magnitude of each input.

    References:
        Takegaki & Arimoto (1981), *A new feedback method for dynamic control of manipulators*.
        van der Schaft & Jeltsema (2014), *Port-Hamiltonian Systems Theory*, section 15.1.

    Example:
        >>> from symoden.systems import Pendulum
        >>> controller = EnergyShaping.of(Pendulum(), jnp.array([jnp.pi]), limits=15.0)
        >>> abs(float(controller(jnp.array([jnp.pi]), jnp.zeros(1))[0])) < 1e-9
        True
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    stiffness: Coordinates
    damping: SquareMatrix
    curving: Scalar
    compensation: Scalar
    limits: Inputs

    @classmethod
    def of(
        cls,
        model: AbstractPortHamiltonian,
        target: Target,
        *,
        frequency: float | None = None,
        damping_ratio: float = 1.0,
        compensation: float = _COMPENSATED,
        limits: Limits = None,
        period: float | None = None,
    ) -> "EnergyShaping":
        """Choose gains from the inertia at the target: K_p = ω² diag M, damping 2 ζ ω M.

        Without `frequency`, ω is the fastest rate of the potential energy there; or, where that is slow beside what the
        inputs can do, the one for which 1 rad or 1 m takes a quarter of what the limits leave; and at least such that
        at the edge of the tolerance V_d overcomes each coordinate's friction at the tolerance's speed (`Tolerance`):
        dry friction would hold it farther away.

        Args:
            model: System or learned model with as many inputs as coordinates.
            target: Configuration to go to.
            frequency: ω [rad/s].
            damping_ratio: ζ.
            compensation: κ, the share of the friction to make up for, from 0 to 1.
            limits: Largest magnitude of the inputs; None for none.
            period: Control period [s], which bounds the rates that limits and friction ask for; None for none.

        Returns:
            The controller.

        Raises:
            ValueError: If the model is not fully actuated, the limits cannot hold its weight everywhere, the
                compensation is no share, or the frequency or the damping ratio is not positive.
        """
        check_positive(frequency=frequency, damping_ratio=damping_ratio)
        if not 0 <= compensation <= 1:
            raise ValueError(f"The compensation of friction must be between 0 and 1; got {compensation}.")
        n = model.space.size
        if model.inputs != n:
            raise ValueError(
                f"Energy shaping needs an input for each of the {n} coordinates; the model has {model.inputs}. "
                "Use swing-up, IDA-PBC or a controlled Lagrangian."
            )
        goal = as_array(target)
        bounds = input_limits(limits, n)
        room = bounds - static_load(model, goal)
        if not np.all(room > 0):
            raise ValueError(
                f"The limits {bounds.tolist()} must exceed the static load {(bounds - room).round(3).tolist()} for the "
                "potential energy to be shaped. Allow more, or use swing-up."
            )
        M, inverse = np.asarray(model.mass_matrix(goal)), np.linalg.inv(np.asarray(model.input_matrix(goal)))
        inverses = np.linalg.inv(np.asarray(jax.vmap(model.input_matrix)(configurations(model, goal))))
        if frequency is None:
            accelerations = room / (np.abs(inverses) * np.diag(M)).max(axis=(0, 2))
            frequency = _rate(model, goal, float(accelerations.min()), period)
        stiffness = frequency**2 * np.diag(M)
        steepness = np.sqrt(np.einsum("kij,j,kij->ki", inverses, stiffness, inverses).max(axis=0))
        delta = np.min(_SHARE * room / steepness)
        return cls(
            model=model,
            target=goal,
            stiffness=as_array(stiffness),
            damping=as_array(2 * damping_ratio * frequency * inverse @ M @ inverse.T),
            curving=as_array(0.0 if math.isinf(delta) else delta**-2),
            compensation=as_array(compensation),
            limits=as_array(bounds),
        )

    def desired_potential(self, q: Coordinates) -> Scalar:
        """Desired potential energy V_d, zero at the target.

        Args:
            q: Coordinates.

        Returns:
            The energy, in the model's unit.
        """
        e = self.model.space.difference(q, self.target)
        square = e @ (self.stiffness * e)
        return square / (1 + jnp.sqrt(1 + self.curving * square))

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """H_d = ½ vᵀ M v + V_d."""
        del t
        return 0.5 * v @ self.model.mass_matrix(q) @ v + self.desired_potential(q)

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        g = self.model.input_matrix(q)
        forces = gradient(self.model, q) - jax.grad(self.desired_potential)(q)
        shaping = saturate(jnp.linalg.solve(g, forces), self.limits)
        braking = -(self._softness(q) ** 0.5) * self.damping @ (g.T @ v)
        u = shaping + fitting(shaping, braking, self.limits)
        D = self.model.dissipation_matrix(q, v)
        if D.shape[0] == self.model.space.size:
            u = u + fitting(u, self.compensation * jnp.linalg.solve(g, D @ v), self.limits)
        return saturate(u, self.limits)

    def _softness(self, q: Coordinates) -> Scalar:
        """Force of V_d beside that of ½ eᵀ K_p e; its root keeps the damping ratio far from the target."""
        e = self.model.space.difference(q, self.target)
        return 1 / jnp.sqrt(1 + self.curving * (e @ (self.stiffness * e)))


def _rate(model: AbstractPortHamiltonian, goal: Coordinates, acceleration: float, period: float | None) -> float:
    """ω: the fastest rate that V, the acceleration which limits leave, or a coordinate's friction asks for."""
    there = Tolerance()
    friction = np.asarray(eqx.filter_jit(slow_friction)(model, goal, as_array(there.velocity)))
    asked = float(np.sqrt(friction / there.position / np.diag(np.asarray(model.mass_matrix(goal)))).max())
    if math.isfinite(acceleration):
        asked = max(asked, math.sqrt(_BRISK * acceleration))
    return max(bandwidth(model, goal), asked if period is None else min(asked, _SAMPLED / period))


def fitting(u: Inputs, extra: Inputs, limits: Inputs) -> Inputs:
    """Largest part of `extra`, direction kept, that may be added to `u`: what damps goes on damping.

    Args:
        u: Inputs within the limits.
        extra: Inputs to add.
        limits: Largest magnitudes.

    Returns:
        `extra` times a factor in [0, 1].
    """
    room = limits - jnp.sign(extra) * u
    needed = jnp.abs(extra)
    shares = jnp.where(needed > room, room / jnp.where(needed > room, needed, 1.0), 1.0)
    return jnp.min(shares) * extra
