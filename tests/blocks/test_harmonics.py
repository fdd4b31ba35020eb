"""Harmonics and what is built on them: the mechanics of rigid bodies is among them, and matrices stay positive."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.blocks import Constant, GramBlock, Harmonics, Known
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole

seeds = st.integers(0, 2**32 - 1)


@eqx.filter_jit
def evaluate(function, q):
    return function(q)


def harmonics(space, outputs, seed=0, **options):
    return Harmonics.init(Space.parse(space), outputs, key=jax.random.key(seed), **options)


@pytest.mark.parametrize(("powers", "order"), [(1, 1), (2, 2), (2, 3)])
def test_harmonics_are_products_of_one_factor_per_coordinate(powers, order):
    center, scale = np.array([0.5, 0.1, 0.2, -0.3, 0.4]), np.array([2.0, 0.5, 0.7, 0.9, 1.1])
    function = harmonics("T1 R1 T1", 2, powers=powers, order=order, center=center, scale=scale)
    q = np.array([0.3, -1.2, 2.0])
    r, *rest = (np.array([q[1], np.cos(q[0]), np.cos(q[2]), np.sin(q[0]), np.sin(q[2])]) - center) / scale
    factors = [[r**k for k in range(powers + 1)], [1, rest[0], rest[2]], [1, rest[1], rest[3]]]
    products = [
        np.prod([factor[k] for factor, k in zip(factors, choice, strict=True)])
        for choice in itertools.product(*(range(len(factor)) for factor in factors))
        if np.count_nonzero(choice) <= order
    ]
    assert np.asarray(function(jnp.asarray(q))) == pytest.approx(
        np.array(products) @ np.asarray(function.weights), rel=1e-12
    )


@given(seed=seeds)
def test_products_with_and_without_lengths_make_all(seed):
    q = jnp.asarray(np.random.default_rng(seed).normal(size=3))
    whole = harmonics("R1 T1 R1", 2, seed, powers=2)
    turning, sliding = harmonics("R1 T1 R1", 2, powers=0), whole.of_lengths()
    turning = eqx.tree_at(lambda h: h.weights, turning, whole.weights[:3])
    assert np.asarray(evaluate(turning, q) + evaluate(sliding, q)) == pytest.approx(np.asarray(evaluate(whole, q)))
    assert np.asarray(evaluate(turning, q + jnp.array([1.0, 0.0, -2.0]))) == pytest.approx(
        np.asarray(evaluate(turning, q))
    )
    assert (len(turning.weights), len(sliding.weights), len(whole.weights)) == (3, 24, 27)


@given(seed=seeds, turns=st.integers(-3, 3))
def test_harmonics_are_periodic_in_angles_only(seed, turns):
    function = eqx.tree_at(lambda h: h.weights, harmonics("R1 T1", 2), jnp.ones((9, 2)))
    q = jnp.asarray(np.random.default_rng(seed).normal(size=2))
    here, around, further = (
        np.asarray(evaluate(function, q + jnp.array(step)))
        for step in ([0.0, 0.0], [0.0, 2 * np.pi * turns], [1.0, 0.0])
    )
    assert around == pytest.approx(here, abs=1e-10)
    assert further != pytest.approx(here, abs=1e-6)


def test_harmonics_have_a_derivative_where_a_length_is_zero():
    slopes = jax.jacobian(harmonics("R1 T1", 3, spread=1.0))(jnp.zeros(2))
    assert np.isfinite(slopes).all()
    assert np.abs(slopes).max() > 1e-3


@pytest.mark.parametrize("system", [CartPole(), Acrobot()], ids=["cart-pole", "acrobot"])
def test_gravity_and_inertia_of_mechanisms_are_harmonics_and_their_squares_are_not(system):
    q = jax.random.uniform(jax.random.key(0), (200, 2), minval=-3.0, maxval=3.0)
    basis = harmonics("R1 T1" if isinstance(system, CartPole) else "T2", 9)
    features = np.asarray(jax.vmap(eqx.tree_at(lambda h: h.weights, basis, jnp.eye(9)))(q))

    def misfit(values):
        weights = np.linalg.lstsq(features, values, rcond=None)[0]
        return np.abs(features @ weights - values).max() / np.abs(values).max()

    V = np.asarray(jax.vmap(system.potential_energy)(q))
    M = np.asarray(jax.vmap(system.mass_matrix)(q)).reshape(200, -1)
    assert misfit(V) < 1e-12
    assert misfit(M) < 1e-12
    assert misfit(V**2) > 1e-3


@given(seed=seeds, size=st.floats(1e-3, 1e3), floor=st.floats(1e-6, 1.0))
def test_a_gram_block_is_a_scaled_sum_of_squares_plus_the_floor(seed, size, floor):
    generator = np.random.default_rng(seed)
    entries, scale = size * generator.normal(size=15), generator.uniform(0.1, 3.0, 3)
    block = GramBlock(Constant(jnp.asarray(entries)), Known(jnp.asarray(scale)), floor)
    J, S = entries.reshape(5, 3), np.diag(scale)
    expected = S @ (J.T @ J + floor * np.eye(3)) @ S
    matrix = np.asarray(block(jnp.zeros(3)))
    assert matrix == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())
    assert np.linalg.eigvalsh(matrix / np.outer(scale, scale)).min() >= floor * (1 - 1e-9) - 1e-12 * size**2


@pytest.mark.parametrize("floor", [0.0, -1.0])
def test_a_gram_block_without_a_floor_is_refused(floor):
    with pytest.raises(ValueError, match="`floor` must be positive"):
        GramBlock(Constant(jnp.ones(2)), Known(jnp.ones(1)), floor)
