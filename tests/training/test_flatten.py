"""Models as vectors of their free parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import (
    ACTUATION,
    CORRECTIONS,
    DIRECTIONS,
    FRICTION,
    INERTIA,
    NETWORKS,
    POTENTIAL,
    Correction,
    Network,
    kinds_in_use,
    silenced,
    without_silent,
)
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.training._flatten import Flattening

FULL = ModelConfig(
    inverse_mass=BlockConfig(hidden=(3,), constant=True),
    potential=BlockConfig(hidden=(3,), harmonics=True),
    actuation=BlockConfig(hidden=(3,), constant=True),
    friction=BlockConfig(hidden=(3,), constant=True),
    knees=(0.1,),
)


def networks(model):
    leaves = jax.tree.leaves(model, is_leaf=lambda node: isinstance(node, Correction))
    return sum(isinstance(leaf, Correction) and isinstance(leaf.function, Network) for leaf in leaves)


@pytest.mark.parametrize("space", ["T1", "R1 T1", "R1"])
@pytest.mark.parametrize("corrections", [0, FRICTION, DIRECTIONS, FRICTION | ACTUATION])
def test_what_is_silent_is_left_out_and_nothing_changes(space, corrections):
    model = build(FULL, Space.parse(space), 1, key=jax.random.key(3))
    restore, theta = Flattening.of(model, corrections=corrections)
    lean, random = restore.lean(theta), np.random.default_rng(0)
    assert networks(model) > networks(lean(theta)) == 0
    turning = "T" in space and bool(corrections & ACTUATION)
    assert hasattr(lean(theta).actuation.function, "terms") == turning
    for _ in range(3):
        moved = theta + jnp.asarray(random.normal(size=theta.shape))
        state = jnp.asarray(random.normal(size=2 * model.space.size))
        whole, short = (each(moved).derivative(jnp.zeros(()), state, jnp.ones(1)) for each in (restore, lean))
        assert np.asarray(short) == pytest.approx(np.asarray(whole), rel=1e-12, abs=1e-12)
        assert Flattening.of(lean(moved), corrections=corrections)[1] == pytest.approx(moved)


def test_what_is_free_or_says_something_stays(small, scrambled):
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(3))
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)
    assert networks(restore.lean(theta)(theta)) == networks(model) > 0
    loud = scrambled(model, 1, 0.3)
    assert networks(without_silent(loud)) == networks(loud)


@pytest.mark.parametrize("space", ["T1", "R1 T1", "R2"])
def test_what_is_free_is_told_by_its_weights_whatever_its_value_at_some_place(space, scrambled):
    plain = build(ModelConfig(), Space.parse(space), 1, key=jax.random.key(3))
    assert kinds_in_use(plain) == 0
    loud, kinds = scrambled(plain, 1, 0.3), 0
    for kind in (FRICTION, DIRECTIONS, ACTUATION, NETWORKS, INERTIA, POTENTIAL):
        alone = silenced(loud, CORRECTIONS & ~kind)
        assert kinds_in_use(alone) in {0, kind}
        kinds |= kinds_in_use(alone)
    assert kinds == kinds_in_use(loud)
    assert bool(kinds_in_use(loud) & INERTIA) == ("T" in space)  # On "R1 T1" it is zero wherever the length is.


@pytest.mark.parametrize("space", ["T1", "R1 T1", "R2"])
@pytest.mark.parametrize("closed", [0, POTENTIAL, FRICTION | DIRECTIONS, NETWORKS, CORRECTIONS])
def test_corrections_are_closed_by_their_kinds(space, closed, scrambled):
    plain = build(FULL, Space.parse(space), 1, key=jax.random.key(3))
    loud = scrambled(plain, 1, 0.3)
    assert kinds_in_use(loud) & closed or not closed
    assert kinds_in_use(silenced(loud, closed)) == kinds_in_use(loud) & ~closed
    restore, theta = Flattening.of(silenced(loud, closed), corrections=0)
    assert theta == pytest.approx(Flattening.of(loud, corrections=0)[1])  # All else stays as it is.
    state = jnp.linspace(0.3, 0.9, 2 * plain.space.size)
    lean = without_silent(restore(theta))
    expected = silenced(loud, closed).derivative(jnp.zeros(()), state, jnp.ones(1))
    assert np.asarray(lean.derivative(jnp.zeros(()), state, jnp.ones(1))) == pytest.approx(np.asarray(expected))
