"""Fourier series of single angles: every harmonic once, none of them of lengths or products."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.blocks import FourierSeries
from symoden.spaces import Space

ORDER = 5


@eqx.filter_jit
def evaluate(function, q):
    return function(q)


def series(space, weights):
    start = FourierSeries.init(Space.parse(space), weights.shape[1], order=ORDER)
    assert start.weights.shape == weights.shape
    assert not np.any(np.asarray(start.weights))
    return eqx.tree_at(lambda function: function.weights, start, jnp.asarray(weights))


@given(seed=st.integers(0, 2**32 - 1), turns=st.integers(-3, 3))
def test_it_is_the_sum_of_the_harmonics_of_every_angle(seed, turns):
    generator = np.random.default_rng(seed)
    weights, q = generator.normal(size=(4 * (ORDER - 1), 2)), generator.normal(size=3)
    function = series("T1 R1 T1", weights)
    k = np.arange(2, ORDER + 1)[:, None]
    cosine, sine, other_cosine, other_sine = np.split(weights / np.tile(k, (4, 1)), 4)
    expected = (cosine * np.cos(k * q[0]) + sine * np.sin(k * q[0])).sum(axis=0)
    expected += (other_cosine * np.cos(k * q[2]) + other_sine * np.sin(k * q[2])).sum(axis=0)
    assert np.asarray(evaluate(function, jnp.asarray(q))) == pytest.approx(expected)
    elsewhere = q + np.array([2 * np.pi * turns, generator.normal(), -2 * np.pi * turns])
    assert np.asarray(evaluate(function, jnp.asarray(elsewhere))) == pytest.approx(expected, abs=1e-9)


def test_equal_weights_are_equal_torques():
    angles = jnp.linspace(-np.pi, np.pi, 1000)[:, None]
    for row in np.eye(2 * (ORDER - 1)):
        slope = jax.vmap(jax.jacobian(series("T1", row[:, None])))(angles)
        assert np.abs(np.asarray(slope)).max() == pytest.approx(1.0, abs=1e-3)
