"""What tests of several folders need: models whose every weight is random."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import trainable


@pytest.fixture(scope="session")
def scrambled():
    """Replace every trainable number of a model, frozen corrections and friction included, by seeded normal noise."""

    def scramble(model, seed, scale=1.0):
        generator = np.random.default_rng(seed)
        free, fixed = eqx.partition(model, trainable(model))
        noise = jax.tree.map(lambda x: jnp.asarray(scale * generator.standard_normal(x.shape), x.dtype), free)
        return eqx.combine(noise, fixed)

    return scramble
