"""A common factor of M, V, g and D cannot be seen in velocities."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.blocks import AbstractBlock, Known, KnownFunction, KnownValue, NoFriction, ViscousFriction
from symoden.integrate import rollout
from symoden.models import ModelConfig, StructuredModel, build, rescale
from symoden.spaces import Space

SAMPLES = 12
KINDS = ["joint", "viscous", "full", "frictionless", "unstructured", "unstructured-full", "geometric"]


@eqx.filter_jit
def motion(model, q, v, us):
    path = rollout(model, q, v, 0.01 * jnp.arange(float(SAMPLES)), us)
    return path.q, path.rates


@eqx.filter_jit
def parts(model, q, v):
    M_inv, g, D = model.inverse_mass_matrix(q), model.input_matrix(q), model.dissipation_matrix(q, v)
    return M_inv, model.hamiltonian(q, jnp.linalg.solve(M_inv, v)), g, D


def draw(model, seed):
    generator = np.random.default_rng(seed)
    n, m = model.space.size, model.inputs
    q, v = jnp.asarray(generator.normal(size=n)), jnp.asarray(generator.normal(size=n))
    return q, v, jnp.asarray(generator.normal(size=(SAMPLES, m)))


@pytest.mark.parametrize("name", KINDS)
@given(seed=st.integers(0, 2**32 - 1), exponent=st.floats(-2.0, 2.0))
@settings(max_examples=25)
def test_predictions_do_not_depend_on_the_scale(name, small_model, scrambled, seed, exponent):
    model = scrambled(small_model(name), seed, 0.5)
    q, v, us = draw(model, seed)
    plain, scaled = motion(model, q, v, us), motion(rescale(model, 10**exponent), q, v, us)
    for before, after in zip(plain, scaled, strict=True):
        size = 1 + np.abs(before).max()
        assert np.isfinite(size)
        assert after / size == pytest.approx(np.asarray(before) / size, abs=1e-9)


@pytest.mark.parametrize("name", [name for name in KINDS if name != "geometric"])
def test_parts_change_by_the_factor_or_its_inverse(name, small_model, scrambled):
    model, beta = scrambled(small_model(name), 3), 2.5
    q, v, _ = draw(model, 3)
    M_inv, H, g, D = parts(model, q, v)
    scaled = parts(rescale(model, beta), q, v)
    n = model.space.size
    signs = np.repeat([0.5, -0.5], n) if len(D) == 2 * n else np.full(n, -0.5)
    expected = (beta * M_inv, H / beta, g / beta, D * np.outer(beta**signs, beta**signs))
    for found, wanted in zip(scaled, expected, strict=True):
        assert np.asarray(found) == pytest.approx(np.asarray(wanted), rel=1e-9)


def test_known_parts_are_scaled_too():
    space = Space.parse("R1")
    model = StructuredModel(
        space=space,
        inputs=1,
        momenta=False,
        inverse_mass=KnownValue(Known(jnp.array([[2.0]]))),
        potential=KnownFunction(lambda q: q @ q),
        actuation=KnownFunction(lambda q: q[:, None]),
        friction=ViscousFriction(KnownValue(Known(jnp.array([[0.4]])))),
    )
    q, v = jnp.array([3.0]), jnp.array([1.0])
    scaled = rescale(model, 4.0)
    assert float(scaled.potential_energy(q)) == pytest.approx(9.0 / 4)
    found = [float(part[0, 0]) for part in (parts(scaled, q, v)[i] for i in (0, 2, 3))]
    assert found == pytest.approx([8.0, 0.75, 0.1])


def test_weights_stay_and_scaling_back_restores_the_model(small_model):
    model = small_model("joint")
    back = rescale(rescale(model, 4.0), 0.25)
    assert all(
        np.asarray(a) == pytest.approx(np.asarray(b), rel=1e-15)
        for a, b in zip(jax.tree.leaves(model), jax.tree.leaves(back), strict=True)
    )


def test_single_precision_stays_single_precision(small_model):
    model = jax.tree.map(lambda x: x.astype(jnp.float32), small_model("unstructured"))
    assert {leaf.dtype for leaf in jax.tree.leaves(rescale(model, 3.0))} == {np.dtype(np.float32)}


@pytest.mark.parametrize("beta", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_is_positive_and_finite(beta, small_model):
    with pytest.raises(ValueError, match="`beta` must be positive"):
        rescale(small_model("joint"), beta)


def test_measured_momenta_fix_the_scale():
    model: Any = build(ModelConfig(), Space.parse("T1"), 1, momenta=True, key=jax.random.key(0))
    with pytest.raises(ValueError, match="momenta are measured"):
        rescale(model, 2.0)


def test_a_foreign_block_is_refused(small_model):
    class Foreign(AbstractBlock):
        def __call__(self, q):
            return q @ q

    model = eqx.tree_at(lambda model: model.potential, small_model("joint"), Foreign())
    with pytest.raises(ValueError, match="got Foreign"):
        rescale(model, 2.0)
    assert isinstance(rescale(small_model("frictionless"), 2.0).friction, NoFriction)
