"""Errors of blocks: none for a rescaled truth; an error in one block shows there and nowhere else."""

import functools
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jaxtyping import Array, Float

from symoden.data import Dataset
from symoden.experiments import Source, block_errors, simulate, task
from symoden.mechanics import AbstractMechanical, AbstractPortHamiltonian
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space

FIELDS = ("inverse_mass", "potential", "actuation", "dissipation")


@final
class Perturbed(AbstractMechanical):
    """A system in other units of momentum, its blocks multiplied by factors."""

    truth: AbstractMechanical
    beta: Float[Array, ""]
    factors: Float[Array, "4"]
    uneven: Float[Array, ""]
    full: bool = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    space: Space = eqx.field(static=True)
    inputs: int = eqx.field(static=True)

    def __init__(self, truth, *, beta=1.0, factors=(1.0, 1.0, 1.0, 1.0), uneven=0.0, full=False, momenta=False):
        self.truth, self.full, self.momenta = truth, full, momenta
        self.beta, self.factors = jnp.asarray(float(beta)), jnp.asarray(factors, float)
        self.uneven = jnp.asarray(uneven)
        self.space, self.inputs = truth.space, truth.inputs

    def inverse_mass_matrix(self, q):
        return self.factors[0] * self.beta * self.truth.inverse_mass_matrix(q)

    def mass_matrix(self, q):
        return jnp.linalg.inv(self.inverse_mass_matrix(q))

    def potential_energy(self, q):
        return self.factors[1] * self.truth.potential_energy(q) / self.beta + 3.0

    def input_matrix(self, q):
        return self.factors[2] * self.truth.input_matrix(q) / self.beta

    def dissipation_matrix(self, q, v):
        D = (self.factors[3] + self.uneven * q[0] ** 2) * self.truth.dissipation_matrix(q, v) / self.beta
        return jnp.kron(jnp.array([[0.0, 0.0], [0.0, 1.0]]), D) if self.full else D


@functools.cache
def few(name):
    data = simulate(task(name), train_initials=3, test_initials=1)
    return Source(name=name, dataset=data.dataset, task=task(name), prediction=data.prediction)


def found(name, **changes):
    errors = block_errors(Perturbed(task(name).system, **changes), few(name))
    assert errors is not None
    return errors


@pytest.mark.parametrize("name", ["pendulum", "cartpole", "acrobot-full"])
@given(beta=st.floats(0.01, 100.0), full=st.booleans())
@settings(max_examples=10)
def test_a_rescaled_truth_has_no_error(name, beta, full):
    errors = found(name, beta=beta, full=full)
    assert errors.gauge == pytest.approx(beta, rel=1e-9)
    assert [getattr(errors, field) for field in FIELDS] == pytest.approx([0.0] * 4, abs=1e-9)
    assert errors.dissipation_median == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["pendulum", "cartpole"])
@pytest.mark.parametrize("block", [0, 1, 3])
def test_an_error_in_a_block_shows_there_alone(name, block):
    factors = [1.0] * 4
    factors[block] = 1.25
    errors = found(name, beta=0.3, factors=tuple(factors))
    expected = [0.125 if field == "potential" else 0.25 for field in FIELDS]  # The best constant takes off half.
    expected = [value if i == block else 0.0 for i, value in enumerate(expected)]
    assert [getattr(errors, field) for field in FIELDS] == pytest.approx(expected, abs=1e-9)
    assert errors.dissipation_median == pytest.approx(expected[3], abs=1e-9)


def test_where_momenta_are_observed_nothing_is_rescaled():
    errors = found("pendulum-canonical", factors=(1.0, 1.0, 1.25, 1.0), momenta=True)
    assert errors.gauge == 1.0
    assert [getattr(errors, field) for field in FIELDS] == pytest.approx([0.0, 0.0, 0.25, 0.0], abs=1e-9)


def test_the_gauge_is_that_of_least_squares_and_the_worst_state_counts():
    source, truth = few("cartpole"), task("cartpole").system
    config = ModelConfig(inverse_mass=BlockConfig(hidden=(4,)), potential=BlockConfig(hidden=(4,)))
    model = build(config, Space.parse("R1 T1"), 1, key=jax.random.key(0))
    errors = block_errors(model, source)
    assert errors is not None
    assert isinstance(model, AbstractPortHamiltonian)
    q = jnp.asarray(np.concatenate([path.q for path in source.dataset.train]))
    true_g, g = (np.asarray(jax.vmap(system.input_matrix)(q)) for system in (truth, model))
    beta = np.sum(true_g * g) / np.sum(g**2)
    assert errors.gauge == pytest.approx(beta)
    inverse_mass = [np.asarray(jax.vmap(system.inverse_mass_matrix)(q)) for system in (truth, model)]
    away = np.sqrt(np.sum((inverse_mass[1] / beta - inverse_mass[0]) ** 2, axis=(1, 2)))
    assert errors.inverse_mass == pytest.approx(np.max(away / np.sqrt(np.sum(inverse_mass[0] ** 2, axis=(1, 2)))))


def test_of_friction_there_is_the_worst_state_and_the_median():
    q = np.concatenate([path.q for path in few("pendulum").dataset.train])[:, 0]
    errors = found("pendulum", beta=0.3, uneven=0.25)
    assert (errors.dissipation, errors.dissipation_median) == pytest.approx(
        (0.25 * np.max(q**2), 0.25 * np.median(q**2))
    )
    assert errors.inverse_mass == pytest.approx(0.0, abs=1e-9)


def test_without_friction_all_of_it_is_missing():
    model = build(ModelConfig(kind="symoden"), Space.parse("T1"), 1, key=jax.random.key(0))
    errors = block_errors(model, few("pendulum"))
    assert errors is not None
    assert errors.dissipation == 1.0


def test_without_energy_or_truth_there_is_nothing_to_compare():
    for kind in ("naive", "geometric"):
        model = build(ModelConfig(kind=kind, flow=(4,)), Space.parse("T1"), 1, key=jax.random.key(0))
        assert block_errors(model, few("pendulum")) is None
    data = Source(name="arm.toml", dataset=Dataset(name="arm", space="T1", train=few("pendulum").dataset.train))
    assert block_errors(task("pendulum").system, data) is None
