"""Episodes of an environment as a data set to learn from."""

import dataclasses
import itertools
import warnings
from typing import Any

import gymnasium
import numpy as np

from symoden.data import DataError, Dataset, DataWarning, Trajectory
from symoden.spaces import Space

from ._policies import Policy, limits_of, random_levels
from ._sensors import Sensors, sensors_of


def record(
    env: gymnasium.Env,
    episodes: int = 20,
    *,
    test_episodes: int = 0,
    steps: int = 500,
    policy: Policy | None = None,
    sensors: Sensors | None = None,
    seed: int = 0,
    past_end: bool = False,
) -> Dataset:
    """Record episodes of an environment with continuous actions.

    Inputs are the actions as clipped to their limits, each held until the next sample. A recording ends with its
    episode, or where the `sensors` say that the motion is no longer the mechanism's own.

    Args:
        env: The environment.
        episodes: Number of episodes to learn from.
        test_episodes: Number of episodes after these for the final score.
        steps: Largest number of steps in an episode.
        policy: From what the environment shows to an action; `random_levels` between the limits if absent.
        sensors: How positions and velocities are read; those that `sensors_of` knows if absent.
        seed: Seed of the environment and of the default policy.
        past_end: Go on where the environment calls the episode `terminated`, which says that a task has failed, not
            that the mechanism has changed.

    Returns:
        The recordings, `episode-000`, `episode-001`, …; `symoden.data.write_dataset` makes files of them.

    Raises:
        ValueError: If the actions have no limits, the motion cannot be read, or a number is out of range.
        DataError: If every episode ended before its first step.

    Warns:
        DataWarning: If some did.

    Example:
        >>> import gymnasium, symoden.envs
        >>> data = record(gymnasium.make("symoden/DampedPendulum-v0"), 2)
        >>> data.name, data.space, len(data.train), len(data.train[0])
        ('DampedPendulum-v0', 'T1', 2, 201)
    """
    if episodes < 1 or test_episodes < 0 or steps < 1:
        raise ValueError(
            f"There must be at least 1 episode, 0 test episodes, 1 step; got {episodes}, {test_episodes} and {steps}."
        )
    limits_of(env.action_space)
    chosen = sensors_of(env) if sensors is None else sensors
    acts = random_levels(env.action_space, dt=chosen.dt, seed=seed) if policy is None else policy
    count, found = episodes + test_episodes, []
    for k in range(count):
        seen = env.reset(seed=None if k else seed)
        found.append(_episode(env, seen, acts, chosen, steps=steps, past_end=past_end))
    train, test = (
        tuple(dataclasses.replace(each, name=f"episode-{k:03d}") for k, each in enumerate(found) if each and k in part)
        for part in (range(episodes), range(episodes, count))
    )
    name = env.spec.id.split("/")[-1] if env.spec else type(env.unwrapped).__name__
    if not train:
        raise DataError(
            f"`{name}`: an episode must last for a step within the mechanism's own motion; none of {episodes} did. "
            "Record with `past_end=True`, a gentler `policy`, or `sensors` of your own."
        )
    if None in found:
        message = f"`{name}`: {found.count(None)} of {count} episodes ended before their first step; left out."
        warnings.warn(message, DataWarning, stacklevel=2)
    hold = "linear" if chosen.staggered else "zero"
    return Dataset(name=name, space=chosen.space, train=train, test=test, momenta=chosen.momenta, hold=hold)


def _episode(
    env: gymnasium.Env,
    seen: tuple[Any, dict[str, Any]],
    policy: Policy,
    sensors: Sensors,
    *,
    steps: int,
    past_end: bool,
) -> Trajectory | None:
    """What follows after a reset has shown something; nothing if there are no two samples."""
    low, high = limits_of(env.action_space)
    observation, info = seen
    readings, us = [sensors.read(env, observation, info)], []
    ended = False
    while readings[-1] is not None and not ended and len(us) < steps:
        u = np.clip(np.asarray(policy(observation), np.float64), low, high).astype(env.action_space.dtype)
        observation, _, terminated, truncated, info = env.step(u)
        readings.append(sensors.read(env, observation, info))
        us.append(u)
        ended = truncated or (terminated and not past_end)
    kept = [reading for reading in readings if reading is not None]
    if sensors.staggered:
        ahead = [(np.add(v, later) / 2) for (_, v), (_, later) in itertools.pairwise(kept)]
        kept = [(q, v) for (q, _), v in zip(kept, ahead, strict=False)]
    if len(kept) < 2:
        return None
    q, rates = (np.array(column, np.float64) for column in zip(*kept, strict=True))
    angles = Space.parse(sensors.space).angles
    q[:, angles] = np.unwrap(q[:, angles], axis=0)
    acted = np.array([*us, us[-1]], np.float64)[: len(kept)]  # none acts from the last sample on
    return Trajectory(name="episode", ts=sensors.dt * np.arange(len(kept)), q=q, rates=rates, us=acted)
