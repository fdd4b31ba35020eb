"""Recordings of a pendulum that something pushes which is not among its inputs."""

import jax
import jax.numpy as jnp
import numpy as np

from symoden.data import Dataset, Trajectory
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, ModelConfig
from symoden.systems import Pendulum

STEP, SIZE = 0.02, 500
SYSTEM = Pendulum(damping=0.2)
MODEL = ModelConfig(
    inverse_mass=BlockConfig(constant=True),
    potential=BlockConfig(harmonics=True),
    actuation=BlockConfig(constant=True),
    friction=BlockConfig(constant=True),
    knees=(),
)


def swing(name, generator, pushes=(), noise=0.0):
    """A recording, and pushes [N m] from one row to another that it does not have among its inputs."""
    ts = STEP * np.arange(SIZE)
    phase, pace = generator.uniform(0, 6, 3), generator.uniform(0.5, 3, 3)
    us = 2 * np.sin(pace * ts[:, None] + phase).sum(axis=1, keepdims=True)
    push = np.zeros_like(us)
    for first, last, size in pushes:
        push[first:last] += size
    with jax.enable_x64(True):
        path = rollout(SYSTEM, *map(jnp.asarray, (np.zeros(1), np.zeros(1), ts, us + push)), solver=RK4(4))
        q, v = (np.asarray(each) + noise * generator.normal(size=each.shape) for each in (path.q, path.rates))
    return Trajectory(name=name, ts=ts + 100.0, q=q, rates=v, us=us)


def swings(seed, pushes, noise=1e-3, count=3):
    generator = np.random.default_rng(seed)
    train = tuple(swing(f"run{k}", generator, pushes.get(k, ()), noise) for k in range(count))
    return Dataset(name="runs", space="T1", train=train)
