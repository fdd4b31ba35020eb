"""An inertia that depends on a length is found where there is one, and only there."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import INERTIA
from symoden.data import Dataset, Trajectory
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig, fit
from symoden.training._flatten import freed

MODEL = ModelConfig(
    inverse_mass=BlockConfig(harmonics=True),
    potential=BlockConfig(harmonics=True),
    friction=BlockConfig(constant=True),
    knees=(),
)
CONFIG = TrainingConfig(adam_steps=0, lm_steps=10, growth_steps=12, relevance_steps=0, lm_horizon=20, lm_substeps=2)
STEP, FINE, MASS, INERTIA_OF_ROD, VISCOUS, STIFFNESS, NOISE = 0.02, 10, 0.5, 0.2, 0.3, 4.0, 0.002


def inertia(bead, r):
    """That of a rod that turns about its middle and of a bead on it, or of one beside it, which it does not carry."""
    return INERTIA_OF_ROD + MASS * r**2 * bead


def turned(bead, *, count=4, samples=300):
    """A bead slides along a rod that turns; springs hold both, both are pushed, and seen with noise."""
    generator, recordings = np.random.default_rng(0), []
    for k in range(count):
        ts = STEP * np.arange(samples)
        paces, phases = generator.uniform(1.0, 4.0, (3, 2)), generator.uniform(0.0, 6.0, (3, 2))
        us = np.array([1.6, 0.8]) * np.sin(paces[:, None] * ts[:, None] + phases[:, None]).sum(axis=0)
        q, v, path = np.array([0.3, 0.0]), np.zeros(2), []
        for u in us:
            path.append((q, v))
            for _ in range(FINE):
                middle = v + STEP / FINE / 2 * accelerate(bead, q, v, u)
                between = q + STEP / FINE / 2 * v
                q, v = q + STEP / FINE * middle, v + STEP / FINE * accelerate(bead, between, middle, u)
        seen = np.array(path) + NOISE * generator.standard_normal((samples, 2, 2))
        recordings.append(Trajectory(name=f"run{k}", ts=ts, q=seen[:, 0], rates=seen[:, 1], us=us))
    return Dataset(name="turntable", space="R1 T1", train=tuple(recordings), input_matrix=np.eye(2))


def accelerate(bead, q, v, u):
    """The motion's equations by hand."""
    coupling = bead * MASS * q[0] * v[1]
    force = u[0] + coupling * v[1] - VISCOUS * v[0] - STIFFNESS * q[0]
    torque = u[1] - 2 * coupling * v[0] - VISCOUS * v[1] - np.sin(q[1])
    return np.array([force / MASS, torque / inertia(bead, q[0])])


@pytest.mark.parametrize("bead", [True, False])
def test_a_bead_on_a_rod_is_found_and_a_rod_alone_keeps_its_inertia(bead):
    result = fit(turned(bead), model=MODEL, config=CONFIG)
    model: Any = result.model
    assert result.verdicts["inertia"].startswith("kept" if bead else "not kept")
    assert freed(model) == (INERTIA if bead else 0)
    for r in (-0.5, 0.1, 0.7):
        found = np.asarray(model.mass_matrix(jnp.array([r, 1.0])))
        assert found == pytest.approx(np.diag([MASS, inertia(bead, r)]), abs=0.02)
