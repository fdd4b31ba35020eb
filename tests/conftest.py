"""What tests of several folders need: models whose every weight is random."""

import dataclasses
import functools
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest

from symoden.blocks import trainable
from symoden.experiments import PAPER_ORDER, Contest, Source, Trained, simulate, task
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig

UNCHECKED = {
    "data": {
        "accuracy",
        "arrivals",
        "blind",
        "bridges",
        "check",
        "clocks",
        "contradictions",
        "false_cyclic",
        "feedback",
        "hold",
        "impossible",
        "input_signs",
        "kinematics",
        "late",
        "late_inputs",
        "lone_inputs",
        "masking",
        "read_dataset",
        "stuck",
        "velocities",
    },
    "training": {
        "actuation",
        "beginnings",
        "directions",
        "disturbances",
        "first_guess",
        "inertia",
        "known",
        "late_inputs",
        "left_out",
        "level",
        "potential",
        "regression",
        "trimmed",
        "uniform",
        "whitened_errors",
    },
}


@pytest.fixture(scope="module", autouse=True)
def _unchecked_annotations(request):
    """Check no annotations where whole data sets are read, or models trained, again and again: others check the same.

    There it takes 40 % of the time of tests of data, and an eighth of those of training.
    """
    before = jaxtyping.config.jaxtyping_disable
    folder = request.path.relative_to(Path(__file__).parent).parts[0]
    if request.path.stem.removeprefix("test_") in UNCHECKED.get(folder, ()):
        jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


@pytest.fixture
def single_use_keys():
    """Refuse a random key that is used twice; in every test it would take a tenth of the time."""
    with jax.debug_key_reuse(True):
        yield


@pytest.fixture(scope="session")
def scrambled():
    """Replace every trainable number of a model, frozen corrections and friction included, by seeded normal noise."""

    def scramble(model, seed, scale=1.0):
        generator = np.random.default_rng(seed)
        free, fixed = eqx.partition(model, trainable(model))
        noise = jax.tree.map(lambda x: jnp.asarray(scale * generator.standard_normal(x.shape), x.dtype), free)
        return eqx.combine(noise, fixed)

    return scramble


@pytest.fixture(scope="session")
def contest():
    """Untrained small models of a task with few trajectories; instead of the dissipative one, the true system."""

    @functools.cache
    def make(name, space=None, kinds=PAPER_ORDER):
        chosen, data = task(name), simulate(task(name), train_initials=3, test_initials=1)
        told = Space.parse(space or chosen.space)
        dataset = dataclasses.replace(data.dataset, space=str(told))
        small = BlockConfig(hidden=(3,))
        models: dict[str, AbstractDynamics] = {"dissipative": chosen.system}
        for k, kind in enumerate(PAPER_ORDER[:-1]):
            if kind in kinds and not (kind == "geometric" and dataset.momenta):
                config = ModelConfig(
                    kind=kind, flow=(3,), energy=(3,), inverse_mass=small, potential=small, actuation=small
                )
                models[kind] = build(config, told, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(k))
        return Contest(
            task=chosen,
            source=Source(name=name, dataset=dataset, task=chosen, prediction=data.prediction),
            space=space,
            preset="default",
            trained={kind: Trained(models[kind], RK4(8)) for kind in kinds if kind in models},
        )

    return make


@pytest.fixture(scope="session")
def tiny():
    """A preset that trains in a moment."""

    def preset(name, *, task, kind):
        del name, task
        plain = BlockConfig(constant=True)
        model = ModelConfig(
            kind=kind,
            inverse_mass=plain,
            potential=BlockConfig(hidden=(4,)),
            actuation=plain,
            friction=plain,
            flow=(4,),
        )
        return model, TrainingConfig(adam_steps=5, lm_steps=0, restarts=1, batch_size=16, validation=0.0)

    return preset
