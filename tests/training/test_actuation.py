"""An input that acts otherwise from configuration to configuration is found where there is one, and only there."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import ACTUATION
from symoden.data import Dataset, Trajectory
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig, fit
from symoden.training._flatten import freed

MODEL = ModelConfig(
    inverse_mass=BlockConfig(constant=True),
    actuation=BlockConfig(hidden=(3,), constant=True),
    friction=BlockConfig(constant=True),
    knees=(),
)
CONFIG = TrainingConfig(adam_steps=0, lm_steps=10, growth_steps=12, relevance_steps=0, lm_horizon=20, lm_substeps=2)
STEP, FINE, VISCOUS, NOISE = 0.02, 10, 0.1, 0.003


def pushed(level, *, count=4, samples=300):
    """A pendulum of unit mass and length under a torque, or under a horizontal force at its end, seen with noise."""
    generator, recordings = np.random.default_rng(0), []
    for k in range(count):
        ts = STEP * np.arange(samples)
        paces, phases = generator.uniform(1.0, 4.0, 3), generator.uniform(0.0, 6.0, 3)
        us = np.sin(paces * ts[:, None] + phases).sum(axis=1)
        q, v, path = 0.5, 0.0, []
        for u in us:
            path.append((q, v))
            for _ in range(FINE):
                middle = v + STEP / FINE / 2 * accelerate(level, q, v, u)
                between = q + STEP / FINE / 2 * v
                q, v = q + STEP / FINE * middle, v + STEP / FINE * accelerate(level, between, middle, u)
        motion = np.array(path) + NOISE * generator.standard_normal((samples, 2))
        recordings.append(Trajectory(name=f"run{k}", ts=ts, q=motion[:, :1], rates=motion[:, 1:], us=us[:, None]))
    return Dataset(name="pendulum", space="T1", train=tuple(recordings))


def accelerate(level, q, v, u):
    return (np.cos(q) if level else 1.0) * u - 2.0 * np.sin(q) - VISCOUS * v


@pytest.mark.parametrize(("level", "kinds", "verdict"), [(True, ACTUATION, "kept"), (False, 0, "not kept")])
def test_a_force_that_turns_with_the_body_is_found_and_a_torque_stays_constant(level, kinds, verdict):
    result = fit(pushed(level), model=MODEL, config=CONFIG)
    found: Any = result.model
    assert result.verdicts["actuation"].startswith(verdict)
    assert freed(found) == kinds
    for angle in (-0.8, 0.0, 0.8):
        q = jnp.array([angle])
        gain = float((found.inverse_mass_matrix(q) @ found.input_matrix(q))[0, 0])
        assert gain == pytest.approx(np.cos(angle) if level else 1.0, rel=0.01)
