"""Sensitivities and normal equations against plain differentiation."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import CORRECTIONS
from symoden.data import windows
from symoden.integrate import HOLDS, RK4, rollout
from symoden.models import KINDS, Scales, build
from symoden.spaces import Space
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import Linearization, linearize
from symoden.training._levenberg_marquardt import LevenbergState, levenberg_marquardt_step
from symoden.training._objective import Batch, Objective


def problem(dataset, config, hold="zero", *, momenta=False):
    batch = Batch.of(windows(dataset.train, 3, stride=3))
    model = build(config, Space.parse("T1"), 1, momenta=momenta, key=jax.random.key(3))
    objective = Objective(jnp.array([1.0, 0.5, 2.0]), RK4(), HOLDS[hold])
    return model, objective, batch


def one(batch, index):
    return jax.tree.map(lambda x: x[index], batch)


def about(restore, theta, objective, batch, **settings):
    return dataclasses.replace(Linearization.at(restore, theta, objective, batch), **settings)


def normal_equations(*problem, **settings):
    return about(*problem, **settings).normal_equations()


@eqx.filter_jit
def two_ways(restore, theta, objective, window):
    r, J = linearize(restore, theta, objective, window)

    def residuals(theta):
        return objective.residuals(restore(theta), window).ravel()

    return r, J, residuals(theta), jax.jacrev(residuals)(theta)


CASES = [(kind, "zero", False) for kind in KINDS] + [("dissipative", "linear", False), ("unstructured", "zero", True)]


@pytest.mark.parametrize(("kind", "hold", "momenta"), CASES)
def test_sensitivities_are_the_derivative_of_the_residuals(kind, hold, momenta, pendulum, small, scrambled):
    config = dataclasses.replace(small, kind=kind)
    model, objective, batch = problem(pendulum(momenta=momenta), config, hold, momenta=momenta)
    restore, theta = Flattening.of(scrambled(model, 1, 0.5), corrections=CORRECTIONS)
    r, J, residuals, jacobian = two_ways(restore, theta, objective, one(batch, 0))
    assert np.asarray(r) == pytest.approx(np.asarray(residuals), abs=1e-12)
    size = 1 + np.abs(jacobian).max()
    assert np.asarray(J) / size == pytest.approx(np.asarray(jacobian) / size, abs=1e-10)
    assert np.abs(jacobian).max() > 1e-3


def test_dry_friction_and_full_friction_have_exact_sensitivities_too(pendulum, small, scrambled):
    for change in ({"knees": (0.1, 1.0)}, {"full_friction": True}):
        model, objective, batch = problem(pendulum(), dataclasses.replace(small, **change))
        restore, theta = Flattening.of(scrambled(model, 1, 0.5), corrections=CORRECTIONS)
        _, J, _, jacobian = two_ways(restore, theta, objective, one(batch, 1))
        size = 1 + np.abs(jacobian).max()
        assert np.asarray(J) / size == pytest.approx(np.asarray(jacobian) / size, abs=1e-10)


def test_the_chunk_changes_the_normal_equations_by_rounding_alone(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=0)
    whole = normal_equations(restore, theta, objective, batch, precision=jnp.float64)
    assert whole.residuals.shape == (batch.ts.shape[0], 3, 3)
    for chunk in (1, 5, 100):
        parts = normal_equations(restore, theta, objective, batch, chunk=chunk, precision=jnp.float64)
        assert np.array_equal(parts.residuals, whole.residuals)
        assert parts.matrix == pytest.approx(whole.matrix, rel=1e-11, abs=1e-13 * np.abs(whole.matrix).max())
        assert parts.gradient == pytest.approx(whole.gradient, rel=1e-11, abs=1e-13 * np.abs(whole.gradient).max())
        assert parts.scores == pytest.approx(whole.scores, rel=1e-9, abs=1e-12 * np.abs(whole.scores).max())
    singles = [
        normal_equations(restore, theta, objective, batch.take(slice(k, k + 1)), precision=jnp.float64)
        for k in range(batch.ts.shape[0])
    ]
    scores = np.array([single.gradient * single.residuals.size for single in singles])
    assert whole.scores == pytest.approx(scores, rel=1e-9, abs=1e-12 * np.abs(whole.scores).max())


def test_the_gradient_of_the_loss_is_twice_that_of_the_normal_equations(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)
    equations = normal_equations(restore, theta, objective, batch, precision=jnp.float64)
    loss, slope = jax.value_and_grad(lambda theta: objective.loss(restore(theta), batch))(theta)
    assert equations.loss == pytest.approx(float(loss), rel=1e-12)
    assert 2 * equations.gradient == pytest.approx(np.asarray(slope), abs=1e-10 * (1 + np.abs(slope).max()))


def test_a_jacobian_in_single_precision_changes_the_equations_by_its_rounding(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)
    single, double = (normal_equations(restore, theta, objective, batch, precision=p) for p in (jnp.float32, float))
    assert np.array_equal(single.residuals, double.residuals)
    assert single.matrix == pytest.approx(double.matrix, abs=1e-5 * np.abs(double.matrix).max())
    assert not np.array_equal(single.matrix, double.matrix)
    assert np.linalg.eigvalsh(single.matrix).min() >= -1e-14 * np.abs(single.matrix).max()


@pytest.mark.parametrize(("space", "offset"), [("T1", 2 * np.pi * 16_000), ("R1", 1e5)])
def test_the_jacobian_is_right_far_from_zero_too(space, offset, pendulum, small):
    _, objective, batch = problem(pendulum(), small)
    units = Scales.units(Space.parse(space), 1)
    scales = dataclasses.replace(units, center=np.full_like(units.center, 0.0 if space == "T1" else offset))
    model = build(small, Space.parse(space), 1, scales=scales, key=jax.random.key(3))
    objective = dataclasses.replace(objective, weights=jnp.ones(model.space.embedded_size + 1))
    batch = batch._replace(q=batch.q + offset, start=batch.start.at[:, 0].add(offset))
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)
    found = Linearization.at(restore, theta, objective, batch).normal_equations()
    exact = normal_equations(restore, theta, objective, batch, precision=float)
    assert found.matrix == pytest.approx(exact.matrix, abs=1e-3 * np.abs(exact.matrix).max())
    assert found.gradient == pytest.approx(exact.gradient, abs=1e-3 * np.abs(exact.gradient).max())


def test_the_jacobian_is_in_single_precision_near_zero_and_where_a_coordinate_rests(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=0)
    start = batch.start.at[:, 0].set(1e5)
    for moved in (batch, batch._replace(q=jnp.full_like(batch.q, 1e5), start=start)):
        assert Linearization.at(restore, theta, objective, moved).precision == jnp.float32


def test_pulling_back_is_the_transpose_of_the_jacobian_for_any_chunk_kept_or_not(
    pendulum, small, scrambled, monkeypatch
):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(scrambled(model, 1, 0.5), corrections=CORRECTIONS)
    cotangents = np.random.default_rng(0).normal(size=(batch.ts.shape[0], 3, 3))

    def residuals(theta):
        return jax.vmap(lambda window: objective.residuals(restore(theta), window))(batch)

    expected = np.asarray(jax.vjp(residuals, theta)[1](jnp.asarray(cotangents))[0])
    rows = batch.ts.shape[0] * 3 * 3
    for most in (2**28, rows * theta.size // 2, 0):
        monkeypatch.setattr("symoden.training._gauss_newton._MOST_KEPT", most)
        for chunk in (1, 5, 100):
            linear = about(restore, theta, objective, batch, chunk=chunk, precision=float)
            for _ in range(2):
                pulled = linear.pull_back(cotangents)
                assert pulled == pytest.approx(expected, abs=1e-12 * (1 + np.abs(expected).max()))


def test_an_accelerated_step_misses_the_bottom_by_the_third_order(pendulum, small, monkeypatch):
    model, objective, batch = problem(pendulum(momenta=True), small, momenta=True)
    restore, bottom = Flattening.of(model, corrections=0)
    exact = jax.vmap(lambda w: rollout(restore(bottom), w.q[0], w.rates[0], w.ts, w.us, solver=RK4()))(batch)
    batch = batch._replace(q=exact.q, rates=exact.rates)
    # Rounding in single precision, which directions without data amplify, would hide the order.
    plain = Linearization.at
    monkeypatch.setattr(Linearization, "at", lambda *problem: dataclasses.replace(plain(*problem), precision=float))
    away = jnp.asarray(np.random.default_rng(0).normal(size=bottom.size))
    away = away / jnp.linalg.norm(away)

    def left(distance):
        start = LevenbergState(bottom + distance * away, 1e-8)
        _, step = levenberg_marquardt_step(start, restore, objective, batch)
        assert step.accepted
        return np.sqrt(step.after)

    def order():
        return np.log2(left(0.1) / left(0.025)) / 2

    accelerated = order()
    monkeypatch.setattr("symoden.training._levenberg_marquardt._LARGEST_BEND", 0.0)
    assert order() == pytest.approx(2, abs=0.3)
    assert accelerated == pytest.approx(3, abs=0.3)


def test_frozen_corrections_are_no_parameters(pendulum, small):
    model, _, _ = problem(pendulum(), small)
    (_, few), (restore, many) = (Flattening.of(model, corrections=free) for free in (0, CORRECTIONS))
    assert len(many) - len(few) == 2 * 3 + 3 + 3 + 1
    assert eqx.tree_equal(restore(many), model)
