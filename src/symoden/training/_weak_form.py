"""The equations of motion in weak form, a regression: no rollouts, so a model is found soon, and from any weights."""

from typing import Final, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.integrate import AbstractSolver, Hold
from symoden.mechanics import AbstractDynamics, AbstractMechanical
from symoden.shapes import Coordinates, Inputs, Scalar, Times, Velocities

from ._objective import AbstractObjective, Batch
from ._weighing import Weighing

_FLATNESS: Final = 3  # Of the bump at its ends; the trapezoidal rule then errs by the fourth power of even steps.


@final
class WeakForm(AbstractObjective):
    """By how much a model misses the change of velocity over a window, from the states that were measured along it.

    The principle of Lagrange and d'Alembert: along a motion, and for any bump φ(t) that vanishes at the window's ends,

        d/dε ∫ L(q + ε φ, q̇ + ε φ̇) dt + ∫ φ (g u − D q̇) dt = 0 at ε = 0, with L = ½ q̇ᵀ M(q) q̇ − V(q).

    No acceleration is needed, and noise averages out. M⁻¹ in the middle of the window makes a velocity of what is left
    of this impulse, lest no forces at all explained every motion. Of the parameters that is nearly a polynomial, where
    a rollout over the same time is far from it, and costs a tenth of one. But states are as measured: noise biases what
    is found. The integrals err by the fourth power of even steps, and about the second of uneven ones.

    Attributes:
        weights: Factor on the error of every velocity.
        hold: How inputs act between samples.

    References:
        Messenger & Bortz (2021), *Weak SINDy: Galerkin-based data-driven model selection*: such bumps.
    """

    weights: Float[Array, " n"]
    hold: Hold = eqx.field(static=True)

    def refined(self, solver: AbstractSolver, weighing: Weighing) -> "WeakForm":
        """The same: nothing is integrated."""
        del solver, weighing
        return self

    @property
    def frees_starts(self) -> bool:
        """No."""
        return False

    def residuals(self, dynamics: AbstractDynamics, window: Batch) -> Float[Array, "1 n"]:
        """Weighted errors of the change of velocity over one window.

        Args:
            dynamics: A mechanical model.
            window: One window, of velocities.

        Returns:
            The errors, in one row.

        Raises:
            TypeError: If the model has no energies.
        """
        if not isinstance(dynamics, AbstractMechanical):
            raise TypeError(f"For its weak form a model must be mechanical; got {type(dynamics).__name__}.")
        bump, slope = _bump(window.ts)
        steps = jnp.diff(window.ts)
        # By the trapezoidal rule each sample stands for half the interval that it ends, and half of that it begins.
        before, after = jnp.pad(steps / 2, (1, 0)), jnp.pad(steps / 2, (0, 1))
        whole = before + after
        begins, ends = self.hold(window.us)
        begin, end = _at_samples(begins, ends)
        rising, risen = _at_samples(*[(ends - begins) / steps[:, None]] * 2)

        def pushed(q: Coordinates, v: Velocities, jump: Inputs, time: Scalar) -> Velocities:
            return v + time / 12 * (dynamics.inverse_mass_matrix(q) @ dynamics.input_matrix(q) @ jump)

        def lagrangian(q: Coordinates, v: Velocities) -> Scalar:
            return v @ dynamics.mass_matrix(q) @ v / 2 - dynamics.potential_energy(q)

        def action(shift: Float[Array, " n"]) -> Scalar:
            path = window.q + jnp.outer(bump, shift), rates + jnp.outer(slope, shift)
            return whole @ jax.vmap(lagrangian)(*path)

        def impulse(q: Coordinates, v: Velocities, u: Inputs, time: Scalar) -> Float[Array, " n"]:
            return dynamics.input_matrix(q) @ u - time * dynamics.dissipation_matrix(q, v) @ v

        def turn(q: Coordinates, v: Velocities, jump: Inputs, bump: Scalar, slope: Scalar) -> Float[Array, " n"]:
            return jax.jvp(lambda bump, q: bump * dynamics.input_matrix(q) @ jump, (bump, q), (slope, v))[1]

        # Where inputs jump, the integrand's slope does, and the rule errs by the square of the step times this jump.
        rates = jax.vmap(pushed)(window.q, window.rates, begin - end, whole)
        inputs = before[:, None] * end + after[:, None] * begin + whole[:, None] ** 2 / 12 * (rising - risen)
        left = jax.grad(action)(jnp.zeros_like(window.q[0]))
        left += bump @ jax.vmap(impulse)(window.q, rates, inputs, whole)
        left += whole**2 / 12 @ jax.vmap(turn)(window.q, window.rates, begin - end, bump, slope)
        velocity = dynamics.inverse_mass_matrix(window.q[jnp.argmax(bump)]) @ left
        return (self.weights * velocity * (window.ts[-1] - window.ts[0]) / (whole @ bump))[None]


def has_weak_form(dynamics: AbstractDynamics) -> bool:
    """Whether a model's equations of motion are those of `WeakForm`.

    Args:
        dynamics: Model.

    Returns:
        Whether it has energies, and friction on velocities alone, unlike the paper's on the full state.
    """
    if not isinstance(dynamics, AbstractMechanical):
        return False
    friction = jax.eval_shape(dynamics.dissipation_matrix, *jnp.zeros((2, dynamics.space.size)))
    return friction.shape[0] == dynamics.space.size


def _at_samples(begins: Float[Array, "h m"], ends: Float[Array, "h m"]) -> tuple[Float[Array, "h+1 m"], ...]:
    """Of every interval what begins and ends it, as what is right after and before each sample; zero beyond."""
    return jnp.pad(begins, [(0, 1), (0, 0)]), jnp.pad(ends, [(1, 0), (0, 0)])


def _bump(ts: Times) -> tuple[Times, Times]:
    """The bump φ at the samples of a window, and its slope."""
    half = (ts[-1] - ts[0]) / 2
    x = (ts - ts[0]) / half - 1
    return (1 - x**2) ** _FLATNESS, -2 * _FLATNESS * x * (1 - x**2) ** (_FLATNESS - 1) / half
