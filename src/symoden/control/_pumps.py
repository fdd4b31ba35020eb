"""Controllers that bring a system's energy to that of its target."""

from typing import Final, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, friction_matrix, gradient, potential
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, input_limits, saturate
from ._motion import terms
from ._scales import bandwidth, energy_range

_STEEP: Final = 0.03  # Share of the range of energies at which pumping begins to fade.
_SLOW: Final = 0.1  # Share of the natural speed at which it is full.
_KICK: Final = 0.02  # What starts it from rest, as a share of that speed.


@final
class EnergyPump(AbstractController):
    """Swings up a system of one angle: feeds friction back, and gives or takes energy until it is the target's.

        u = g⁻¹ D v + U tanh((E* − E)/ε) tanh(y/y₀)

    so that ½ (E − E*)² falls wherever the system moves. At rest in an equilibrium a small push starts it.

    Attributes:
        model: System or learned model.
        target: Configuration whose energy is wanted.
        energy: E*, the energy there.
        steepness: 1/ε.
        speed: Natural speed y₀/|g| at which pumping is full [rad/s].
        limits: Largest magnitude of the input, U.

    References:
        Åström & Furuta (2000), *Swinging up a pendulum by energy control*.
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    energy: Scalar
    steepness: Scalar
    speed: Scalar
    limits: Inputs

    @classmethod
    def of(cls, model: AbstractPortHamiltonian, target: Target, *, limits: Limits) -> "EnergyPump":
        """Choose scales from the learned energy.

        Args:
            model: System or learned model of one coordinate and one input.
            target: Configuration to swing up to.
            limits: Largest magnitude of the input.

        Returns:
            The controller.

        Raises:
            ValueError: If the model has more coordinates or inputs, or the limit is not finite.
        """
        goal, bounds = as_array(target), input_limits(limits, model.inputs)
        if model.space.size != 1 or model.inputs != 1 or not np.isfinite(bounds).all():
            raise ValueError(
                "Pumping energy into one coordinate needs one input with a finite limit; got "
                f"{model.space.size} coordinates, {model.inputs} inputs and limits {bounds.tolist()}."
            )
        return cls(
            model=model,
            target=goal,
            energy=potential(model, goal),
            steepness=as_array(1 / (_STEEP * energy_range(model, goal))),
            speed=as_array(_SLOW * bandwidth(model, goal)),
            limits=as_array(bounds),
        )

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """½ (E − E*)²/ε: how far the energy is from the target's."""
        del t
        return 0.5 * self._missing(q, v) ** 2 * self.steepness

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        g = self.model.input_matrix(q)
        friction = jnp.linalg.solve(g, friction_matrix(self.model, q, v) @ v)
        force = gradient(self.model, q)[0] * self.steepness
        still = _KICK * jnp.exp(-((v[0] / (_KICK * self.speed)) ** 2) - force**2)
        direction = jnp.sign(g[0]) * (v[0] / self.speed + still)
        pumping = jnp.tanh(self.steepness * self._missing(q, v)) * jnp.tanh(direction)
        return saturate(friction + self.limits * pumping, self.limits)

    def _missing(self, q: Coordinates, v: Velocities) -> Scalar:
        """E* − E."""
        return self.energy - 0.5 * v @ self.model.mass_matrix(q) @ v - potential(self.model, q)


@final
class CollocatedPump(AbstractController):
    """Swings up a system of two coordinates, one of them actuated, by moving the actuated one.

    With a the actuated coordinate, b the other one, and λ = (E* − E)/E_range + λ₀ the missing share of energy,

        q̈_a = k_p (α tanh(κ λ) tanh(v_b/ν) − e_a) − k_d v_a − k_e λ (M_ab/M_bb) v_b,

    made exact by partial feedback linearisation with the learned terms, friction included. The gains are searched on
    the model by simulation: see `searched`.

    Attributes:
        model: System or learned model.
        target: Configuration to swing up to.
        actuated: Index a.
        energy: E*, the energy of the target.
        energy_range: Difference of the highest and lowest potential energy.
        gains: α, κ, ν, k_p, k_d, k_e, λ₀.
        limits: Largest magnitude of the input.

    References:
        Spong (1995), *The swing up control problem for the acrobot*; Spong & Praly (1997), *Control of underactuated
        mechanical systems using switching and saturation*.
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    actuated: int = eqx.field(static=True)
    energy: Scalar
    energy_range: Scalar
    gains: Float[Array, "7"]
    limits: Inputs

    @classmethod
    def of(
        cls,
        model: AbstractPortHamiltonian,
        target: Target,
        *,
        limits: Limits,
        gains: Target | None = None,
    ) -> "CollocatedPump":
        """Make the controller with given gains, or with those to start a search from.

        Args:
            model: System or learned model of two coordinates and one input.
            target: Configuration to swing up to.
            limits: Largest magnitude of the input.
            gains: α, κ, ν, k_p, k_d, k_e, λ₀.

        Returns:
            The controller.

        Raises:
            ValueError: If the model has other numbers of coordinates or inputs.
        """
        if model.space.size != 2 or model.inputs != 1:
            raise ValueError(
                "This swing-up needs two coordinates and one input; the model has "
                f"{model.space.size} and {model.inputs}."
            )
        goal = as_array(target)
        omega = bandwidth(model, goal)
        first = np.array([0.3, 3.0, omega / 4, omega**2 / 2, omega, omega**2 / 2, 0.02])
        return cls(
            model=model,
            target=goal,
            actuated=actuated_coordinate(model, goal),
            energy=potential(model, goal),
            energy_range=as_array(energy_range(model, goal)),
            gains=as_array(first if gains is None else gains),
            limits=as_array(input_limits(limits, 1)),
        )

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """½ λ² E_range: how far the energy is from the wanted one."""
        del t
        energy = 0.5 * v @ self.model.mass_matrix(q) @ v + potential(self.model, q)
        return 0.5 * self._missing(energy) ** 2 * self.energy_range

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        a, b = self.actuated, 1 - self.actuated
        alpha, kappa, nu, k_p, k_d, k_e, _ = self.gains
        motion = terms(self.model, q, v)
        missing = self._missing(0.5 * v @ motion.M @ v + potential(self.model, q))
        reference = alpha * jnp.tanh(kappa * missing) * jnp.tanh(v[b] / nu)
        e = self.model.space.difference(q, self.target)
        lever = motion.M[a, b] / motion.M[b, b]
        wanted = k_p * (reference - e[a]) - k_d * v[a] - k_e * missing * lever * v[b]
        effect, drift = jnp.linalg.solve(motion.M, jnp.stack([motion.g[:, 0], motion.bias], axis=1))[a]
        return saturate((wanted + drift)[None] / effect, self.limits)

    def _missing(self, energy: Scalar) -> Scalar:
        """λ."""
        return (self.energy - energy) / self.energy_range + self.gains[6]


def actuated_coordinate(model: AbstractPortHamiltonian, target: Coordinates) -> int:
    """Coordinate on which the only input acts most.

    Args:
        model: System or model.
        target: Where to look.

    Returns:
        Its index.
    """
    return int(np.argmax(np.abs(np.asarray(model.input_matrix(target))[:, 0])))
