"""Learned priors: what the data do not ask for is narrowed to nothing, what they do is left alone."""

import dataclasses
import itertools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from symoden.blocks import CORRECTIONS, DIRECTIONS, FRICTION, count_parameters
from symoden.known import KnownParts
from symoden.models import build
from symoden.spaces import Space
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import NormalEquations
from symoden.training._level import independent_variance
from symoden.training._relevance import Relevance, free_scale, parameter_groups

WINDOWS, ROWS = 100, 10


def equations_of(theta, *, copies=1, seed=0, windows=WINDOWS, rows=ROWS):
    """Equations of a linear regression y = X θ* + noise, in which every row stands `copies` times in its window."""
    generator = np.random.default_rng(seed)
    X = np.repeat(generator.standard_normal((windows, rows, len(theta))), copies, axis=1)
    true = np.zeros(len(theta))
    true[:2] = (3.0, -2.0)
    noise = np.repeat(0.5 * generator.standard_normal((windows, rows)), copies, axis=1)
    r = X @ (theta - true) - noise
    scores = np.einsum("wrp,wr->wp", X, r)
    flat = X.reshape(-1, len(theta))
    return NormalEquations(flat.T @ flat / r.size, scores.sum(axis=0) / r.size, r, scores)


def linear(size):
    """A model that is a vector, every entry with a prior of its own, and its priors."""
    model = jnp.zeros(size)
    return Relevance.start(model, 1.0), (model, 0)


@pytest.mark.parametrize("copies", [1, 8])
@pytest.mark.parametrize("seed", range(3))
def test_what_does_not_matter_is_narrowed_away(copies, seed):
    found, model = linear(12)
    first = equations_of(np.zeros(12), copies=copies, seed=seed)
    theta = -np.linalg.solve(first.matrix, first.gradient)  # The least squares, which fit the noise.
    equations = first
    for _ in range(40):
        equations = equations_of(theta, copies=copies, seed=seed)
        found = found.learn(equations, theta, *model)
        ridge = found.precisions(*model) * float(found.variance) / equations.residuals.size
        step = np.linalg.solve(equations.matrix + np.diag(ridge), equations.gradient + ridge * theta)
        theta = theta - step
    np.testing.assert_allclose(theta[:2], [3.0, -2.0], atol=0.1)
    assert np.all(found.precisions(*model)[:2] < 1)
    assert np.sum(found.precisions(*model)[2:] > 1e3) >= 6


@pytest.mark.parametrize("shape", [(6,), (3, 2)])
@pytest.mark.parametrize("seed", range(3))
def test_the_evidence_is_largest_where_priors_settle(seed, shape):
    """Against the density of the measurements themselves, every group's prior in turn wider or narrower."""
    model = jnp.zeros(shape)
    found, groups = Relevance.start(model, 1.0), parameter_groups([shape])
    generator = np.random.default_rng(seed)
    X, true = generator.standard_normal((40, 2, 6)), np.array([3.0, -2.0, 0.5, 0.3, 0.2, 0.0])
    y = X @ true + 0.5 * generator.standard_normal((40, 2))
    flat, theta = X.reshape(-1, 6), true + 0.01 * generator.standard_normal(6)
    r = flat @ theta - y.ravel()
    equations = NormalEquations(flat.T @ flat / y.size, flat.T @ r / y.size, r.reshape(y.shape), np.eye(6))
    for _ in range(60):
        found = found.learn(equations, theta, model, 0)

    def evidence(precision):
        covariance = float(found.variance) * np.eye(y.size) + flat / precision @ flat.T
        return scipy.stats.multivariate_normal.logpdf(y.ravel(), cov=covariance)

    settled = found.precisions(model, 0)
    best = evidence(settled)
    capped = settled >= 0.99 / np.bincount(groups, theta**2)[groups] * np.bincount(groups)[groups]
    for group, factor in itertools.product(np.unique(groups[~capped & (settled < 1e3)]), (0.5, 2.0)):
        assert evidence(np.where(groups == group, factor * settled, settled)) < best + 1e-3
    shared = -0.5 * y.size * np.log(2 * np.pi * float(found.variance))
    assert float(found.evidence) + shared == pytest.approx(best, abs=0.1)


@pytest.mark.parametrize("windows", [8, 100])
def test_the_variance_counts_what_is_independent(windows):
    found = []
    for copies in (1, 8):
        for seed in range(8):
            options = {"copies": copies, "seed": seed, "windows": windows, "rows": 40}
            first = equations_of(np.zeros(4), **options)
            best = -np.linalg.solve(first.matrix, first.gradient)
            found.append(independent_variance(equations_of(best, **options)))
    plain, copied = np.mean(found[:8]), np.mean(found[8:])
    assert plain == pytest.approx(0.25, rel=0.3)
    assert copied == pytest.approx(8 * 0.25, rel=0.3)


def test_few_windows_do_not_make_it_smaller():
    found = []
    for seed in range(200):
        options = {"copies": 8, "seed": seed, "windows": 5, "rows": 40}
        first = equations_of(np.zeros(3), **options)
        best = -np.linalg.solve(first.matrix, first.gradient)
        found.append(independent_variance(equations_of(best, **options)))
    assert np.mean(found) == pytest.approx(8 * 0.25, rel=0.08)


def test_a_handful_of_windows_teaches_nothing():
    start, model = linear(3)
    assert start.learn(equations_of(np.zeros(3), windows=4), np.zeros(3), *model) is start


def test_priors_that_say_nothing_at_first_do_no_harm():
    model = jnp.zeros(3)
    blind = equations_of(np.zeros(3))
    blind.matrix[2], blind.matrix[:, 2], blind.gradient[2] = 0, 0, 0
    found = Relevance.start(model, 0.0).learn(blind, np.zeros(3), model, 0)
    assert np.isfinite(found.precisions(model, 0)).all()
    assert float(found.variance) > 0


def test_no_prior_changes_by_more_than_a_factor_of_three():
    before, model = linear(12)
    after = before.learn(equations_of(np.zeros(12)), np.zeros(12), *model)
    ratio = after.precisions(*model) / before.precisions(*model)
    assert np.all((ratio >= 1 / 3 - 1e-12) & (ratio <= 3 + 1e-9))
    assert float(after.variance) > 0


@pytest.mark.parametrize(("broken", "value"), [("gradient", np.nan), ("residuals", np.nan), ("residuals", 1e200)])
def test_equations_that_are_not_sound_teach_nothing(broken, value):
    equations = equations_of(np.zeros(3))
    spoilt = getattr(equations, broken).copy()
    spoilt.flat[0] = value
    start, model = linear(3)
    assert start.learn(equations._replace(**{broken: spoilt}), np.zeros(3), *model) is start


@pytest.mark.parametrize("seed", range(3))
def test_no_prior_outruns_the_parameters(seed):
    """The equations promise that all is best near zero; parameters that are not there yet are not dragged along."""
    found, model = linear(6)
    theta = np.random.default_rng(seed).uniform(1, 9, 6)
    equations = equations_of(theta, seed=seed)
    for _ in range(5):
        before = found.precisions(*model)
        found = found.learn(equations, theta, *model)
        assert np.all(found.precisions(*model) <= np.maximum(before / 3, 1 / theta**2) * (1 + 1e-6))


def test_rows_and_entries_share_priors():
    assert parameter_groups([(2, 3), (2,), ()]).tolist() == [0, 0, 0, 1, 1, 1, 2, 3, 4]


def test_priors_are_in_the_order_of_the_parameters_of_every_kind(small):
    model = build(dataclasses.replace(small, knees=(0.1,)), Space.parse("T2"), 2, key=jax.random.key(0))
    start, sizes = Relevance.start(model, 2.0), []
    for corrections in (0, FRICTION, FRICTION | DIRECTIONS, CORRECTIONS):
        _, theta = Flattening.of(model, corrections=corrections)
        sizes.append(theta.size)
        assert start.precisions(model, corrections).tolist() == [2.0] * theta.size
    assert sizes == sorted(set(sizes))


@pytest.mark.parametrize("size", [0.0, 0.5, 150.0, np.inf, np.nan])
def test_priors_are_as_wide_as_laws_of_friction_that_training_begins_with(small, size):
    model: Any = build(dataclasses.replace(small, knees=(0.1,)), Space.parse("T2"), 2, key=jax.random.key(0))
    closed = Relevance.start(model, 2.0).precision
    laws = jax.tree.map(lambda x: jnp.full_like(x, size), model.friction.laws)
    found = Relevance.start(eqx.tree_at(lambda model: model.friction.laws, model, laws), 2.0).precision
    (precision,) = jax.tree.leaves(found.friction.laws)
    assert precision.tolist() == [2.0 / max(1.0, size**2) if size < np.inf else {np.inf: 0.0}.get(size, 2.0)] * 6
    others = (eqx.tree_at(lambda tree: tree.friction.laws, tree, None) for tree in (found, closed))
    assert eqx.tree_equal(*others)


@pytest.mark.parametrize("prior", [0.0, 2.0])
def test_only_what_is_free_learns_and_guesses_of_a_user_stay_as_they_are(small, prior):
    known = KnownParts(potential_energy="w*cos(q1)", parameters={"w": 2.0})
    model = build(small, Space.parse("T2"), 2, known=known, key=jax.random.key(0))
    _, theta = Flattening.of(model, corrections=1)
    found = Relevance.start(model, prior).learn(equations_of(np.zeros(theta.size)), np.asarray(theta), model, 1)
    assert [leaf.tolist() for leaf in jax.tree.leaves(found.precision.parameters)] == [[prior]]
    assert np.isfinite(float(found.evidence))
    assert np.sum(found.precisions(model, 1) == prior) == 1
    assert np.sum(found.precisions(model, CORRECTIONS) == prior) == 1 + count_parameters(model) - theta.size


def test_what_is_pinned_stays_in_that_direction_alone():
    equations = equations_of(np.zeros(3))
    direction = np.array([1.0, 2.0, 0.0])
    pinned = equations.pinned(direction, 0.25)
    step = -np.linalg.solve(pinned.matrix, pinned.gradient)
    assert abs(direction @ step) < 1e-6
    assert step[2] == pytest.approx(-np.linalg.solve(equations.matrix, equations.gradient)[2], abs=0.1)
    worse = equations._replace(residuals=2 * equations.residuals)  # The evidence must not see what is no data.
    np.testing.assert_array_equal(worse.pinned(direction, 0.25).matrix, pinned.matrix)


def test_the_scale_is_free_where_only_velocities_were_measured(small):
    q = jnp.linspace(-1, 1, 6).reshape(3, 2)
    model = build(small, Space.parse("T2"), 2, key=jax.random.key(0))
    restore, theta = Flattening.of(model, corrections=1)
    direction = free_scale(model, restore, theta, q)
    assert direction is not None
    assert np.linalg.norm(direction) > 0
    known = build(small, Space.parse("T2"), 2, input_matrix=np.eye(2), key=jax.random.key(0))
    assert free_scale(known, *Flattening.of(known, corrections=1), q) is None
    momenta = build(small, Space.parse("T2"), 2, momenta=True, key=jax.random.key(0))
    assert free_scale(momenta, *Flattening.of(momenta, corrections=1), q) is None
