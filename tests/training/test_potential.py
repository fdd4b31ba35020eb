"""What springs store is told by a few numbers, and another energy of lengths by a network where it is needed."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import POTENTIAL, Polynomial
from symoden.data import Dataset, Trajectory
from symoden.models import BlockConfig, ModelConfig, awaken, build
from symoden.spaces import Space
from symoden.training import TrainingConfig, fit
from symoden.training._flatten import freed

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(
    inverse_mass=CONSTANT,
    potential=BlockConfig(hidden=(12,), harmonics=True),
    actuation=CONSTANT,
    friction=CONSTANT,
    knees=(),
)
CONFIG = TrainingConfig(adam_steps=0, lm_steps=20, growth_steps=0, relevance_steps=0, lm_horizon=20, lm_substeps=2)
STEP, FINE, VISCOUS = 0.02, 10, 0.2


def driven(slope, *, size=1, amplitude=1.5, count=4, samples=300):
    """Unit masses in a potential of this slope, each pushed by an input of its own."""
    generator, recordings = np.random.default_rng(0), []
    for k in range(count):
        ts = STEP * np.arange(samples)
        paces, phases = generator.uniform(0.5, 3.0, (3, size)), generator.uniform(0.0, 6.0, (3, size))
        us = amplitude * np.sin(paces[:, None] * ts[:, None] + phases[:, None]).sum(axis=0)
        q, v, path = generator.uniform(-0.5, 0.5, size), np.zeros(size), []
        for u in us:
            path.append((q, v))
            for _ in range(FINE):
                middle = v + STEP / FINE / 2 * (u - VISCOUS * v - slope(q))
                v = v + STEP / FINE * (u - VISCOUS * middle - slope(q + STEP / FINE / 2 * v))
                q = q + STEP / FINE * middle
        seen = np.array(path)
        recordings.append(Trajectory(name=f"run{k}", ts=ts, q=seen[:, 0], rates=seen[:, 1], us=us))
    return Dataset(name="springs", space=f"R{size}", train=tuple(recordings), input_matrix=np.eye(size))


def springs(q):
    """A spring to the wall, and one between two masses that hardens."""
    apart = q[1] - q[0]
    force = 4.0 * apart + 6.0 * apart**3
    return np.array([5.0 * q[0] - force, force])


def worst(model, slope, low, high):
    """Largest error of the force, relative to the largest force, at configurations within bounds."""
    q = np.random.default_rng(1).uniform(low, high, (100, len(low)))
    found = np.asarray(jax.vmap(jax.grad(model.potential_energy))(jnp.asarray(q)))
    true = np.array([slope(each) for each in q])
    return np.abs(found - true).max() / np.abs(true).max()


def test_springs_that_harden_are_told_beyond_the_data_too():
    dataset = driven(springs, size=2)
    reach = np.max([np.abs(each.q).max(axis=0) for each in dataset.train], axis=0)
    model: Any = fit(dataset, model=MODEL, config=CONFIG).model
    assert worst(model, springs, -1.5 * reach, 1.5 * reach) < 1e-3


def wavy(q):
    """The slope of a spring among magnets."""
    return 5.0 * q + 4.0 * np.sin(5.0 * q)


@pytest.mark.parametrize(("slope", "kinds"), [(wavy, POTENTIAL), (lambda q: 3.0 * q, 0)])
def test_a_network_is_set_free_where_no_polynomial_will_do(slope, kinds):
    dataset = driven(slope, amplitude=3.0)
    result = fit(dataset, model=MODEL, config=TrainingConfig(**{**vars(CONFIG), "growth_steps": 20}))
    assert freed(result.model) == kinds
    low, high = (f([f(each.q) for each in dataset.train]) for f in (np.min, np.max))
    assert worst(result.model, slope, [low], [high]) < 0.05


@pytest.mark.parametrize("space", ["R2", "R1 T1"])
def test_only_a_network_of_lengths_is_awoken(space):
    model: Any = build(MODEL, Space.parse(space), 1, key=jax.random.key(0))
    awake: Any = awaken(model, key=jax.random.key(1))
    assert freed(model) == 0
    assert freed(awake) == (POTENTIAL if space == "R2" else 0)
    assert isinstance(model.potential.function.terms[0], Polynomial) == (space == "R2")
    assert jax.tree.structure(awake) == jax.tree.structure(model)
