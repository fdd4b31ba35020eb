"""An input that acts otherwise from configuration to configuration is found where there is one, and only there."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import ACTUATION, kinds_in_use
from symoden.models import BlockConfig, ModelConfig
from symoden.training import fit

MODEL = ModelConfig(
    inverse_mass=BlockConfig(constant=True),
    actuation=BlockConfig(hidden=(3,), constant=True),
    friction=BlockConfig(constant=True),
    knees=(),
)
VISCOUS = 0.1


def pendulum(level):
    """Of unit mass and length, under a torque, or under a horizontal force at its end."""
    return lambda q, v, u: (np.cos(q) if level else 1.0) * u - 2.0 * np.sin(q) - VISCOUS * v


@pytest.mark.parametrize(
    ("level", "kinds", "verdict"),
    [(True, ACTUATION, "kept"), pytest.param(False, 0, "not kept", marks=pytest.mark.slow)],
)
def test_a_force_that_turns_with_the_body_is_found_and_a_torque_stays_constant(
    level, kinds, verdict, driven, second_order
):
    dataset = driven(pendulum(level), [0.5], space="T1", noise=0.003)
    result = fit(dataset, model=MODEL, config=second_order)
    found: Any = result.model
    assert result.verdicts["actuation"].startswith(verdict)
    assert kinds_in_use(found) == kinds
    for angle in (-0.8, 0.0, 0.8):
        q = jnp.array([angle])
        gain = float((found.inverse_mass_matrix(q) @ found.input_matrix(q))[0, 0])
        assert gain == pytest.approx(np.cos(angle) if level else 1.0, rel=0.01)
