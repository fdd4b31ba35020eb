"""Friction that depends on the direction is found where there is such friction, and nowhere else."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import DIRECTIONS, FRICTION, kinds_in_use
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig
from symoden.training import fit

MODEL = ModelConfig(friction=BlockConfig(constant=True), knees=(0.1,))
DRY, VISCOUS, KNEE = 0.5, 0.2, 0.1


def braking(v, asymmetry):
    """Force of friction at a velocity: dry and viscous parts, the dry one larger forwards."""
    return DRY * (1 + asymmetry * np.tanh(v / KNEE)) * np.tanh(v / KNEE) + VISCOUS * v


@pytest.mark.parametrize(("asymmetry", "kinds"), [(0.4, FRICTION | DIRECTIONS), (0.0, FRICTION)])
def test_the_direction_of_friction_is_found_where_there_is_one(asymmetry, kinds, driven, second_order):
    known = KnownParts(mass_matrix=[[1]], potential_energy="0", input_matrix=[[1]])
    sledge = driven(lambda q, v, u: u - braking(v, asymmetry), [0.0], space="R1", known=known)
    found: Any = fit(sledge, model=MODEL, config=second_order).model
    assert kinds_in_use(found) == kinds
    for v in (-1.0, -0.5, 0.5, 1.0):
        force = float(found.dissipation_matrix(jnp.zeros(1), jnp.array([v]))[0, 0]) * v
        assert force == pytest.approx(braking(v, asymmetry), rel=0.03)
