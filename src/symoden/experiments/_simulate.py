"""Simulated trajectories of a task, accurate to 1e-9."""

from dataclasses import dataclass
from typing import Final

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from symoden.data import Dataset, Trajectory
from symoden.integrate import DiffraxSolver, rollout
from symoden.mechanics import AbstractMechanical

from ._tasks import Task

_SOLVER: Final = DiffraxSolver(diffrax.Dopri8(), rtol=1e-12, atol=1e-12)


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskData:
    """What a task is learned from and scored on.

    Attributes:
        dataset: Training and test trajectories, `<part>-<initial condition>-u<input>`, in the order of the inputs.
        prediction: Longer trajectories without input from the training initial conditions, `prediction-<…>`.
    """

    dataset: Dataset
    prediction: tuple[Trajectory, ...]


def simulate(
    task: Task, *, seed: int = 0, train_initials: int | None = None, test_initials: int | None = None
) -> TaskData:
    """Draw initial conditions and simulate a task in float64, whatever JAX's default precision.

    Training and test initial conditions come from streams of their own, so that fewer of the one leave the other as
    it is, and are the first ones of more.

    Args:
        task: The task.
        seed: Seed of the initial conditions; the same seed gives the same bits on the same machine.
        train_initials: Number of training initial conditions; the task's if absent.
        test_initials: Number of test initial conditions, at least 0; the task's if absent.

    Returns:
        Trajectories under every constant input, and those that measure prediction.

    Raises:
        ValueError: If there is no training initial condition, or a negative number of test ones.

    Example:
        >>> from symoden.experiments import task
        >>> data = simulate(task("pendulum"), train_initials=2, test_initials=1)
        >>> len(data.dataset.train), data.dataset.train[0].name, len(data.prediction[0])
        (10, 'train-000-u0', 40)
    """
    n_train = task.n_train if train_initials is None else train_initials
    n_test = task.n_test if test_initials is None else test_initials
    if n_train < 1 or n_test < 0:
        raise ValueError(
            f"There must be at least 1 training and 0 test initial conditions; got {n_train} and {n_test}."
        )
    train_stream, test_stream = np.random.default_rng(seed).spawn(2)
    train, test = _draw(task, n_train, train_stream), _draw(task, n_test, test_stream)
    inputs, starts = np.asarray(task.input_values), np.concatenate([train, test])
    free = np.zeros((n_train, inputs.shape[1]))
    paths = _solve(
        task,
        np.concatenate([np.tile(starts, (len(inputs), 1)), train]),
        np.concatenate([np.repeat(inputs, len(starts), axis=0), free]),
    )
    driven = paths[:-n_train, : task.points].reshape(len(inputs), len(starts), task.points, -1)
    prediction = paths[-n_train:, : task.prediction_points]
    dataset = Dataset(
        name=task.name,
        space=task.space,
        train=_trajectories(task, "train-{:03d}-u{}", driven[:, :n_train], inputs),
        test=_trajectories(task, "test-{:03d}-u{}", driven[:, n_train:], inputs),
        momenta=task.system.momenta,
        position_names=task.position_names,
        input_names=task.input_names,
        position_units=task.system.space.units,
    )
    return TaskData(dataset=dataset, prediction=_trajectories(task, "prediction-{:03d}", prediction[None], free[:1]))


def _draw(task: Task, count: int, generator: np.random.Generator) -> Float[np.ndarray, "k x"]:
    """Draw initial conditions (q, rates)."""
    low, high = np.asarray(task.position_bounds + task.rate_bounds).T
    return generator.uniform(low, high, (count, len(low)))


def _solve(
    task: Task, starts: Float[np.ndarray, "k x"], inputs: Float[np.ndarray, "k m"]
) -> Float[np.ndarray, "k T x"]:
    """Simulate a batch of initial conditions (q, rates), each under its constant input, for as long as any is used."""
    with jax.enable_x64():
        ts = jnp.asarray(task.dt * np.arange(max(task.points, task.prediction_points)))
        return np.asarray(_rollouts(task.system, jnp.asarray(starts), jnp.asarray(inputs), ts))


@jax.jit
def _rollouts(
    system: AbstractMechanical,
    starts: Float[jax.Array, "k x"],
    inputs: Float[jax.Array, "k m"],
    ts: Float[jax.Array, " T"],
) -> Float[jax.Array, "k T x"]:
    """Roll out a batch; the system's parameters are arguments, so that equal systems share the compiled program."""

    def one(start: Float[jax.Array, " x"], u: Float[jax.Array, " m"]) -> Float[jax.Array, "T x"]:
        q, rates = jnp.split(start, 2)
        path = rollout(system, q, rates, ts, jnp.broadcast_to(u, (len(ts), len(u))), solver=_SOLVER)
        return jnp.concatenate([path.q, path.rates], axis=1)

    return jax.vmap(one)(starts, inputs)


def _trajectories(
    task: Task, name: str, paths: Float[np.ndarray, "j k T x"], inputs: Float[np.ndarray, "j m"]
) -> tuple[Trajectory, ...]:
    """Name the paths, for each input those from each initial condition."""
    points = paths.shape[2]
    ts = task.dt * np.arange(points)
    return tuple(
        Trajectory(name=name.format(i, j), ts=ts, q=q, rates=rates, us=np.tile(inputs[j], (points, 1)))
        for j, group in enumerate(paths)
        for i, (q, rates) in enumerate(np.split(path, 2, axis=1) for path in group)
    )
