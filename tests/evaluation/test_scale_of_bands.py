"""The scale that bands hold fixed where nothing tells it."""

import equinox as eqx
import jax
import numpy as np
import pytest

from symoden.evaluation import Ranges, certainty, inspect_model
from symoden.experiments import simulate, task
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig, infer_posterior

CONSTANT = BlockConfig(constant=True)
STEPS = TrainingConfig(lm_steps=1, growth_steps=0, relevance_steps=0)


def test_bands_do_not_depend_on_how_many_values_are_shown():
    """Where M bends, a scale that is a mean over the values shown would."""
    dataset = simulate(task("pendulum"), train_initials=4, test_initials=1).dataset
    bent = ModelConfig(
        inverse_mass=BlockConfig(harmonics=True), potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT, knees=()
    )
    model = build(bent, Space.parse("T1"), 1, key=jax.random.key(0))
    arrays, rest = eqx.partition(model, lambda leaf: eqx.is_inexact_array(leaf) and leaf.ndim > 1)
    model = eqx.combine(jax.tree.map(lambda leaf: leaf + 0.3, arrays), rest)
    posterior, ranges = infer_posterior(model, dataset, STEPS), Ranges.of(dataset.train, model.space)
    few, many = (certainty(posterior, inspect_model(model, ranges, points=k)).profiles[0] for k in (3, 9))
    assert few.mass_matrix is not None
    assert many.mass_matrix is not None
    assert np.ptp(many.mass_matrix) > 1e-3 * many.mass_matrix.max()
    assert few.mass_matrix == pytest.approx(many.mass_matrix[::4], rel=1e-6)
