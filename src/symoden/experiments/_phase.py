"""The phase plane of a mechanism with one coordinate: vector fields, and trajectories in them."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.data import Trajectory
from symoden.evaluation import Prediction, Ranges
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Rates
from symoden.units import titled

from ._free import free_rollouts
from ._portrait import coordinate_title
from ._simulate import simulate
from ._trained import Contest

_WIDER = 0.35


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Rates of change over the plane without input; axes are (rates, coordinates), as streamlines are drawn.

    Attributes:
        q_dot: Rate of the coordinate.
        rate_dot: Rate of the velocity or momentum.
        error: Root mean square of the difference from the true field, relative to that of the true field; each part
            relative to the true part's own, so that units do not matter.
    """

    q_dot: Float[np.ndarray, "J K"]
    rate_dot: Float[np.ndarray, "J K"]
    error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PhasePlane:
    """Vector fields of the truth and of models, and rollouts from initial states that no model saw.

    Attributes:
        coordinate: Name and unit of the coordinate.
        rate: Name and unit of its velocity or momentum.
        q: Values of the coordinate.
        rates: Values of the rate.
        truth: The true field.
        learned: The models' fields, by kind.
        trajectories: True trajectories without input.
        predictions: The models' rollouts from their first states, by kind.
    """

    coordinate: str
    rate: str
    q: Float[np.ndarray, " K"]
    rates: Float[np.ndarray, " J"]
    truth: Field
    learned: Mapping[str, Field]
    trajectories: tuple[Trajectory, ...]
    predictions: Mapping[str, tuple[Prediction, ...]]


def phase_plane(contest: Contest, *, count: int = 5, points: int = 41) -> PhasePlane | None:
    """Compare vector fields over the phase plane, and rollouts for as long as prediction is measured.

    Args:
        contest: The models.
        count: Number of trajectories.
        points: Number of values along each axis. The coordinate's reach somewhat farther than the initial ones, the
            rate's as far as training went.

    Returns:
        The plane; None for a mechanism with more coordinates.
    """
    task = contest.task
    if task.system.space.size != 1:
        return None
    ((low, high),) = task.position_bounds
    ((slowest, fastest),) = Ranges.of(contest.source.dataset.train, task.system.space).rates
    wider = _WIDER * (high - low)
    q, rates = np.linspace(low - wider, high + wider, points), np.linspace(slowest, fastest, points)
    truth = _field(task.system, q, rates, None)
    longer = dataclasses.replace(task, points=max(task.points, task.prediction_points))
    driven = simulate(longer, seed=contest.source.seed, train_initials=1, test_initials=count).dataset.test
    free = tuple(trajectory for trajectory in driven if not np.any(trajectory.us))
    (unit,) = task.system.space.units
    rate = titled("p", unit, "momentum") if task.system.momenta else titled("velocity", unit, "velocity")
    return PhasePlane(
        coordinate=coordinate_title(task, 0),
        rate=rate,
        q=q,
        rates=rates,
        truth=truth,
        learned={kind: _field(trained.model, q, rates, truth) for kind, trained in contest.trained.items()},
        trajectories=free,
        predictions={kind: tuple(paths) for kind, paths in free_rollouts(contest, free).items()},
    )


def _field(
    dynamics: AbstractDynamics, q: Float[np.ndarray, " K"], rates: Float[np.ndarray, " J"], truth: Field | None
) -> Field:
    """Field over a grid."""
    across, up = np.meshgrid(q, rates)
    found = _rates_of_change(dynamics, jnp.asarray(across.reshape(-1, 1)), jnp.asarray(up.reshape(-1, 1)))
    q_dot, rate_dot = (np.asarray(part).reshape(across.shape) for part in found)
    if truth is None:
        return Field(q_dot=q_dot, rate_dot=rate_dot, error=0.0)
    pairs = ((q_dot, truth.q_dot), (rate_dot, truth.rate_dot))
    parts = [np.mean((learned - true) ** 2) / np.mean(true**2) for learned, true in pairs]
    return Field(q_dot=q_dot, rate_dot=rate_dot, error=float(np.sqrt(np.mean(parts))))


@eqx.filter_jit
def _rates_of_change(
    dynamics: AbstractDynamics, q: Float[Array, "K n"], rates: Float[Array, "K n"]
) -> tuple[Float[Array, "K n"], Float[Array, "K n"]]:
    """Rates of change of what is observed, whatever the state of the dynamics."""

    def at(q: Coordinates, rates: Rates) -> tuple[Coordinates, Rates]:
        state = dynamics.encode(q, rates)
        change = dynamics.derivative(jnp.zeros(()), state, jnp.zeros(dynamics.inputs, state.dtype))
        return jax.jvp(dynamics.decode, (state,), (change,))[1]

    return jax.vmap(at)(q, rates)
