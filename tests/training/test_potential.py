"""What springs and gravity store is told by a few numbers, and another energy is found where there is one."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import FRICTION, POTENTIAL, Polynomial, kinds_in_use
from symoden.models import BlockConfig, ModelConfig, awaken, build
from symoden.spaces import Space
from symoden.training import fit

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(
    inverse_mass=CONSTANT,
    potential=BlockConfig(hidden=(12,), harmonics=True),
    actuation=CONSTANT,
    friction=CONSTANT,
    knees=(),
)
VISCOUS = 0.2


def masses(slope):
    """Unit masses in a potential of this slope."""
    return lambda q, v, u: u - VISCOUS * v - slope(q)


def springs(q):
    """A spring to the wall, and one between two masses that hardens."""
    apart = q[1] - q[0]
    force = 4.0 * apart + 6.0 * apart**3
    return np.array([5.0 * q[0] - force, force])


def worst(model, slope, low, high):
    """Largest error of the force, relative to the largest force, at configurations within bounds."""
    q = np.random.default_rng(1).uniform(low, high, (100, len(low)))
    found = np.asarray(jax.vmap(jax.grad(model.potential_energy))(jnp.asarray(q)))
    true = np.array([slope(each) for each in q])
    return np.abs(found - true).max() / np.abs(true).max()


def test_springs_that_harden_are_told_beyond_the_data_too(driven, second_order):
    dataset = driven(masses(springs), [0.0, 0.0], space="R2", amplitude=1.5, fastest=3.0, input_matrix=np.eye(2))
    reach = np.max([np.abs(each.q).max(axis=0) for each in dataset.train], axis=0)
    model: Any = fit(dataset, model=MODEL, config=replace(second_order, lm_steps=20, growth_steps=0)).model
    assert worst(model, springs, -1.5 * reach, 1.5 * reach) < 1e-3


def wavy(q):
    """The slope of a spring among magnets."""
    return 5.0 * q + 4.0 * np.sin(5.0 * q)


@pytest.mark.parametrize(("slope", "kinds"), [(wavy, POTENTIAL), (lambda q: 3.0 * q, 0)])
def test_a_network_is_set_free_where_no_polynomial_will_do(slope, kinds, driven, second_order):
    dataset = driven(masses(slope), [0.0], space="R1", amplitude=3.0, fastest=3.0, input_matrix=np.eye(1))
    result = fit(dataset, model=MODEL, config=replace(second_order, lm_steps=20, growth_steps=40))
    assert kinds_in_use(result.model) == kinds
    low, high = (f([f(each.q) for each in dataset.train]) for f in (np.min, np.max))
    assert worst(result.model, slope, [low], [high]) < 0.05


@pytest.mark.parametrize("space", ["R2", "R1 T1"])
def test_only_a_network_of_lengths_is_awoken(space):
    model: Any = build(MODEL, Space.parse(space), 1, key=jax.random.key(0))
    awake: Any = awaken(model, key=jax.random.key(1))
    assert kinds_in_use(model) == 0
    assert kinds_in_use(awake) == (POTENTIAL if space == "R2" else 0)
    assert isinstance(model.potential.function.terms[0], Polynomial) == (space == "R2")
    assert jax.tree.structure(awake) == jax.tree.structure(model)


def detents(q):
    """The slope of a pendulum's energy with six detents."""
    return 2.0 * np.sin(q) + 1.5 * np.sin(6.0 * q)


@pytest.mark.parametrize(
    ("slope", "kinds"), [(detents, POTENTIAL), pytest.param(lambda q: 2.0 * np.sin(q), 0, marks=pytest.mark.slow)]
)
def test_harmonics_of_single_angles_are_found_where_there_are_some(slope, kinds, driven, second_order):
    dataset = driven(masses(slope), [0.5], space="T1", amplitude=3.0, noise=0.002, input_matrix=np.eye(1))
    model = replace(MODEL, potential=BlockConfig(hidden=(3,), harmonics=True))
    result = fit(dataset, model=model, config=second_order)
    assert kinds_in_use(result.model) == kinds
    assert worst(result.model, slope, [-3.0], [3.0]) < 0.05


@pytest.mark.parametrize("cogging", [3.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_cogging_and_dry_friction_are_found_together(cogging, driven, second_order):
    def slope(q):
        return 2.0 * np.sin(q) + cogging * np.sin(12.0 * q)

    def accelerate(q, v, u):
        return masses(slope)(q, v, u) - 1.5 * v / np.sqrt(v**2 + 0.05**2)

    dataset = driven(accelerate, [0.5], space="T1", amplitude=4.0, noise=0.002, input_matrix=np.eye(1))
    model = replace(MODEL, potential=BlockConfig(hidden=(3,), harmonics=True), knees=(0.1,))
    result = fit(dataset, model=model, config=replace(second_order, growth_steps=20))
    kept = [name for name, verdict in result.verdicts.items() if verdict.startswith("kept")]
    found = [["potential", "friction"], ["friction", "potential and friction"]] if cogging else [["friction"]]
    assert kept in found
    assert kinds_in_use(result.model) == FRICTION | (POTENTIAL if cogging else 0)
    assert worst(result.model, slope, [-2.0], [2.0]) < 0.1


def test_a_network_grows_from_where_it_was_drawn(driven, second_order):
    def slope(q):
        return 2.0 * np.sin(q) + 1.5 * np.sin(3.0 * q)

    dataset = driven(masses(slope), [0.0], space="T1", amplitude=3.0, fastest=3.0, input_matrix=np.eye(1))
    model = replace(MODEL, potential=BlockConfig(hidden=(12,), constant=True))
    result = fit(dataset, model=model, config=replace(second_order, growth_steps=40))
    assert result.verdicts["growth"].startswith("kept")
    assert worst(result.model, slope, [-3.0], [3.0]) < 0.05
