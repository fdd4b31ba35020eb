"""Polynomials of lengths: every monomial once, and the energy of springs among them."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.blocks import Polynomial, monomials


def polynomial(size, degree, *, center=None, scale=None):
    """All monomials as outputs of their own."""
    center, scale = np.zeros(size) if center is None else center, np.ones(size) if scale is None else scale
    count = monomials(size, degree)
    function = Polynomial.init(count, degree=degree, center=center, scale=scale)
    return eqx.tree_at(lambda p: p.weights, function, jnp.eye(count))


@given(size=st.integers(1, 4), degree=st.integers(1, 4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_it_has_every_monomial_up_to_its_degree_once(size, degree, seed):
    generator = np.random.default_rng(seed)
    center, scale, q = generator.normal(size=size), generator.uniform(0.5, 2.0, size), generator.normal(size=size)
    z = (q - center) / scale
    exponents = [e for e in itertools.product(range(degree + 1), repeat=size) if sum(e) <= degree]
    found = np.asarray(polynomial(size, degree, center=center, scale=scale)(jnp.asarray(q)))
    assert sorted(found) == pytest.approx(sorted(np.prod(z**e) for e in np.array(exponents)))
    assert found[0] == 1


@given(seed=st.integers(0, 2**32 - 1), degree=st.integers(1, 4))
@settings(max_examples=20, deadline=None)
def test_what_falls_without_end_is_no_steeper_far_beyond_the_data(seed, degree):
    generator = np.random.default_rng(seed)
    reach, weights = generator.uniform(0.5, 3.0, 2), generator.normal(size=(monomials(2, degree), 1))
    bounded = Polynomial.init(1, degree=degree, center=np.zeros(2), scale=np.ones(2), reach=reach)
    bounded, free = (
        eqx.tree_at(lambda p: p.weights, each, jnp.asarray(weights))
        for each in (bounded, Polynomial.init(1, degree=degree, center=np.zeros(2), scale=np.ones(2)))
    )
    value, slope = (jax.jit(jax.vmap(of)) for of in (bounded, jax.jacobian(bounded)))
    inside = jnp.asarray(generator.uniform(-reach, reach, (50, 2)))
    assert np.asarray(value(inside)) == pytest.approx(np.asarray(jax.vmap(free)(inside)))
    edge = np.array([reach, [reach[0], 0.1], [-reach[0], -reach[1]]])
    near = [np.asarray(slope(jnp.asarray(edge * share))) for share in (1 - 1e-9, 1 + 1e-9)]
    assert near[0] == pytest.approx(near[1], rel=1e-6, abs=1e-6)  # Forces have no jump.
    far = [np.abs(np.asarray(slope(jnp.asarray(edge * times)))).max() for times in (1e2, 1e4, 1e6)]
    bound = np.abs(weights).sum() * degree * (reach.max() + np.log1p(1e6)) ** (degree - 1)
    assert max(far) < bound


def test_it_is_zero_at_the_start_and_has_a_slope_where_lengths_are_zero():
    start = Polynomial.init(1, degree=4, center=np.zeros(2), scale=np.ones(2))
    assert np.asarray(start(jnp.array([3.0, -5.0]))) == 0
    slopes = np.asarray(jax.jacobian(polynomial(2, 4))(jnp.zeros(2)))
    assert np.isfinite(slopes).all()
    assert np.count_nonzero(slopes) == 2


def test_the_energy_of_springs_that_harden_between_masses_is_one():
    q = np.random.default_rng(0).normal(size=(200, 3))
    features = np.asarray(jax.vmap(polynomial(3, 4))(jnp.asarray(q)))
    apart = q[:, 1:] - q[:, :-1] - 0.3
    energy = (2.0 * apart**2 + 5.0 * apart**4).sum(axis=1)

    def misfit(values):
        weights = np.linalg.lstsq(features, values, rcond=None)[0]
        return np.abs(features @ weights - values).max() / np.abs(values).max()

    assert misfit(energy) < 1e-12
    assert misfit(np.abs(apart).sum(axis=1)) > 1e-3
