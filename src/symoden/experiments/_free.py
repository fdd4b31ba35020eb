"""Rollouts without input of all models of a contest: their energy, and whether their angles stay angles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.data import Trajectory
from symoden.evaluation import Prediction, predict
from symoden.mechanics import AbstractPortHamiltonian
from symoden.spaces import Space

from ._trained import Contest


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyCurves:
    """True energy along one trajectory and along the models' rollouts from its first state.

    Attributes:
        label: Which trajectory.
        ts: Times [s].
        truth: Energy along the true trajectory [J].
        learned: The true energy at the states of each model's rollout [J], by kind.
        trained: How long the training trajectories last [s].
    """

    label: str
    ts: Float[np.ndarray, " T"]
    truth: Float[np.ndarray, " T"]
    learned: Mapping[str, Float[np.ndarray, " T"]]
    trained: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CircleDrift:
    """How far the embedded angles leave their circles along rollouts.

    Attributes:
        ts: Times [s].
        worst: Largest |cos² + sin² − 1| over angles and trajectories, by kind; infinite once a rollout has diverged.
        trajectories: Number of trajectories.
        trained: How long the training trajectories last [s].
    """

    ts: Float[np.ndarray, " T"]
    worst: Mapping[str, Float[np.ndarray, " T"]]
    trajectories: int
    trained: float


def free_rollouts(contest: Contest, trajectories: Sequence[Trajectory] | None = None) -> dict[str, list[Prediction]]:
    """Roll out every model from the first states of trajectories.

    Args:
        contest: The models.
        trajectories: True trajectories without input; if absent, those that measure prediction.

    Returns:
        Rollouts by kind.
    """
    chosen = contest.source.prediction if trajectories is None else trajectories
    hold = contest.source.dataset.hold
    return {
        kind: predict(trained.model, chosen, hold=hold, solver=trained.solver)
        for kind, trained in contest.trained.items()
    }


def energy_curves(
    contest: Contest, rollouts: Mapping[str, Sequence[Prediction]], *, count: int = 3
) -> tuple[EnergyCurves, ...]:
    """Follow the true energy H along rollouts without input, over the time in which prediction is measured.

    Args:
        contest: The models.
        rollouts: Their rollouts of all prediction trajectories, from `free_rollouts`.
        count: Number of trajectories, evenly spread over their ranks by initial energy.

    Returns:
        One set of curves for each trajectory.
    """
    task, trajectories = contest.task, contest.source.prediction
    truths = [_energy(task.system, trajectory.q, trajectory.rates) for trajectory in trajectories]
    ranked = np.argsort([energies[0] for energies in truths], kind="stable")
    places = sorted({int((k + 0.5) / count * len(ranked)) for k in range(count)})
    chosen = [(place, int(ranked[place])) for place in places]
    return tuple(
        EnergyCurves(
            label=f"initial energy: rank {place + 1} of {len(ranked)}",
            ts=trajectories[i].ts,
            truth=truths[i],
            learned={kind: _energy(task.system, paths[i].q, paths[i].rates) for kind, paths in rollouts.items()},
            trained=(task.points - 1) * task.dt,
        )
        for place, i in chosen
    )


def circle_drift(contest: Contest, rollouts: Mapping[str, Sequence[Prediction]]) -> CircleDrift | None:
    """Measure whether the angles of rollouts without input stay on their circles.

    Args:
        contest: The models.
        rollouts: Their rollouts of all prediction trajectories, from `free_rollouts`.

    Returns:
        The worst deviations; None where the models were told no angle.
    """
    space, trajectories = Space.parse(contest.source.dataset.space), contest.source.prediction
    if not any(space.is_angle):
        return None
    return CircleDrift(
        ts=trajectories[0].ts,
        worst={kind: _worst_drift(space, paths) for kind, paths in rollouts.items()},
        trajectories=len(trajectories),
        trained=(contest.task.points - 1) * contest.task.dt,
    )


def _worst_drift(space: Space, paths: Sequence[Prediction]) -> Float[np.ndarray, " T"]:
    """Largest deviation of the squared radius from 1, at each sample."""
    lengths, angles = len(space.lengths), len(space.angles)
    circles = np.stack([path.observations[:, lengths : lengths + 2 * angles] for path in paths])
    cosines, sines = np.split(circles, 2, axis=2)
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(cosines**2 + sines**2 - 1)
    return np.where(np.isfinite(off), off, np.inf).max(axis=(0, 2))


def _energy(
    truth: AbstractPortHamiltonian, q: Float[np.ndarray, "T n"], rates: Float[np.ndarray, "T n"]
) -> Float[np.ndarray, " T"]:
    """Energy of the true system at observed states."""
    return np.asarray(_energies(truth, jnp.asarray(q), jnp.asarray(rates)))


@eqx.filter_jit
def _energies(truth: AbstractPortHamiltonian, q: Float[Array, "T n"], rates: Float[Array, "T n"]) -> Float[Array, " T"]:
    """Energy of a system at observed states."""
    return jax.vmap(lambda q, rates: truth.hamiltonian(*jnp.split(truth.encode(q, rates), 2)))(q, rates)
