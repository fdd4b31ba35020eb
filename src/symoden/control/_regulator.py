"""Linear-quadratic regulator about an equilibrium, and where it may be trusted."""

from typing import Final, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Bool, Float

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, input_limits, saturate
from ._free import anchored, free_of, kept_states, told, way_from
from ._judge import Tolerance
from ._motion import jacobians, state_rates, velocity_field

_REST = 1e-6
_UNHURRIED: Final = 0.3  # Share of the limits with which speeds of free coordinates are brought back.


@final
class Regulator(AbstractController):
    """Holds a system at an equilibrium by linear feedback, u = u* − K (e, v), angles the short way round.

    Of coordinates that the target leaves free, a reaction wheel's angle or a robot's place, only the speed is brought
    back to zero, with a share of the limits at most: as fast as it may be, the rest is held all the same.

    Attributes:
        configurations: Configuration space.
        target: Configuration to hold; NaN along coordinates that are free.
        fastest: Largest speeds that count; infinite but for free coordinates.
        hold: Input u* that holds it.
        gain: K.
        cost: P; (e, v)ᵀ P (e, v) is the cost to go of the linearised system without limits.
        state_weight: Q.
        input_weight: R.
        limits: Largest magnitude of each input.

    References:
        Anderson & Moore (1990), *Optimal Control: Linear Quadratic Methods*.

    Example:
        >>> from symoden.systems import CartPole
        >>> controller = Regulator.of(CartPole(), jnp.zeros(2), limits=15.0)
        >>> controller.gain.shape
        (1, 4)
    """

    configurations: Space
    target: Coordinates
    fastest: Velocities
    hold: Inputs
    gain: Float[Array, "m s"]
    cost: Float[Array, "s s"]
    state_weight: Float[Array, "s s"]
    input_weight: Float[Array, "m m"]
    limits: Inputs

    @classmethod
    def of(
        cls,
        dynamics: AbstractDynamics,
        target: Target,
        *,
        limits: Limits = None,
        period: float | None = None,
        stiffness: float = 1.0,
    ) -> "Regulator":
        """Linearise, and solve the Riccati equation.

        A deviation of 1 rad or 1 m weighs as much as its speed ω, the linearised system's fastest rate, and as much as
        an input at its limit; without limits, as an input that accelerates the system by ω² there. Stiffer, a smaller
        deviation does. `design` finds how stiff a system asks for.

        The speed of a free coordinate weighs by what the inputs at their limits give it in 1/ω, at least as 1 rad does.

        Friction counts as it is at the speed that counts as rest (`Tolerance`), of free coordinates at the speed that
        they are weighed by. At rest dry friction seems to hold everything, and what is optimal with it brakes too
        little where it moves.

        Args:
            dynamics: System or learned model, one without energy included.
            target: Configuration to hold; NaN along coordinates that are free.
            limits: Largest magnitude of the inputs; None for none.
            period: Control period [s] for which the gain is optimal; None for continuous control.
            stiffness: A deviation of so many times less weighs as much.

        Returns:
            The controller.

        Raises:
            ValueError: If holding the target takes more than the limits, or the linearised system cannot be stabilised.
        """
        goal = as_array(target)
        bounds = input_limits(limits, dynamics.inputs)
        n, free = dynamics.space.size, free_of(goal)
        A, B, hold = linearize(dynamics, anchored(goal))
        if not np.all(np.abs(hold) < bounds):
            raise ValueError(
                f"The limits must exceed what holding the target takes, {np.abs(hold).round(3).tolist()}; they are "
                f"{bounds.round(3).tolist()}. Allow more input, or choose a target that takes less."
            )
        omega = max(1.0, float(np.sqrt(np.abs(np.linalg.eigvals(A[n:, :n])).max())))
        units = np.where(np.isfinite(bounds), bounds, omega**2 / np.linalg.norm(B[n:], axis=0))
        speeds = np.maximum(np.where(free, np.linalg.norm(B[n:] * units, axis=1) / omega, omega), omega)
        A, _, _ = linearize(dynamics, anchored(goal), speed=np.where(free, speeds, Tolerance().velocity))
        Q = np.diag(np.concatenate([np.where(free, 0.0, 1.0), speeds**-2]))
        R = np.diag((stiffness * units) ** -2)
        kept = kept_states(goal)
        within = np.ix_(kept, kept)
        gain, P = np.zeros((len(bounds), 2 * n)), np.zeros((2 * n, 2 * n))
        try:
            gain[:, kept], P[within] = _riccati(A[within], B[kept], Q[within], R, period)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ValueError(f"The system cannot be stabilised at {told(goal)}: {error}.") from None
        if not _spans_ellipsoids(P[within]):
            raise ValueError(
                f"The system can be stabilised at {told(goal)} from so near alone that rounding hides it. Raise the "
                "limits, or shorten the period."
            )
        with np.errstate(divide="ignore"):
            counted = ((bounds - np.abs(hold))[:, None] / np.abs(gain[:, n:])).min(axis=0)
        return cls(
            configurations=dynamics.space,
            target=goal,
            fastest=as_array(np.where(free, _UNHURRIED / max(1, free.sum()) * counted, np.inf)),
            hold=as_array(hold),
            gain=as_array(gain),
            cost=as_array(P),
            state_weight=as_array(Q),
            input_weight=as_array(R),
            limits=as_array(bounds),
        )

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.configurations

    @property
    def kept(self) -> Bool[np.ndarray, " s"]:
        """Which of (e, v) count: all but the places of free coordinates."""
        return kept_states(self.target)

    def deviation(self, q: Coordinates, v: Velocities) -> Float[Array, " s"]:
        """Way from the target, then the velocities; of free coordinates nothing, and at most `fastest`.

        Args:
            q: Coordinates.
            v: Velocities.

        Returns:
            (e, v).
        """
        return jnp.concatenate([way_from(self.target, self.space, q), jnp.clip(v, -self.fastest, self.fastest)])

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """Cost to go (e, v)ᵀ P (e, v), not in joules; it may rise while free speeds are beyond those that count."""
        del t
        x = self.deviation(q, v)
        return x @ self.cost @ x

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        return saturate(self.hold - self.gain @ self.deviation(q, v), self.limits)


def linearize(
    dynamics: AbstractDynamics, target: Coordinates, *, speed: float | Float[np.ndarray, " n"] = 0.0
) -> tuple[Float[np.ndarray, "s s"], Float[np.ndarray, "s m"], Float[np.ndarray, " m"]]:
    """Linearise about rest at a configuration, in (q, v).

    Args:
        dynamics: System or model.
        target: Configuration; with `u*` it is an equilibrium as nearly as the inputs allow: of all inputs it leaves the
            least constraint aᵀ M a of the accelerations a, whatever the coordinates' units.
        speed: Slopes with velocities are secants from less to more by so much, one number or one for each; 0 for those
            at rest, where dry friction is far steeper than at any speed that matters.

    Returns:
        A, B and `u*`: d(e, v)/dt = A (e, v) + B (u − `u*`).

    References:
        Gauss (1829), *Über ein neues allgemeines Grundgesetz der Mechanik*: least constraint.
    """
    A, B, hold = _linearize(dynamics, target)
    if np.any(speed):
        slopes = _secants(dynamics, target, hold, jnp.broadcast_to(jnp.asarray(speed, target.dtype), target.shape))
        A = A.at[dynamics.space.size :, dynamics.space.size :].set(slopes)
    return np.asarray(A, float), np.asarray(B, float), np.asarray(hold, float)


@eqx.filter_jit
def _linearize(dynamics: AbstractDynamics, target: Coordinates) -> tuple:
    """Jacobians in one compiled program."""
    still = jnp.zeros_like(target)
    none = jnp.zeros(dynamics.inputs, target.dtype)
    n = dynamics.space.size
    drift = state_rates(dynamics, target, still, none)
    input_effect = jax.jacfwd(state_rates, argnums=3)(dynamics, target, still, none)
    root = jnp.eye(n, dtype=target.dtype)
    if isinstance(dynamics, AbstractPortHamiltonian):
        root = jnp.linalg.cholesky(dynamics.mass_matrix(target)).T
    hold = -jnp.linalg.lstsq(root @ input_effect[n:], root @ drift[n:])[0]
    return *jacobians(dynamics, target, still, hold), hold


@eqx.filter_jit
def _secants(dynamics: AbstractDynamics, target: Coordinates, hold: Inputs, speed: Velocities) -> Float[Array, "n n"]:
    """How accelerations change with each velocity, from −speed to speed: of viscous friction its slope, of dry less."""

    def accelerations(v: Velocities) -> Velocities:
        return velocity_field(dynamics, target, v, hold)[1]

    each = jnp.diag(speed)
    return (jax.vmap(accelerations)(each) - jax.vmap(accelerations)(-each)).T / (2 * speed[None])


def remaining_motion(dynamics: AbstractDynamics, target: Coordinates, hold: Inputs) -> Float[np.ndarray, " s"]:
    """Rates of (q, v) at rest at a configuration: zero at an equilibrium.

    Args:
        dynamics: System or model.
        target: Configuration.
        hold: Input.

    Returns:
        The rates.
    """
    rates = eqx.filter_jit(velocity_field)(dynamics, target, jnp.zeros_like(target), hold)
    return np.asarray(jnp.concatenate(rates), float)


def _riccati(
    A: Float[np.ndarray, "s s"],
    B: Float[np.ndarray, "s m"],
    Q: Float[np.ndarray, "s s"],
    R: Float[np.ndarray, "m m"],
    period: float | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Gain and cost to go, continuous or sampled with zero-order hold."""
    if period is None:
        P = scipy.linalg.solve_continuous_are(A, B, Q, R)
        return np.linalg.solve(R, B.T @ P), P
    A, B = held(A, B, period)
    Q, R = Q * period, R * period
    P = scipy.linalg.solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), P


def held(
    A: Float[np.ndarray, "s s"], B: Float[np.ndarray, "s m"], period: float
) -> tuple[Float[np.ndarray, "s s"], Float[np.ndarray, "s m"]]:
    """What a linear system does in a period for which its inputs are held: e^{AT} and ∫₀ᵀ e^{As} ds B.

    Args:
        A: Of dx/dt = A x + B u.
        B: The same.
        period: T [s].

    Returns:
        Both matrices.

    References:
        Van Loan (1978), *Computing integrals involving the matrix exponential*.
    """
    s, m = B.shape
    both = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, s + m))]]) * period)
    return both[:s, :s], both[:s, s:]


def _spans_ellipsoids(P: Float[np.ndarray, "s s"]) -> bool:
    """Whether xᵀ P x = level is an ellipsoid whose points can be drawn: by the inverse of P, as they are."""
    try:
        np.linalg.cholesky(np.linalg.inv(P))
    except np.linalg.LinAlgError:
        return False
    return True
