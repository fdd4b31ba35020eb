"""Controllers that bring a system's energy to that of its target."""

from typing import Final, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, friction_matrix, gradient, potential
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, input_limits, saturate
from ._free import anchored, free_of, way_from
from ._motion import terms
from ._scales import bandwidth, configurations, energy_range

_STEEP: Final = 0.03  # Share of the range of energies at which pumping begins to fade.
_SLOW: Final = 0.1  # Share of the natural speed at which it is full.
_ALIKE: Final = 2.0
_KICK: Final = 0.02  # What starts it from rest, as a share of that speed.


@final
class EnergyPump(AbstractController):
    """Swings up a system of one angle: feeds friction back, and gives or takes energy until it is the target's.

        u = g⁻¹ D v + U tanh((E* − E)/ε) tanh(y/y₀)

    so that ½ (E − E*)² falls wherever the system moves. At rest in an equilibrium a small push starts it. Beside it
    there may be coordinates that are free, as a reaction wheel on a pendulum is: E is of the angle alone, with the
    inertia that it moves with while these follow their own equations, and g and D v are what is left of forces there.

    Attributes:
        model: System or learned model.
        target: Configuration whose energy is wanted; NaN along coordinates that are free.
        swung: Index of the angle.
        energy: E*, the energy there.
        steepness: 1/ε.
        speed: Natural speed y₀/|g| at which pumping is full [rad/s].
        limits: Largest magnitude of the input, U.

    References:
        Åström & Furuta (2000), *Swinging up a pendulum by energy control*.
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    swung: int = eqx.field(static=True)
    energy: Scalar
    steepness: Scalar
    speed: Scalar
    limits: Inputs

    @classmethod
    def of(cls, model: AbstractPortHamiltonian, target: Target, *, limits: Limits) -> "EnergyPump":
        """Choose scales from the learned energy.

        Args:
            model: System or learned model of one input, and one coordinate that is not free.
            target: Configuration to swing up to; NaN along coordinates that are free.
            limits: Largest magnitude of the input.

        Returns:
            The controller.

        Raises:
            ValueError: If the model has more coordinates or inputs, or the limit is not finite.
        """
        bounds, swung = input_limits(limits, model.inputs), np.flatnonzero(~free_of(as_array(target)))
        if len(swung) != 1 or model.inputs != 1 or not np.isfinite(bounds).all():
            raise ValueError(
                "Pumping energy into one coordinate needs one input with a finite limit; got "
                f"{len(swung)} coordinates, {model.inputs} inputs and limits {bounds.tolist()}."
            )
        goal = anchored(as_array(target))
        return cls(
            model=model,
            target=as_array(target),
            swung=int(swung[0]),
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
        inertia, _, _ = swung_terms(self.model, q, v, self.swung)
        return 0.5 * self._missing(q, v, inertia) ** 2 * self.steepness

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        at = self.swung
        inertia, g, drag = swung_terms(self.model, q, v, at)
        force = gradient(self.model, q)[at] * self.steepness
        still = _KICK * jnp.exp(-((v[at] / (_KICK * self.speed)) ** 2) - force**2)
        direction = jnp.sign(g) * (v[at] / self.speed + still)
        pumping = jnp.tanh(self.steepness * self._missing(q, v, inertia)) * jnp.tanh(direction)
        return saturate((drag / g)[None] + self.limits * pumping, self.limits)

    def _missing(self, q: Coordinates, v: Velocities, inertia: Scalar) -> Scalar:
        """E* − E."""
        return self.energy - 0.5 * inertia * v[self.swung] ** 2 - potential(self.model, q)


def swung_terms(
    model: AbstractPortHamiltonian, q: Coordinates, v: Velocities, coordinate: int
) -> tuple[Scalar, Scalar, Scalar]:
    """Inertia of one coordinate while the others follow their own equations, and forces that are left on it.

    Args:
        model: System or model of one input.
        q: Coordinates.
        v: Velocities.
        coordinate: Its index.

    Returns:
        1/(M⁻¹)_bb, and so many times (M⁻¹ g)_b and (M⁻¹ D v)_b.
    """
    row = model.inverse_mass_matrix(q)[coordinate]
    inertia = 1 / row[coordinate]
    return inertia, inertia * row @ model.input_matrix(q)[:, 0], inertia * row @ friction_matrix(model, q, v) @ v


def is_direct(model: AbstractPortHamiltonian, target: Coordinates) -> bool:
    """Whether an `EnergyPump` swings it up: one coordinate has a place, and the input acts on it everywhere alike.

    Args:
        model: System or model.
        target: Configuration to swing up to; NaN along coordinates that are free.

    Returns:
        Whether what the input does to it differs by less than two times, wherever it is; alone it may do so.
    """
    swung = np.flatnonzero(~free_of(target))
    if len(swung) != 1 or model.inputs != 1 or not model.space.is_angle[swung[0]]:
        return False
    if model.space.size == 1:
        return True
    every = configurations(model, anchored(target))
    inertia, g, _ = jax.vmap(lambda q: swung_terms(model, q, jnp.zeros_like(q), int(swung[0])))(every)
    effect = np.asarray(g / inertia)
    return bool(abs(np.sign(effect).sum()) == len(effect) and np.abs(effect).max() < _ALIKE * np.abs(effect).min())


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
            target: Configuration to swing up to; NaN along a coordinate that is free.
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
        goal = anchored(as_array(target))
        omega = bandwidth(model, goal)
        first = np.array([0.3, 3.0, omega / 4, omega**2 / 2, omega, omega**2 / 2, 0.02])
        return cls(
            model=model,
            target=as_array(target),
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
        e = way_from(self.target, self.model.space, q)
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
