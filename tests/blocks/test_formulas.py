"""Formulas as blocks: values, parameters that several share, inverses, corrections that keep matrices positive."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.blocks import (
    Congruence,
    Constant,
    CorrectedBlock,
    CorrectedFriction,
    CorrectedMatrix,
    Formula,
    FormulaBlock,
    FormulaFriction,
    InverseBlock,
    Known,
    KnownFriction,
    KnownFunction,
    KnownValue,
    Parameters,
    ViscousFriction,
    count_parameters,
    inverse_of_positive,
    with_parameters,
)
from symoden.known import FUNCTIONS

Q, V = jnp.array([0.3, -0.7]), jnp.array([1.1, 0.4])
ONE = Known(jnp.ones(()))
PARAMETERS = Parameters.init({"m": 2.0, "b": -0.5, "o": 0.0})
seeds = st.integers(0, 2**32 - 1)


@eqx.filter_jit
def evaluate(function, *arguments):
    return function(*arguments)


def formula(*texts, shape=None) -> Any:
    return Formula(texts, (len(texts),) if shape is None else shape, (("l", 0.25),), PARAMETERS.names)


def test_a_formula_reads_coordinates_velocities_constants_and_parameters():
    filled = with_parameters(formula("m*l*q2**2", "b + o", "v1*v2 + pi", "3", shape=(2, 2)), PARAMETERS)
    assert np.asarray(filled(Q, V)) == pytest.approx(np.array([[0.245, -0.5], [0.44 + np.pi, 3.0]]), rel=1e-14)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_its_value_and_its_slope(name):
    reference = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}.get(name) or name
    block = FormulaBlock(formula(f"{name}(q1)", shape=()), ONE)
    h = 1e-6
    function = getattr(np, reference)
    assert float(block(Q)) == pytest.approx(function(0.3), rel=1e-14)
    assert float(jax.grad(block)(Q)[0]) == pytest.approx((function(0.3 + h) - function(0.3 - h)) / (2 * h), rel=1e-7)


def test_whole_powers_have_slopes_at_zero():
    slope = jax.grad(FormulaBlock(formula("q1**2 + q2**1", shape=()), ONE))(jnp.zeros(2))
    assert np.array_equal(slope, [0.0, 1.0])


def test_a_formula_keeps_to_the_precision_of_the_state():
    single = with_parameters(formula("m*l*q1", "2"), jax.tree.map(lambda x: x.astype(jnp.float32), PARAMETERS))
    assert single(Q.astype(jnp.float32)).dtype == jnp.float32


def test_parameters_begin_at_their_start_and_keep_its_sign():
    assert np.array_equal(PARAMETERS.values, [2.0, -0.5, 0.0])
    assert not PARAMETERS.theta.any()
    moved = eqx.tree_at(lambda p: p.theta, PARAMETERS, jnp.array([-30.0, 3.0, -4.0]))
    m, b, o = np.asarray(moved.values)
    assert 0 < m < 1e-12
    assert b == pytest.approx(-0.5 * np.exp(3))
    assert o == -4.0
    assert count_parameters(PARAMETERS) == 3


def test_what_starts_at_zero_counts_in_its_unit_and_nothing_else_does():
    start = {"m": 2.0, "b": -0.5, "o": 0.0, "p": 0.0}
    plain, scaled = (Parameters.init(start, units=units) for units in (None, {"o": 1e3}))
    theta = jnp.array([0.3, -0.2, -4.0, 5.0])
    values = [np.asarray(eqx.tree_at(lambda p: p.theta, each, theta).values) for each in (plain, scaled)]
    assert values[1] == pytest.approx(values[0] * [1, 1, 1e3, 1], rel=1e-14)
    assert count_parameters(scaled) == 4


def test_blocks_share_their_parameters():
    blocks = (FormulaBlock(formula("m*q1"), ONE), FormulaFriction(formula("m*v1", shape=(1, 1)), Known(jnp.array(3.0))))
    moved = eqx.tree_at(lambda p: p.theta, PARAMETERS, jnp.log(jnp.array([2.0, 1.0, 1.0])))
    block, friction = with_parameters(blocks, moved)
    assert float(block(Q)[0]) == pytest.approx(4.0 * 0.3)
    assert float(friction(Q, V)[0, 0]) == pytest.approx(3.0 * 4.0 * 1.1)
    assert with_parameters(blocks, None) is blocks


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
@given(seed=seeds)
def test_the_inverse_of_a_positive_matrix_is_its_inverse(size, seed):
    factor = np.random.default_rng(seed).normal(size=(size, size))
    matrix = factor @ factor.T + 0.1 * np.eye(size)
    inverse = np.asarray(evaluate(inverse_of_positive, jnp.asarray(matrix)))
    assert inverse == pytest.approx(inverse.T, rel=1e-12, abs=1e-12)
    assert inverse @ matrix == pytest.approx(np.eye(size), abs=1e-9)


@eqx.filter_jit
def slopes_along(invert, matrix, direction, weights):
    def pulled(t):
        return jnp.vdot(weights, invert(matrix + t * direction))

    return jnp.stack([derivative(0.0) for derivative in (jax.grad(pulled), jax.grad(jax.grad(pulled)))])


@pytest.mark.parametrize("size", [1, 2, 3, 6])
@given(seed=seeds)
def test_the_inverse_has_the_derivatives_of_an_inverse(size, seed):
    generator = np.random.default_rng(seed)
    factor, slope, weights = generator.normal(size=(3, size, size))
    at = (factor @ factor.T + 0.1 * np.eye(size), slope @ slope.T, weights)
    expected = np.asarray(slopes_along(jnp.linalg.inv, *at))
    assert np.asarray(slopes_along(inverse_of_positive, *at)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("size", [2, 6, 9])
def test_inverses_leave_nothing_to_lapack(size):
    """Batches of its triangular systems wait for each other without end on few threads."""
    program = jax.jit(jax.vmap(jax.jacfwd(inverse_of_positive))).lower(jnp.ones((3, size, size)))
    assert "lapack" not in program.as_text()
    assert "lapack" in jax.jit(jnp.linalg.inv).lower(jnp.ones((size, size))).as_text()


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_a_matrix_that_is_not_positive_has_no_inverse(size):
    indefinite = jnp.diag(jnp.array([2.0] * (size - 1) + [-1.0]))
    with jax.debug_nans(False):
        assert np.isnan(evaluate(InverseBlock(KnownValue(Known(indefinite))), jnp.zeros(size))).any()


@given(seed=seeds)
def test_corrected_inertia_and_friction_stay_positive(seed):
    generator = np.random.default_rng(seed)
    factor, scale = generator.normal(size=(2, 2)), generator.uniform(0.2, 3.0, 2)
    X = jnp.asarray(factor @ factor.T + 0.1 * np.eye(2))
    C = Congruence(Constant(jnp.asarray(3 * generator.normal(size=3))), Known(jnp.asarray(scale)))
    for matrix in (
        evaluate(CorrectedMatrix(KnownValue(Known(X)), C), Q),
        evaluate(CorrectedFriction(ViscousFriction(KnownValue(Known(X))), C), Q, V),
    ):
        assert np.linalg.eigvalsh((matrix + matrix.T) / 2).min() >= -1e-12 * np.abs(matrix).max()
        assert np.asarray(matrix) == pytest.approx(np.asarray(matrix).T, rel=1e-12, abs=1e-12)


def test_corrections_of_zero_change_nothing_and_others_follow_their_formula():
    X, scale = jnp.array([[2.0, 0.5], [0.5, 1.0]]), Known(jnp.array([2.0, 4.0]))
    given_matrix = KnownValue(Known(X))
    silent = CorrectedMatrix(given_matrix, Congruence(Constant(jnp.zeros(3)), scale))
    assert np.array_equal(silent(Q), X)
    C = np.array([[1.1, 0.0], [0.2 * 4 / 2, 1.3]])
    louder = CorrectedMatrix(given_matrix, Congruence(Constant(jnp.array([0.1, 0.2, 0.3])), scale))
    assert np.asarray(louder(Q)) == pytest.approx(C @ np.asarray(X) @ C.T, rel=1e-12)
    assert np.array_equal(KnownFriction(jnp.outer)(Q, V), np.outer(Q, V))
    added = CorrectedBlock(KnownFunction(lambda q: q @ q), KnownFunction(lambda q: q[0]))
    assert float(added(Q)) == pytest.approx(0.88)
