"""Coordinates that nothing depends on: over random states and weights, every part is the same wherever they are."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.blocks import CORRECTIONS, Correction, kinds_in_use, trainable
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, Scales, build, check_known, load, rescale, save
from symoden.spaces import Space
from symoden.testing import check_mass_matrix, check_periodicity, check_power_balance, check_round_trip

NETWORK = BlockConfig(hidden=(5,))
CONFIGS = {
    "default": ModelConfig(),
    "networks": ModelConfig(inverse_mass=NETWORK, potential=NETWORK, actuation=NETWORK, friction=NETWORK, knees=()),
    "frictionless": ModelConfig(kind="symoden"),
}
MACHINES = [
    ("T2", ("q1",)),
    ("R1 T1", ("q1",)),
    ("T1 R1 T1", ("q3", "q1")),
    ("R2 T1", ("q3",)),
    ("R1 T1", ("q1", "q2")),
]
seeds = st.integers(0, 2**32 - 1)


def made(config, space, cyclic, **parts) -> Any:
    known = KnownParts(cyclic=cyclic, **parts)
    return build(CONFIGS[config], Space.parse(space), 2, known=known, key=jax.random.key(0))


MODELS = {(config, *machine): made(config, *machine) for config in CONFIGS for machine in MACHINES}


@eqx.filter_jit
def fields(model, q, v):
    slope = jax.grad(lambda q: model.hamiltonian(q, jnp.zeros_like(q)))(q)
    return model.mass_matrix(q), slope, model.input_matrix(q), model.dissipation_matrix(q, v)


@pytest.mark.parametrize("name", MODELS, ids=lambda name: " ".join(map(str, name)))
@given(seed=seeds, weights=st.floats(0.1, 2.0), far=st.floats(-1e3, 1e3))
@settings(max_examples=20)
def test_nothing_depends_on_a_cyclic_coordinate_and_all_on_the_others(name, scrambled, seed, weights, far):
    model, cyclic = scrambled(MODELS[name], seed, weights), name[2]
    n = model.space.size
    q, v = jnp.asarray(np.random.default_rng(seed).standard_normal((2, n)))
    moves = jnp.asarray([f"q{i + 1}" in cyclic for i in range(n)], float)
    here, there, elsewhere = (fields(model, q + step, v) for step in (0, far * moves, 0.5 * (1 - moves)))
    for one, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(np.asarray(one), np.asarray(other))
    if len(cyclic) < n:
        assert not np.allclose(here[0], elsewhere[0], rtol=1e-6) or not np.allclose(here[1], elsewhere[1], rtol=1e-6)


@given(seed=seeds, weights=st.floats(0.1, 2.0))
@settings(max_examples=20)
def test_the_momentum_of_a_cyclic_coordinate_is_conserved(scrambled, seed, weights):
    model: Any = scrambled(MODELS["frictionless", "T1 R1 T1", ("q3", "q1")], seed, weights)
    q, p = jnp.asarray(np.random.default_rng(seed).standard_normal((2, 3)))
    _, p_dot = model.vector_field(q, p, jnp.zeros(2))
    assert np.asarray(p_dot)[[0, 2]] == pytest.approx([0.0, 0.0], abs=0)
    assert p_dot[1] != 0


@pytest.mark.parametrize("name", MODELS, ids=lambda name: " ".join(map(str, name)))
def test_such_models_keep_the_laws_and_come_back_from_files(name, scrambled, tmp_path):
    model = scrambled(MODELS[name], 1, 0.3)
    for check in (check_mass_matrix, check_power_balance, check_periodicity, check_round_trip):
        check(model)
    save(tmp_path / "model.safetensors", model)
    assert eqx.tree_equal(load(tmp_path / "model.safetensors"), model)
    q = jnp.ones(model.space.size)
    assert np.asarray(rescale(model, 7.0).mass_matrix(q)) == pytest.approx(np.asarray(model.mass_matrix(q)) / 7)


def test_corrections_of_what_is_left_are_found_in_use(scrambled):
    model = MODELS["default", "R1 T1", ("q1",)]
    assert kinds_in_use(model) == 0
    kinds = [each.kind for each in jax.tree.leaves(model, is_leaf=is_correction) if is_correction(each)]
    for kind in kinds:
        free, fixed = eqx.partition(model, trainable(model, corrections=kind))
        loud = eqx.combine(jax.tree.map(lambda leaf: leaf + 1.0, free), fixed)
        assert kinds_in_use(loud) == kind
    assert kinds_in_use(scrambled(model, 1)) == CORRECTIONS & sum(set(kinds))


def is_correction(node):
    return isinstance(node, Correction)


def test_corrections_of_given_parts_do_not_depend_on_it_either(scrambled):
    parts = {
        "mass_matrix": [["2 + cos(q2)", 0], [0, 1]],
        "potential_energy": "-cos(q2)",
        "input_matrix": [[1, 0], [0, 1]],
    }
    model = scrambled(made("default", "T2", ("q1",), **parts, correct=tuple(parts)), 1)
    v = jnp.ones(2)
    here, there, elsewhere = (fields(model, jnp.array(q), v) for q in ([0.1, 0.2], [5.0, 0.2], [0.1, 0.9]))
    for one, same, other in zip(here, there, elsewhere, strict=True):
        np.testing.assert_array_equal(np.asarray(one), np.asarray(same))
        assert not np.allclose(one, other, rtol=1e-9)


def test_scales_of_the_others_stay_theirs():
    space = Space.parse("R1 T1 R1")
    scales = Scales(
        center=np.array([10.0, 20.0, 0.0, 0.0]),
        spread=np.array([3.0, 4.0, 1.0, 1.0]),
        velocity=np.ones(3),
        momentum=np.ones(3),
        input=np.ones(1),
        time=1.0,
    )
    known = KnownParts(cyclic=("q1",))
    model: Any = build(CONFIGS["networks"], space, 1, scales=scales, known=known, key=jax.random.key(0))
    perceptron = model.potential.function.function.perceptron
    assert np.asarray(perceptron.center.array).tolist() == [20.0, 0.0, 0.0]
    assert np.asarray(perceptron.scale.array).tolist() == [4.0, 1.0, 1.0]


def test_coordinates_that_are_not_there_or_that_a_function_depends_on_are_refused():
    with pytest.raises(ValueError, match="`cyclic`: the space T2 has the coordinates q1 to q2; got `q3`"):
        made("default", "T2", ("q3",))
    q, v = np.random.default_rng(0).normal(size=(2, 20, 2))
    known = KnownParts(cyclic=("q1",), potential_energy=lambda q: jnp.cos(q[0]))
    with pytest.raises(ValueError, match=r"`potential_energy` must .* after q1 has moved, which `cyclic` names"):
        check_known(known, Space.parse("T2"), 0, q, v)
    for falls in (lambda q: 9.81 * q[0], lambda q: jnp.cos(2 * jnp.pi * q[0]) + q[1]):
        with pytest.raises(ValueError, match="which `cyclic` names"):
            check_known(KnownParts(cyclic=("q1",), potential_energy=falls), Space.parse("R2"), 0, q, v)
    check_known(KnownParts(cyclic=("q2",), potential_energy=known.potential_energy), Space.parse("T2"), 0, q, v)
