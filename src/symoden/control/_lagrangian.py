"""Controlled Lagrangian for a cyclic actuated coordinate and one that is not actuated, such as cart and pole."""

from typing import Final, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, potential
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, input_limits, saturate
from ._motion import terms, velocity_field
from ._pumps import actuated_coordinate
from ._scales import bandwidth

_NODES: Final = np.polynomial.legendre.leggauss(4)
_CURVATURE: Final = 1e-3
_CYCLIC: Final = 0.02
_ROUNDS: Final = 12
_CANDIDATES: Final = 400
_ELITE: Final = 40
_LEAST_SPREAD: Final = 0.01


class Shape(NamedTuple):
    """Learned terms along the coordinate θ that is not actuated, the cyclic one x at its target.

    Attributes:
        b: Coupling M_xθ.
        b_rate: Its rate of change.
        inertia: M_θθ.
        integral: ∫ b dθ from the target.
    """

    b: Scalar
    b_rate: Scalar
    inertia: Scalar
    integral: Scalar


@final
class ControlledLagrangian(AbstractController):
    """Stabilises the top of the potential energy by giving θ a negative inertia, and x a place.

    Partial feedback linearisation gives x the acceleration w. With μ = M_θθ − κ b², ζ = a x + (a κ + 1) ∫b dθ and
    w chosen so that d/dt (ẋ + κ b θ̇) = −k ζ − c ζ̇,

        W = −(½ μ θ̇² + V − V*) + ½ a (ẋ + κ b θ̇)² + ½ k ζ²

    has its minimum at the target where μ < 0 and V is at its top, and Ẇ = −c ζ̇² + d θ̇²: friction d where no input
    acts works against it, as against every controller of this kind; it is small beside the other where c ζ̇² is not
    zero for long. The matching conditions hold exactly as far as M does not depend on x, and M_xx not on θ.

    Attributes:
        model: System or learned model of two coordinates and one input.
        target: Configuration to hold.
        actuated: Index of x.
        gains: κ, a, k, c, positive.
        top: V*, the potential energy of the target.
        limits: Largest magnitude of the input.

    References:
        Bloch, Leonard & Marsden (2000), *Controlled Lagrangians and the stabilization of mechanical systems I*.
        Bloch, Chang, Leonard & Marsden (2001), *… II: potential shaping*.
        Woolsey et al. (2004), *Controlled Lagrangian systems with gyroscopic forcing and dissipation*: friction.
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    actuated: int = eqx.field(static=True)
    gains: Float[Array, "4"]
    top: Scalar
    limits: Inputs

    @classmethod
    def of(
        cls,
        model: AbstractPortHamiltonian,
        target: Target,
        *,
        limits: Limits = None,
        reach: float = 0.8,
        gains: Target | None = None,
    ) -> "ControlledLagrangian":
        """Choose the gains with which the linearised closed loop, learned friction included, decays fastest.

        Args:
            model: System or learned model.
            target: Configuration to hold, at the top of the potential energy along θ.
            limits: Largest magnitude of the input; None for none.
            reach: Distance of θ from the target up to which μ < 0 is needed [rad]: the farther, the slower.
            gains: κ, a, k, c instead.

        Returns:
            The controller.

        Raises:
            ValueError: If the model has not two coordinates and one input, x is not cyclic, or the coupling vanishes
                at the target or the potential energy is not at its top there.
        """
        if model.space.size != 2 or model.inputs != 1:
            raise ValueError(
                "A controlled Lagrangian needs two coordinates and one input; the model has "
                f"{model.space.size} and {model.inputs}."
            )
        goal = as_array(target)
        a = actuated_coordinate(model, goal)
        loose = cls(
            model=model,
            target=goal,
            actuated=a,
            gains=as_array(np.ones(4)),
            top=potential(model, goal),
            limits=as_array(np.full(1, np.inf)),
        )
        here, edge = (loose.shape(goal[1 - a] + shift) for shift in (0.0, reach))
        curvature = float(jax.hessian(potential, argnums=1)(model, goal)[1 - a, 1 - a])
        scale = float(here.inertia) * bandwidth(model, goal) ** 2
        if loose.cyclic_error() > _CYCLIC or not curvature < -_CURVATURE * scale or abs(float(here.b)) < _CURVATURE:
            raise ValueError(
                "A controlled Lagrangian needs a cyclic actuated coordinate that is coupled to the other one, and the "
                f"top of the potential energy at the target; got ∂V/∂x relative to ∂V/∂θ {loose.cyclic_error():.2g}, "
                f"curvature {curvature:.3g} and coupling {float(here.b):.3g}."
            )
        kappa = float(edge.inertia / edge.b**2)
        chosen = _fastest(loose, kappa) if gains is None else np.asarray(gains, float)
        tuned = eqx.tree_at(lambda c: c.gains, loose, as_array(chosen))
        return eqx.tree_at(lambda c: c.limits, tuned, as_array(input_limits(limits, 1)))

    def shape(self, theta: Scalar) -> Shape:
        """Learned terms at one angle.

        Args:
            theta: θ.

        Returns:
            The terms.
        """
        goal = self.target[1 - self.actuated]

        def entries(theta: Scalar) -> tuple[Scalar, Scalar]:
            M = self.model.mass_matrix(self.target.at[1 - self.actuated].set(theta))
            return M[0, 1], M[1 - self.actuated, 1 - self.actuated]

        (b, inertia), (b_rate, _) = jax.jvp(entries, (theta,), (jnp.ones_like(theta),))
        nodes, weights = (jnp.asarray(part, theta.dtype) for part in _NODES)
        half = 0.5 * (theta - goal)
        values = jax.vmap(lambda node: entries(goal + half * (1 + node))[0])(nodes)
        return Shape(b, b_rate, inertia, half * (weights @ values))

    def cyclic_error(self) -> float:
        """How far x is from cyclic: the largest |∂V/∂x| over all θ beside the largest |∂V/∂θ|.

        Returns:
            The ratio.
        """
        a = self.actuated
        thetas = jnp.linspace(-np.pi, np.pi, 64, dtype=self.target.dtype)
        slopes = jax.vmap(lambda theta: jax.grad(potential, 1)(self.model, self.target.at[1 - a].set(theta)))(thetas)
        largest = np.abs(np.asarray(slopes)).max(axis=0)
        return float(largest[a] / max(largest.max(), np.finfo(float).tiny))

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """W."""
        del t
        kappa, a, k, _ = self.gains
        at, (zeta, _) = self._at(q), self._place(q, v)
        theta_rate = v[1 - self.actuated]
        mu = at.inertia - kappa * at.b**2
        there = self.target.at[1 - self.actuated].set(self.target[1 - self.actuated] + self._angle(q))
        height = potential(self.model, there) - self.top
        moving = v[self.actuated] + kappa * at.b * theta_rate
        return -(0.5 * mu * theta_rate**2 + height) + 0.5 * a * moving**2 + 0.5 * k * zeta**2

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        i = self.actuated
        kappa, _, k, c = self.gains
        at, (zeta, zeta_rate) = self._at(q), self._place(q, v)
        motion = terms(self.model, q, v)
        mu = at.inertia - kappa * at.b**2
        wanted = -k * zeta - c * zeta_rate
        rest = kappa * (at.b * motion.bias[1 - i] - at.inertia * at.b_rate * v[1 - i] ** 2)
        w = (at.inertia * wanted + rest) / mu
        effect, drift = jnp.linalg.solve(motion.M, jnp.stack([motion.g[:, 0], motion.bias], axis=1))[i]
        return saturate((w + drift)[None] / effect, self.limits)

    def _angle(self, q: Coordinates) -> Scalar:
        """θ from the target, the short way."""
        return self.model.space.difference(q, self.target)[1 - self.actuated]

    def _at(self, q: Coordinates) -> Shape:
        """Terms at a configuration."""
        return self.shape(self.target[1 - self.actuated] + self._angle(q))

    def _place(self, q: Coordinates, v: Velocities) -> tuple[Scalar, Scalar]:
        """ζ and its rate."""
        kappa, a, _, _ = self.gains
        at = self._at(q)
        e = self.model.space.difference(q, self.target)[self.actuated]
        share = a * kappa + 1
        return a * e + share * at.integral, a * v[self.actuated] + share * at.b * v[1 - self.actuated]


def _fastest(controller: ControlledLagrangian, least: float) -> Float[np.ndarray, "4"]:
    """Gains of the fastest decay, κ being at least what its reach needs, by the cross-entropy method."""
    generator = np.random.default_rng(0)
    mean = np.log([least, 1 / least, 10.0, 10.0])
    best, best_decay, spread = np.exp(mean), np.inf, np.array([0.3, 1.5, 1.5, 1.5])
    for _ in range(_ROUNDS):
        draw = np.exp(mean + spread * generator.standard_normal((_CANDIDATES, len(mean))))
        draw[:, 0] = np.maximum(draw[:, 0], least)
        slopes = np.asarray(_closed_loops(controller, as_array(draw)))
        decay = np.linalg.eigvals(np.where(np.isfinite(slopes), slopes, 0.0)).real.max(axis=1)
        order = np.argsort(decay)[:_ELITE]
        if decay[order[0]] < best_decay:
            best, best_decay = draw[order[0]], decay[order[0]]
        logs = np.log(draw[order])
        mean, spread = logs.mean(axis=0), np.maximum(logs.std(axis=0), _LEAST_SPREAD)
    return best


@eqx.filter_jit
def _closed_loops(controller: ControlledLagrangian, gains: Float[Array, "c 4"]) -> Float[Array, "c 4 4"]:
    """Linearised closed loop for each choice of gains."""

    def field(x: Array, gains: Array) -> Array:
        q, v = jnp.split(x, 2)
        u = eqx.tree_at(lambda c: c.gains, controller, gains)(q, v)
        return jnp.concatenate(velocity_field(controller.model, q, v, u))

    rest = jnp.concatenate([controller.target, jnp.zeros_like(controller.target)])
    return jax.vmap(lambda gains: jax.jacfwd(field)(rest, gains))(gains)
