"""Friction that depends on the direction is found where there is such friction, and nowhere else."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import DIRECTIONS, FRICTION
from symoden.data import Dataset, Trajectory
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig, fit
from symoden.training._flatten import freed

MODEL = ModelConfig(friction=BlockConfig(constant=True), knees=(0.1,))
CONFIG = TrainingConfig(adam_steps=0, lm_steps=10, growth_steps=12, relevance_steps=0, lm_horizon=20, lm_substeps=2)
DRY, VISCOUS, KNEE = 0.5, 0.2, 0.1
STEP, FINE = 0.02, 20


def braking(v, asymmetry):
    """Force of friction at a velocity: dry and viscous parts, the dry one larger forwards."""
    return DRY * (1 + asymmetry * np.tanh(v / KNEE)) * np.tanh(v / KNEE) + VISCOUS * v


def sledge(asymmetry, *, count=4, samples=300):
    """A unit mass on rails under smooth forces."""
    generator, recordings = np.random.default_rng(0), []
    for k in range(count):
        ts = STEP * np.arange(samples)
        paces, phases = generator.uniform(1.0, 4.0, 3), generator.uniform(0.0, 6.0, 3)
        us = np.sin(paces * ts[:, None] + phases).sum(axis=1)
        q, v, path = 0.0, 0.0, []
        for u in us:
            path.append((q, v))
            for _ in range(FINE):
                middle = v + STEP / FINE / 2 * (u - braking(v, asymmetry))
                q, v = q + STEP / FINE * middle, v + STEP / FINE * (u - braking(middle, asymmetry))
        motion = np.array(path)
        recordings.append(Trajectory(name=f"run{k}", ts=ts, q=motion[:, :1], rates=motion[:, 1:], us=us[:, None]))
    known = KnownParts(mass_matrix=[[1]], potential_energy="0", input_matrix=[[1]])
    return Dataset(name="sledge", space="R1", train=tuple(recordings), known=known)


@pytest.mark.parametrize(("asymmetry", "kinds"), [(0.4, FRICTION | DIRECTIONS), (0.0, FRICTION)])
def test_the_direction_of_friction_is_found_where_there_is_one(asymmetry, kinds):
    found: Any = fit(sledge(asymmetry), model=MODEL, config=CONFIG).model
    assert freed(found) == kinds
    for v in (-1.0, -0.5, 0.5, 1.0):
        force = float(found.dissipation_matrix(jnp.zeros(1), jnp.array([v]))[0, 0]) * v
        assert force == pytest.approx(braking(v, asymmetry), rel=0.03)
