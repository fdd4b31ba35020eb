"""An inertia that depends on a length is found where there is one, and only there."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import INERTIA, kinds_in_use
from symoden.models import BlockConfig, ModelConfig
from symoden.training import fit

MODEL = ModelConfig(
    inverse_mass=BlockConfig(harmonics=True),
    potential=BlockConfig(harmonics=True),
    friction=BlockConfig(constant=True),
    knees=(),
)
MASS, INERTIA_OF_ROD, VISCOUS, STIFFNESS = 0.5, 0.2, 0.3, 4.0


def inertia(bead, r):
    """That of a rod that turns about its middle and of a bead on it, or of one beside it, which it does not carry."""
    return INERTIA_OF_ROD + MASS * r**2 * bead


def turntable(bead):
    """A bead slides along a rod that turns; springs hold both, and both are pushed."""

    def accelerate(q, v, u):
        coupling = bead * MASS * q[0] * v[1]
        force = u[0] + coupling * v[1] - VISCOUS * v[0] - STIFFNESS * q[0]
        torque = u[1] - 2 * coupling * v[0] - VISCOUS * v[1] - np.sin(q[1])
        return np.array([force / MASS, torque / inertia(bead, q[0])])

    return accelerate


@pytest.mark.parametrize("bead", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_bead_on_a_rod_is_found_and_a_rod_alone_keeps_its_inertia(bead, driven, second_order):
    seen = {"amplitude": np.array([1.6, 0.8]), "noise": 0.002}
    dataset = driven(turntable(bead), [0.3, 0.0], space="R1 T1", input_matrix=np.eye(2), **seen)
    result = fit(dataset, model=MODEL, config=second_order)
    model: Any = result.model
    assert result.verdicts["inertia"].startswith("kept" if bead else "not kept")
    assert kinds_in_use(model) == (INERTIA if bead else 0)
    for r in (-0.5, 0.1, 0.7):
        found = np.asarray(model.mass_matrix(jnp.array([r, 1.0])))
        assert found == pytest.approx(np.diag([MASS, inertia(bead, r)]), abs=0.02)


def crank(eccentric):
    """What turns on one axis, with a rod and a piston on it or without; weight pulls it down, and it is pushed."""

    def accelerate(q, v, u):
        slope = eccentric * 0.15 * np.sin(2 * q[0])
        torque = u[0] - slope * v[0] ** 2 / 2 - VISCOUS * v[0] - np.sin(q[0])
        return np.array([torque / turning(eccentric, q[0])])

    return accelerate


def turning(eccentric, q):
    """Its inertia, the piston's by the square of how far it goes."""
    return INERTIA_OF_ROD + 0.15 * eccentric * np.sin(q) ** 2


@pytest.mark.parametrize("eccentric", [True, False])
def test_a_crank_is_found_and_a_pendulum_keeps_its_inertia(eccentric, driven, second_order):
    dataset = driven(
        crank(eccentric), [0.3], space="T1", input_matrix=np.eye(1), amplitude=np.array([1.6]), noise=0.002
    )
    result = fit(dataset, model=MODEL, config=second_order)
    model: Any = result.model
    assert result.verdicts["inertia"].startswith("kept" if eccentric else "not kept")
    assert kinds_in_use(model) == (INERTIA if eccentric else 0)
    for q in (-1.0, 0.1, 1.2):
        assert float(model.mass_matrix(jnp.array([q]))[0, 0]) == pytest.approx(turning(eccentric, q), abs=0.02)
