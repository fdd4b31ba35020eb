"""Small models of every kind, built once."""

import dataclasses

import jax
import numpy as np
import pytest

from symoden.models import BlockConfig, ModelConfig, Scales, build
from symoden.spaces import Space

CORRECTED = BlockConfig(hidden=(4,), constant=True)
NETWORK = BlockConfig(hidden=(5,))
JOINT = ModelConfig(
    inverse_mass=NETWORK, potential=NETWORK, actuation=CORRECTED, friction=CORRECTED, energy=(6,), flow=(6,)
)
VISCOUS = dataclasses.replace(JOINT, knees=())
FULL = dataclasses.replace(JOINT, knees=(), full_friction=True)


def uneven_scales(space, inputs):
    """Units that differ from one another, so that a mistaken one shows."""
    n, e = space.size, space.embedded_size
    center, spread = np.zeros(e), np.ones(e)
    lengths = len(space.lengths)
    center[:lengths], spread[:lengths] = 0.4, 1.7
    return Scales(
        center=center,
        spread=spread,
        velocity=1.3 + 0.4 * np.arange(n),
        momentum=0.6 + 0.3 * np.arange(n),
        input=0.8 + 0.5 * np.arange(inputs),
        time=0.7,
    )


def make(config, space="T1 R1", inputs=2, *, momenta=False, **changes):
    """A small model in uneven units."""
    config = dataclasses.replace(config, **changes)
    space = Space.parse(space)
    scales = uneven_scales(space, inputs) if config.scaled else None
    return build(config, space, inputs, momenta=momenta, scales=scales, key=jax.random.key(0))


@pytest.fixture(scope="session")
def small_model():
    """Small models by name."""
    models = {
        "joint": make(JOINT),
        "viscous": make(VISCOUS, "R1 T1 R1", 1),
        "full": make(FULL),
        "paper": make(FULL, scaled=False, activation="tanh", momenta=True),
        "frictionless": make(JOINT, "T2", 0, kind="symoden"),
        "unstructured": make(JOINT, kind="unstructured"),
        "unstructured-full": make(FULL, kind="unstructured"),
        "geometric": make(JOINT, kind="geometric"),
        "naive": make(JOINT, kind="naive"),
    }

    def find(name):  # A function, because hypothesis prints the fixtures of a failing test.
        return models[name]

    return find
