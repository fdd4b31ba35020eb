"""Where M and V are given, g begins with what a regression finds."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.known import KnownParts
from symoden.models import BlockConfig, build
from symoden.spaces import Space
from symoden.systems import LinkChain
from symoden.training._data import hold_out, regression_data
from symoden.training._first_inputs import learns_inputs, regress_inputs, with_inputs
from symoden.training._fit import _prepare
from symoden.training._flatten import cast
from symoden.training._line_up import line_up

CHAIN = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.1)  # Of the recordings.
MIXED = np.array([[2.0, -0.5, 0.0], [0.0, -3.0, 0.0], [0.0, 0.4, 0.25]])


@pytest.fixture(scope="module")
def mixed(swings):
    """The chain's recordings under inputs of other signs and units, one of which acts on three joints."""
    dataset = swings()
    inverse = np.linalg.inv(MIXED)
    recordings = tuple(dataclasses.replace(each, us=each.us @ inverse.T) for each in dataset.train)
    return dataclasses.replace(dataset, train=recordings)


def known(weight, **others):
    return KnownParts(
        mass_matrix=lambda q: weight * CHAIN.mass_matrix(q),
        potential_energy=lambda q: weight * CHAIN.potential_energy(q),
        **others,
    )


def regressed(dataset, model, config):
    with jax.enable_x64(True):
        windows = regression_data(dataset, model, config)
        assert windows is not None
        return regress_inputs(cast(model, jnp.float64), windows)


def built(dataset, model, **parts):
    space = Space.parse(dataset.space)
    return build(model, space, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(0), **parts)


@pytest.mark.parametrize("weight", [1.0, 0.3])
@pytest.mark.parametrize("damping", [None, 0.1])
def test_it_is_that_of_the_recordings_in_the_unit_of_the_weights(mixed, plain, quick, weight, damping):
    friction = {} if damping is None else {"dissipation_matrix": weight * damping * np.eye(3)}
    found = regressed(mixed, built(mixed, plain, known=known(weight, **friction)), quick)
    assert found == pytest.approx(weight * MIXED, abs=0.02 * weight * np.abs(MIXED).max())


def test_training_begins_with_it(mixed, plain, quick):
    asks = dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True))
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):
        begun: Any = _prepare(dataclasses.replace(mixed, known=known(1.0)), asks, quick)[1].model
    q = np.random.default_rng(0).normal(size=3)
    assert np.asarray(begun.input_matrix(q)) == pytest.approx(MIXED, abs=0.1)
    exact: Any = with_inputs(built(mixed, asks, known=known(1.0)), MIXED)
    assert np.asarray(exact.input_matrix(jnp.asarray(q, float))) == pytest.approx(MIXED, rel=1e-5)


def test_what_nothing_tells_is_zero(mixed, plain, quick):
    silent = tuple(dataclasses.replace(each, us=np.concatenate([each.us, 0 * each.us], axis=1)) for each in mixed.train)
    dataset = dataclasses.replace(mixed, train=silent, input_names=())
    found = regressed(dataset, built(dataset, plain, known=known(1.0)), quick)
    assert np.all(found[:, 3:] == 0)
    assert found[:, :3] == pytest.approx(MIXED, abs=0.1)


def test_it_is_for_given_energies_and_inputs_that_are_not(mixed, plain):
    network = dataclasses.replace(plain, scaled=False, actuation=BlockConfig(hidden=(3,)))
    energy = KnownParts(potential_energy=CHAIN.potential_energy)
    momenta = dataclasses.replace(mixed, momenta=True)
    assert learns_inputs(built(mixed, plain, known=known(1.0)))
    for dataset, model, parts in (
        (mixed, plain, None),
        (mixed, plain, energy),
        (mixed, plain, known(1.0, input_matrix=MIXED)),
        (momenta, plain, known(1.0)),
        (mixed, network, known(1.0)),
    ):
        assert not learns_inputs(built(dataset, model, known=parts))


def test_inputs_that_turn_are_not_asked_for_anew_where_nothing_was_bent_around_them(mixed, plain, quick):
    model = dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True))
    held = hold_out(mixed, quick)
    for parts, wanted in ((None, True), (known(1.0), False)):
        names = [stage.name for stage in line_up(held, built(held, model, known=parts), (), quick)]
        assert "regression: actuation" in names
        assert ("regression: actuation anew" in names) == wanted
