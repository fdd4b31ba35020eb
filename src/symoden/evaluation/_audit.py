"""Power audit: whether energy changes only through the port and by friction, along rollouts and along recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.blocks import without_silent
from symoden.data import Trajectory
from symoden.integrate import HOLDS, AbstractSolver, Hold
from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, potential
from symoden.shapes import Inputs, Scalar, State

from ._batches import Segment, Stretch, in_batches, in_double, pieces
from ._ranges import Ranges

_PIECE = 500
_MOST_ROLLOUTS = 64
_ROLLOUT_STEPS = 100


@dataclass(frozen=True, kw_only=True)
class Audit:
    """How far a model's energy can be trusted; what needs an energy is None for a model that has none.

    Energies are compared with what passed through the model: the sum of the energies supplied (by magnitude) and
    dissipated, and the largest change of the kinetic energy.

    Attributes:
        recordings: Number of recordings looked at.
        rollouts: Number of rollouts from their starts.
        diverged: How many of these diverged.
        rollout_violation: Largest relative violation of Ḣ = yᵀu − vᵀDv along them: the integrator's error.
        log_residual_median: Median over stretches of the recordings of the largest relative residual of the energy
            balance of the measured states: the model's error. A stretch counts by the energy that was on the move in
            it: at rest there is noise alone.
        log_residual_max: The largest of them.
        inverse_mass_min: Smallest eigenvalue of M⁻¹ at the measured states.
        dissipation_min: Smallest eigenvalue of D there.
        outside: Share of samples outside the range of the training data.
    """

    recordings: int
    rollouts: int
    diverged: int | None
    rollout_violation: float | None
    log_residual_median: float | None
    log_residual_max: float | None
    inverse_mass_min: float | None
    dissipation_min: float | None
    outside: float


class _Energies(NamedTuple):
    """What passed through a system since the start [J]."""

    supplied: Scalar
    dissipated: Scalar
    throughput: Scalar


def audit(
    model: AbstractDynamics, trajectories: Sequence[Trajectory], *, ranges: Ranges, hold: str, solver: AbstractSolver
) -> Audit:
    """Audit a model on recordings.

    Args:
        model: Learned model or analytic system.
        trajectories: Recordings, not those of training if there are others.
        ranges: Ranges of the training data.
        hold: What an input is between samples, a key of `HOLDS`.
        solver: What advances rollouts; the energies are integrated along, with the same error.

    Returns:
        The audit.

    Raises:
        ValueError: If there is no recording.
    """
    if not trajectories:
        raise ValueError("An audit needs at least one recording; got none.")
    away = np.concatenate([ranges.outside(t.q, t.rates, t.us, model.space) for t in trajectories])
    none = dict.fromkeys(("log_residual_median", "log_residual_max", "inverse_mass_min", "dissipation_min"))
    if not isinstance(model, AbstractPortHamiltonian):
        return Audit(
            recordings=len(trajectories), rollouts=0, diverged=None, rollout_violation=None, outside=away.mean(), **none
        )
    lean = in_double(without_silent(model))
    chosen = trajectories[:: -(-len(trajectories) // _MOST_ROLLOUTS)]
    starts = [
        Stretch(trajectory=trajectory, start=0, stop=min(_ROLLOUT_STEPS + 1, len(trajectory))) for trajectory in chosen
    ]
    violations = np.array(
        [float(value) for _, value in in_batches(lambda b: _violations(lean, b, solver, HOLDS[hold]), starts)]
    )
    finite = violations[np.isfinite(violations)]
    logs = [
        log for _, log in in_batches(lambda b: _logs(lean, b, HOLDS[hold]), pieces(trajectories, _PIECE), samples=16384)
    ]
    residuals, moved = ([float(getattr(log, name)) for log in logs] for name in ("residual", "moved"))
    return Audit(
        recordings=len(trajectories),
        rollouts=len(starts),
        diverged=len(violations) - len(finite),
        rollout_violation=float(finite.max()) if finite.size else None,
        log_residual_median=float(np.quantile(residuals, 0.5, weights=moved, method="inverted_cdf")),
        log_residual_max=max(residuals),
        inverse_mass_min=min(float(log.inverse_mass) for log in logs),
        dissipation_min=min(float(log.dissipation) for log in logs),
        outside=float(away.mean()),
    )


@eqx.filter_jit
def _violations(
    model: AbstractPortHamiltonian, batch: Segment, solver: AbstractSolver, hold: Hold
) -> Float[Array, " B"]:
    """Largest relative violation of the balance along each rollout; not finite where it diverges."""

    def field(t: Scalar, joint: tuple[State, _Energies], u: Inputs) -> tuple[State, _Energies]:
        state, _ = joint
        return model.derivative(t, state, u), _powers(model, state, u)

    def one(segment: Segment) -> Scalar:
        def step(joint: tuple[State, _Energies], sample: tuple) -> tuple:
            after = solver.step(field, joint, *sample)
            return after, after

        start = model.encode(segment.q[0], segment.rates[0])
        nothing = jnp.zeros((), start.dtype)
        samples = (segment.ts[:-1], segment.ts[1:], *hold(segment.us))
        _, (states, energies) = jax.lax.scan(step, (start, _Energies(nothing, nothing, nothing)), samples)
        return _balance(model, jnp.concatenate([start[None], states]), energies)[0]

    return jax.vmap(one)(batch)


class _Log(NamedTuple):
    """What a stretch of a recording says."""

    residual: Float[Array, "*B"]
    moved: Float[Array, "*B"]
    inverse_mass: Float[Array, "*B"]
    dissipation: Float[Array, "*B"]


@eqx.filter_jit
def _logs(model: AbstractPortHamiltonian, batch: Segment, hold: Hold) -> _Log:
    """Energy balance along measured states, and the least eigenvalues there."""
    # Between samples the states are joined by the cubic with the model's slopes, and powers summed by Simpson's rule:
    # the error of both is of the order of the step to the fourth.

    def interval(x0: State, x1: State, dt: Scalar, u0: Inputs, u1: Inputs) -> _Energies:
        start, end = model.derivative(dt, x0, u0), model.derivative(dt, x1, u1)
        middle = (x0 + x1) / 2 + dt / 8 * (start - end)
        powers = (_powers(model, x0, u0), _powers(model, middle, (u0 + u1) / 2), _powers(model, x1, u1))
        return jax.tree.map(lambda a, b, c: dt / 6 * (a + 4 * b + c), *powers)

    def one(segment: Segment) -> _Log:
        states = jax.vmap(model.encode)(segment.q, segment.rates)
        gained = jax.vmap(interval)(states[:-1], states[1:], jnp.diff(segment.ts), *hold(segment.us))
        inverse_mass = jax.vmap(model.inverse_mass_matrix)(segment.q)
        residual, moved = _balance(model, states, jax.tree.map(jnp.cumsum, gained))
        return _Log(
            residual=residual,
            moved=moved,
            inverse_mass=jnp.min(jnp.linalg.eigvalsh(inverse_mass)),
            dissipation=jnp.min(jnp.linalg.eigvalsh(jax.vmap(lambda x: _dissipation(model, x))(states))),
        )

    return jax.vmap(one)(batch)


def _powers(model: AbstractPortHamiltonian, state: State, u: Inputs) -> _Energies:
    """Rates of the energies."""
    q, p = jnp.split(state, 2)
    balance = model.power_balance(q, p, u)
    return _Energies(balance.supplied, balance.dissipated, jnp.abs(balance.supplied) + balance.dissipated)


def _dissipation(model: AbstractPortHamiltonian, state: State) -> Float[Array, "d d"]:
    """D at a state."""
    q, p = jnp.split(state, 2)
    return model.dissipation_matrix(q, jax.grad(model.hamiltonian, argnums=1)(q, p))


def _balance(model: AbstractPortHamiltonian, states: Float[Array, "T s"], energies: _Energies) -> tuple[Scalar, Scalar]:
    """Largest difference between the energy's change and its balance, relative to the energy that was on the move.

    Returns:
        That, and the energy that was on the move [J], above zero.
    """

    def energy(state: State) -> tuple[Scalar, Scalar]:
        q, p = jnp.split(state, 2)
        total = model.hamiltonian(q, p)
        return total, total - potential(model, q)

    total, kinetic = jax.vmap(energy)(states)
    residual = total[1:] - total[0] - energies.supplied + energies.dissipated
    moved = energies.throughput[-1] + jnp.max(kinetic) - jnp.min(kinetic) + jnp.finfo(total.dtype).tiny
    return jnp.max(jnp.abs(residual)) / moved, moved
