"""Blocks over random coefficients: signs, shapes, periodicity, what is trained and what is not."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.blocks import (
    ACTIVATIONS,
    CholeskyBlock,
    Constant,
    Correction,
    JointFriction,
    Known,
    KnownFriction,
    KnownFunction,
    KnownValue,
    MatrixBlock,
    Network,
    NoFriction,
    Perceptron,
    ScalarBlock,
    Sum,
    ViscousFriction,
    count_parameters,
    identity_triangle,
    lower_triangle,
    trainable,
)
from symoden.spaces import Space

Q = jnp.array([0.3, -0.7])
UNIT = Known(jnp.asarray(1.0))
KNEES = (0.1, 1.0)
seeds = st.integers(0, 2**32 - 1)


def constant(*values):
    return Constant(jnp.array(values, float))


@eqx.filter_jit
def evaluate(block, *arguments):
    return block(*arguments)


@given(seed=seeds, floor=st.floats(0.0, 2.0), size=st.floats(1e-3, 1e3))
def test_a_cholesky_block_is_the_scaled_square_of_its_factor_plus_the_floor(seed, floor, size):
    generator = np.random.default_rng(seed)
    entries, scale = size * generator.normal(size=6), generator.uniform(0.1, 3.0, 3)
    block = CholeskyBlock(Constant(jnp.asarray(entries)), Known(jnp.asarray(scale)), floor)
    L = np.zeros((3, 3))
    L[np.tril_indices(3)] = entries
    expected = np.diag(scale) @ (L @ L.T + floor * np.eye(3)) @ np.diag(scale)
    matrix = np.asarray(block(Q))
    assert matrix == pytest.approx(expected, rel=1e-12, abs=1e-12 * np.abs(expected).max())
    unscaled = matrix / np.outer(scale, scale)
    assert np.linalg.eigvalsh(unscaled).min() >= floor - 1e-12 * np.abs(unscaled).max()


def test_a_negative_floor_is_refused():
    with pytest.raises(ValueError, match="`floor` must be at least 0"):
        CholeskyBlock(constant(1.0), Known(jnp.ones(1)), -0.1)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_triangles_are_filled_row_by_row(size):
    entries = np.arange(1.0, size * (size + 1) / 2 + 1)
    expected = np.zeros((size, size))
    expected[np.tril_indices(size)] = entries
    assert np.array_equal(lower_triangle(jnp.asarray(entries), size=size), expected)
    assert np.array_equal(lower_triangle(jnp.asarray(identity_triangle(size)), size=size), np.eye(size))


def test_blocks_scale_what_their_functions_give():
    scale = Known(jnp.array([[2.0, 3.0, 4.0], [5.0, 6.0, 7.0]]))
    matrix = MatrixBlock(constant(1, 2, 3, 4, 5, 6), scale)(Q)
    assert np.array_equal(matrix, [[2.0, 6.0, 12.0], [20.0, 30.0, 42.0]])
    assert float(ScalarBlock(constant(3.0), Known(jnp.asarray(0.5)))(Q)) == 1.5
    assert np.array_equal(KnownValue(scale)(Q), scale.array)
    assert float(KnownFunction(lambda q: q @ q)(Q)) == pytest.approx(0.58)
    assert MatrixBlock(constant(), Known(jnp.zeros((2, 0))))(Q).shape == (2, 0)


def test_constants_are_as_precise_as_what_depends_on_the_configuration():
    single = constant(1, 2).values.astype(jnp.float32)
    given = KnownFunction(lambda q: jnp.ones((1, 2), jnp.float64))
    for block in (Constant(single), KnownValue(Known(single)), given):
        assert block(Q).dtype == Q.dtype == jnp.float64
        assert block(Q.astype(jnp.float32)).dtype == jnp.float32


@pytest.mark.parametrize("activation", ACTIVATIONS)
@given(seed=seeds, turns=st.integers(-3, 3))
def test_a_network_is_periodic_in_angles_only(activation, seed, turns):
    generator = np.random.default_rng(seed)
    plain = Perceptron.init((3, 4, 2), activation=activation, key=jax.random.key(0))
    network = Network(
        Space.parse("R1 T1"), jax.tree.map(lambda x: jnp.asarray(generator.uniform(0.5, 1.5, x.shape)), plain)
    )
    q = jnp.asarray(generator.normal(size=2))
    here, round_, further = (
        np.asarray(evaluate(network, q + jnp.array(step)))
        for step in ([0.0, 0.0], [0.0, 2 * np.pi * turns], [1.0, 0.0])
    )
    assert round_ == pytest.approx(here, abs=1e-10)
    assert further != pytest.approx(here, abs=1e-6)


def test_a_perceptron_is_matrices_and_activations_on_standardised_input():
    center, scale = np.array([0.5, -1.0]), np.array([2.0, 4.0])
    network = Perceptron.init((2, 3, 1), activation="tanh", center=center, scale=scale, key=jax.random.key(1))
    first, last = (np.asarray(weight) for weight in network.weights)
    assert first @ first.T == pytest.approx(np.eye(2), abs=1e-12)  # orthogonal
    z = (np.asarray(Q) - center) / scale
    assert np.asarray(network(Q)) == pytest.approx(np.tanh(z @ first) @ last, abs=1e-14)
    shifted = eqx.tree_at(lambda network: network.biases, network, (jnp.ones(3), jnp.ones(1)))
    assert np.asarray(shifted(Q)) == pytest.approx(np.tanh(z @ first + 1) @ last + 1, abs=1e-14)


def test_waves_start_about_as_steep_as_other_networks():
    def slope(activation, seed):
        key, points = jax.random.split(jax.random.key(seed))
        network = Perceptron.init((3, 16, 16, 4), activation=activation, key=key)
        return jnp.mean(jax.vmap(jax.jacfwd(network))(jax.random.normal(points, (64, 3))) ** 2)

    waves, plain = (np.sqrt(np.mean([slope(each, seed) for seed in range(16)])) for each in ("sin", "tanh"))
    assert waves < 4.5 * plain  # 3 times as steep; 6 times, rollouts diverge.


def test_an_unknown_activation_is_refused():
    with pytest.raises(ValueError, match="`activation` must be one of tanh"):
        Perceptron.init((1, 1), activation="step", key=jax.random.key(0))


def test_a_sum_adds_its_terms():
    total = Sum((constant(1, 2), Correction(constant(10, 20)), constant(100, 200)))
    assert np.array_equal(total(Q), [111.0, 222.0])


def joint(seed, *, directional=False) -> Any:
    generator = np.random.default_rng(seed)
    return JointFriction(
        viscous=Constant(jnp.asarray(generator.normal(size=3))),
        laws=Constant(jnp.asarray(3 * generator.normal(size=2 * JointFriction.shapes(KNEES)))),
        scale=Known(jnp.array([0.5, 2.0])),
        speed=Known(jnp.array([1.5, 0.7])),
        knees=KNEES,
        directions=Constant(jnp.asarray(3 * generator.normal(size=4))) if directional else None,
    )


@given(seed=seeds, spread=st.floats(0.0, 100.0), directional=st.booleans())
def test_joint_friction_takes_energy_whatever_the_signs_of_its_coefficients(seed, spread, directional):
    v = jnp.asarray(spread * np.random.default_rng(seed).normal(size=2))
    D = np.asarray(evaluate(joint(seed, directional=directional), Q, v))
    assert np.array_equal(D, D.T)
    assert np.linalg.eigvalsh(D).min() >= -1e-12 * np.abs(D).max()
    assert v @ D @ v >= 0


@given(seed=seeds, spread=st.floats(0.0, 100.0))
def test_joint_friction_has_no_preferred_direction_unless_it_may(seed, spread):
    v = jnp.asarray(spread * np.random.default_rng(seed).normal(size=2))
    there, back = (np.asarray(evaluate(joint(seed), Q, each)) for each in (v, -v))
    assert back == pytest.approx(there, rel=1e-12)


def test_directional_friction_brakes_one_way_more_by_a_constant_force_and_a_viscous_one():
    unit = Known(jnp.ones(1))

    def force(speed, *, dry, offset, viscous):
        directions = constant(offset, viscous)
        friction = JointFriction(constant(0.0), constant(dry, 0.0, 0.0), unit, unit, (0.01,), directions)
        return float(friction(Q[:1], jnp.array([speed]))[0, 0] * speed)

    for speed in (0.2, 1.0, 5.0):
        there, back = (force(sign * speed, dry=2.0, offset=0.5, viscous=0.0) for sign in (1.0, -1.0))
        assert (there - back) / 2 == pytest.approx(0.02, rel=0.01)  # dry friction, on either side
        assert (there + back) / 2 == pytest.approx(0.005, rel=0.01)  # of a force that is always there
    there, back = (force(sign * 50.0, dry=100.0, offset=0.0, viscous=0.01) for sign in (1.0, -1.0))
    assert (there + back) / 2 == pytest.approx(0.5, rel=0.01)


@given(seed=seeds)
def test_a_whole_direction_makes_friction_twice_as_large_one_way(seed):
    even = eqx.tree_at(lambda f: f.laws.values, joint(seed), replace_fn=jnp.abs)
    for shape in range(2):
        whole = jnp.where(np.arange(4) % 2 == shape, even.whole_directions(Q), 0)
        uneven = dataclasses.replace(even, directions=Constant(whole))
        there, both = (np.diag(np.asarray(each(Q, even.speed.value))) for each in (uneven, even))
        assert there == pytest.approx(2 * both, rel=1e-6)


@pytest.mark.parametrize("directional", [False, True])
def test_joint_friction_follows_its_formula(directional):
    friction, v = joint(2, directional=directional), np.array([0.4, -1.2])
    w = v / np.array([1.5, 0.7])
    coefficients = np.asarray(friction.laws(Q)).reshape(2, -1)
    if directional:
        coefficients = np.concatenate([coefficients, np.asarray(friction.directions(Q)).reshape(2, 2)], axis=1)
    law = [
        coefficients[i]
        @ [
            *((1 + (w[i] / k) ** 2) ** -0.5 for k in KNEES),
            *(1 / (1 + (w[i] / k) ** 2) for k in KNEES),
            (1 + w[i] ** 2) ** 0.5 - 1,
            *([w[i] / KNEES[0] / (1 + (w[i] / KNEES[0]) ** 2), w[i] / (1 + w[i] ** 2) ** 0.5] if directional else []),
        ]
        for i in range(2)
    ]
    assert min(law) < -0.1 < 0.1 < max(law)  # Both branches: a joint that brakes, and one whose law would push.
    B = np.zeros((2, 2))
    B[np.tril_indices(2)] = friction.viscous.values
    S = np.diag([0.5, 2.0])
    expected = S @ (B @ B.T + np.diag(np.maximum(law, 0))) @ S
    assert np.asarray(friction(Q, jnp.asarray(v))) == pytest.approx(expected, rel=1e-9)


def test_joint_friction_is_dry_at_low_and_quadratic_at_high_speed():
    unit = Known(jnp.ones(1))

    def force(coefficients, speed):
        friction = JointFriction(constant(0.0), constant(*coefficients), unit, unit, (0.01,))
        return float(friction(Q[:1], jnp.array([speed]))[0, 0] * speed)

    dry = [force([1.0, 0.0, 0.0], speed) for speed in (0.1, 1.0, 10.0)]
    assert dry == pytest.approx([0.01] * 3, rel=0.01)  # the same at every speed above the knee
    nothing = [force([0.0, 0.0, 0.0], speed) for speed in (0.1, 10.0)]
    assert nothing == pytest.approx([0.0, 0.0], abs=1e-5)
    drag = [force([0.0, 0.0, 1.0], speed) for speed in (1e4, 4e4)]
    assert drag[1] / drag[0] == pytest.approx(16.0, rel=0.1)


def test_friction_without_velocity_and_no_friction():
    matrix = jnp.array([[2.0, 1.0], [1.0, 3.0]])
    assert np.array_equal(ViscousFriction(KnownValue(Known(matrix)))(Q, 5 * Q), matrix)
    nothing = NoFriction()(Q.astype(jnp.float32), Q)
    assert nothing.dtype == jnp.float32
    assert KnownFriction(lambda q, v: jnp.eye(2, dtype=jnp.float64))(Q.astype(jnp.float32), Q).dtype == jnp.float32
    assert not nothing.any()


@given(seed=seeds, spread=st.floats(1e-3, 1e3))
def test_dry_and_viscous_friction_add_up(seed, spread):
    unit, v = Known(jnp.ones(1)), spread * np.random.default_rng(seed).uniform(0.1, 1.0, size=1)
    sheet = [JointFriction(constant(b), constant(c, 0.0, 0.0), unit, unit, (0.5,)) for b, c in ((2, 0), (0, 3), (2, 3))]
    viscous, dry, both = (float(evaluate(friction, Q[:1], jnp.asarray(v))[0, 0]) for friction in sheet)
    assert both == pytest.approx(viscous + dry, rel=1e-6, abs=2e-6)


def test_known_arrays_have_no_derivative_and_are_not_trained():
    block = MatrixBlock(constant(1.0, 2.0), Known(jnp.ones((2, 1))))
    slopes = eqx.filter_grad(lambda block: jnp.sum(block(Q)))(block)
    assert not slopes.scale.array.any()
    assert slopes.function.values.all()
    assert count_parameters(block) == 2


@pytest.mark.parametrize("kind", [0, 3, 64])
def test_a_correction_is_of_one_kind(kind):
    with pytest.raises(ValueError, match=f"NETWORKS, INERTIA or POTENTIAL; got {kind}"):
        Correction(constant(1), kind=kind)


def test_corrections_are_free_by_their_kinds():
    early, late, last = (Correction(constant(*range(size)), kind=kind) for kind, size in ((1, 3), (2, 4), (8, 5)))
    tree = {"sum": Sum((constant(1, 2), early, late, last)), "unit": UNIT, "count": jnp.arange(3)}
    free = [
        sum(leaf.size for leaf in jax.tree.leaves(eqx.filter(tree, trainable(tree, corrections=kinds))))
        for kinds in (0, 1, 2, 3, 8, 9, 15)
    ]
    assert free == [2, 5, 6, 9, 7, 10, 14]
    assert [count_parameters(tree, corrections=kinds) for kinds in (0, 1, 2, 3, 8, 9, 15)] == free
    assert count_parameters(tree) == 14
