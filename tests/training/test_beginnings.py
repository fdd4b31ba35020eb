"""A stage that begins without what another term may take the place of."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import FRICTION, POTENTIAL, kinds_in_use
from symoden.models import BlockConfig, ModelConfig, awaken, build
from symoden.spaces import Space
from symoden.training import _data
from symoden.training._beginnings import Without
from symoden.training._state import Report

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(
    inverse_mass=CONSTANT,
    potential=BlockConfig(hidden=(12,), harmonics=True),
    actuation=CONSTANT,
    friction=CONSTANT,
    knees=(0.1,),
)


@pytest.mark.parametrize("awake", [True, False])
def test_dry_friction_takes_the_place_of_a_network_of_lengths(awake, driven, second_order, stage):
    def accelerate(q, v, u):
        return u - 1.5 * v / np.sqrt(v**2 + 0.05**2)

    dataset = driven(accelerate, [0.0], space="R1", amplitude=3.0, noise=0.002, input_matrix=np.eye(1))
    dataset = _data.hold_out(dataset, second_order)
    model = build(MODEL, Space.parse("R1"), 1, input_matrix=np.eye(1), key=jax.random.key(0))
    model = awaken(model, key=jax.random.key(1)) if awake else model
    base, state = stage
    windows = _data.levenberg_data(dataset, model, second_order)
    stage = replace(base, data=windows, config=second_order, name="friction instead", steps=20, frees=True)
    stage = replace(stage, corrections=FRICTION, begins=Without(POTENTIAL), margin=0.0)
    state = state._replace(model=model, best=model, incumbent=state.incumbent._replace(model=model, rival=model))
    assert stage.applies(state) == awake
    if awake:
        state, report = stage.start(state), Report(0.0, None, finished=False)
        assert kinds_in_use(state.best) == 0
        while not report.finished:
            state, report = stage.advance(state)
        assert str(report.verdict).startswith("kept")
        assert kinds_in_use(state.best) == FRICTION
        slopes = jax.vmap(jax.grad(state.best.potential_energy))(jnp.linspace(-1.0, 1.0, 21)[:, None])
        assert np.abs(slopes).max() < 0.1  # Of 1.5 that friction takes.
