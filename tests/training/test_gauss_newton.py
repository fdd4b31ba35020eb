"""Sensitivities and normal equations against plain differentiation."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.data import windows
from symoden.integrate import HOLDS, RK4
from symoden.models import KINDS, build
from symoden.spaces import Space
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import linearize, normal_equations
from symoden.training._problem import Batch, Objective


def problem(dataset, config, hold="zero", *, momenta=False):
    batch = Batch.of(windows(dataset.train, 3, stride=3))
    model = build(config, Space.parse("T1"), 1, momenta=momenta, key=jax.random.key(3))
    objective = Objective(jnp.array([1.0, 0.5, 2.0]), RK4(), HOLDS[hold])
    return model, objective, batch


def one(batch, index):
    return jax.tree.map(lambda x: x[index], batch)


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
    restore, theta = Flattening.of(scrambled(model, 1, 0.5), corrections=True)
    r, J, residuals, jacobian = two_ways(restore, theta, objective, one(batch, 0))
    assert np.asarray(r) == pytest.approx(np.asarray(residuals), abs=1e-12)
    size = 1 + np.abs(jacobian).max()
    assert np.asarray(J) / size == pytest.approx(np.asarray(jacobian) / size, abs=1e-10)
    assert np.abs(jacobian).max() > 1e-3


def test_dry_friction_and_full_friction_have_exact_sensitivities_too(pendulum, small, scrambled):
    for change in ({"knees": (0.1, 1.0)}, {"full_friction": True}):
        model, objective, batch = problem(pendulum(), dataclasses.replace(small, **change))
        restore, theta = Flattening.of(scrambled(model, 1, 0.5), corrections=True)
        _, J, _, jacobian = two_ways(restore, theta, objective, one(batch, 1))
        size = 1 + np.abs(jacobian).max()
        assert np.asarray(J) / size == pytest.approx(np.asarray(jacobian) / size, abs=1e-10)


def test_the_chunk_changes_the_normal_equations_by_rounding_alone(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=False)
    whole = normal_equations(restore, theta, objective, batch)
    for chunk in (1, 5, 100):
        parts = normal_equations(restore, theta, objective, batch, chunk=chunk)
        assert parts.residuals == whole.residuals == batch.ts.shape[0] * 3 * 3
        assert parts.loss == pytest.approx(whole.loss, rel=1e-13)
        assert parts.matrix == pytest.approx(whole.matrix, rel=1e-11, abs=1e-13 * np.abs(whole.matrix).max())
        assert parts.gradient == pytest.approx(whole.gradient, rel=1e-11, abs=1e-13 * np.abs(whole.gradient).max())


def test_the_gradient_of_the_loss_is_twice_that_of_the_normal_equations(pendulum, small):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(model, corrections=True)
    equations = normal_equations(restore, theta, objective, batch)
    loss, slope = jax.value_and_grad(lambda theta: objective.loss(restore(theta), batch))(theta)
    assert equations.loss == pytest.approx(float(loss), rel=1e-12)
    assert 2 * equations.gradient == pytest.approx(np.asarray(slope), abs=1e-10 * (1 + np.abs(slope).max()))


def test_frozen_corrections_are_no_parameters(pendulum, small):
    model, _, _ = problem(pendulum(), small)
    (_, few), (restore, many) = (Flattening.of(model, corrections=free) for free in (False, True))
    assert len(many) - len(few) == 2 * 3 + 3 + 3 + 1
    assert eqx.tree_equal(restore(many), model)
