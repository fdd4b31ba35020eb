"""A task with fewer, more or noisy training trajectories."""

import dataclasses
import math

import numpy as np

from symoden.data import Trajectory

from ._simulate import TaskData, simulate
from ._tasks import Task

_CHOICE, _NOISE = 1, 2  # Streams of their own, so that neither changes the other or the initial conditions.


def simulate_variant(task: Task, *, seed: int = 0, trajectories: int | None = None, noise: float = 0.0) -> TaskData:
    """Simulate a task, and change what is learned from; test and prediction stay as they are.

    Trajectories are chosen at random, those of a smaller number being among those of a larger one. Noise is Gaussian,
    on every coordinate and rate, and that of a trajectory does not depend on which others are chosen.

    Args:
        task: The task.
        seed: Seed of the initial conditions, the choice and the noise.
        trajectories: Number of training trajectories; all of the task's own if None.
        noise: Standard deviation of the noise, in the units of each column.

    Returns:
        The trajectories.

    Raises:
        ValueError: If a number is out of range.

    Example:
        >>> from symoden.experiments import task
        >>> [path.name for path in simulate_variant(task("pendulum"), trajectories=2).dataset.train]
        ['train-015-u2', 'train-010-u3']
    """
    refuse_variant(trajectories, noise)
    inputs = len(task.input_values)
    initials = task.n_train if trajectories is None else max(task.n_train, -(-trajectories // inputs))
    data = simulate(task, seed=seed, train_initials=initials)
    where = range(inputs * initials) if trajectories is None else _chosen(task, seed, trajectories, initials)
    train = tuple(data.dataset.train[k] for k in where)
    if noise:
        streams = ((seed, _NOISE, k % initials, k // initials) for k in where)
        train = tuple(_noisy(path, noise, entropy) for path, entropy in zip(train, streams, strict=True))
    dataset = dataclasses.replace(data.dataset, train=train)
    return TaskData(dataset=dataset, prediction=data.prediction[: task.n_train])


def refuse_variant(trajectories: int | None, noise: float) -> None:
    """Refuse numbers that no variant of a task can have.

    Args:
        trajectories: Number of training trajectories; all of the task's own if None.
        noise: Standard deviation of the noise.

    Raises:
        ValueError: If a number is out of range.
    """
    if trajectories is not None and trajectories < 1:
        raise ValueError(f"The number of training trajectories must be at least 1; got {trajectories}.")
    if not (math.isfinite(noise) and noise >= 0):
        raise ValueError(f"The standard deviation of noise must be at least 0 and finite; got {noise}.")


def _chosen(task: Task, seed: int, count: int, initials: int) -> list[int]:
    """Indices of the chosen trajectories: the task's own at random, then those of further initial conditions."""
    inputs = len(task.input_values)
    shuffled = np.random.default_rng((seed, _CHOICE)).permutation(inputs * task.n_train)
    own = [(int(k) % task.n_train, int(k) // task.n_train) for k in shuffled]
    further = [(i, j) for i in range(task.n_train, initials) for j in range(inputs)]
    return sorted(j * initials + i for i, j in (own + further)[:count])


def _noisy(path: Trajectory, noise: float, entropy: tuple[int, ...]) -> Trajectory:
    """The trajectory as a noisy instrument would record it."""
    q, rates = np.random.default_rng(entropy).normal(scale=noise, size=(2, *path.q.shape))
    return dataclasses.replace(path, q=path.q + q, rates=path.rates + rates)
