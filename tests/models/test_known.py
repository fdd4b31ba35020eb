"""Known parts in a model: they are what was given, keep to every law, fix the scale, and come back from a file."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import KnownFunction, KnownValue, count_parameters
from symoden.evaluation import anchor
from symoden.integrate import rollout
from symoden.known import KnownParts
from symoden.models import (
    BlockConfig,
    ModelConfig,
    Scales,
    build,
    check_known,
    given_parts,
    known_magnitudes,
    load,
    parts_that_fix_the_scale,
    rescale,
    save,
)
from symoden.spaces import Space
from symoden.storage import StorageError, load_arrays, save_arrays
from symoden.systems import Acrobot
from symoden.testing import check_mass_matrix, check_periodicity, check_power_balance, check_round_trip

SPACE = Space.parse("T2")
ACROBOT = Acrobot(masses=(1.0, 0.8), centres=(0.4, 0.3), inertias=(0.1, 0.07), dampings=(0.2, 0.05))
NUMBERS = {"l": ACROBOT.lengths[0], "g": ACROBOT.gravity, "m1": 1.0, "c1": 0.4, "c2": 0.3, "I1": 0.1, "I2": 0.07}
M12 = "m2*(c2**2 + l*c2*cos(q2)) + I2"
PARTS: dict[str, Any] = {
    "mass_matrix": [["m1*c1**2 + m2*(l**2 + c2**2 + 2*l*c2*cos(q2)) + I1 + I2", M12], [M12, "m2*c2**2 + I2"]],
    "potential_energy": "-(m1*c1 + m2*l)*g*cos(q1) - m2*c2*g*cos(q1 + q2)",
    "input_matrix": [[0], ["1 - 0"]],
    "dissipation_matrix": [["b", 0], [0, "0.05 + 0*v2"]],
}
OPEN = {"m2": 0.8, "b": 0.2}
SMALL = ModelConfig(
    inverse_mass=BlockConfig(hidden=(3,)),
    potential=BlockConfig(hidden=(3,)),
    actuation=BlockConfig(constant=True),
    friction=BlockConfig(constant=True),
)
GENERATOR = np.random.default_rng(0)
STATES, RATES = GENERATOR.normal(size=(2, 20, 2))


def known(*names, constants=NUMBERS, parameters=OPEN, **others):
    """The named parts of the acrobot, with the parameters that stand in them."""
    given: dict[str, Any] = {name: PARTS[name] for name in names} | others
    stand = {name for name in parameters if any(name in str(part) for part in given.values() if not callable(part))}
    return KnownParts(**given, constants=constants, parameters={name: parameters[name] for name in sorted(stand)})


def made(parts, config=SMALL, **others) -> Any:
    return build(config, SPACE, 1, known=parts, key=jax.random.key(0), **others)


@eqx.filter_jit
def fields(model, q, v):
    M, g, D = model.mass_matrix(q), model.input_matrix(q), model.dissipation_matrix(q, v)
    slope = jax.grad(lambda q: model.hamiltonian(q, jnp.zeros_like(q)))(q)
    return M, model.inverse_mass_matrix(q), slope, g, D


def test_a_model_of_known_parts_is_the_system():
    model = made(known(*PARTS))
    assert count_parameters(model) == 2
    for q, v in zip(jnp.asarray(STATES), jnp.asarray(RATES), strict=True):
        for found, true in zip(fields(model, q, v), fields(ACROBOT, q, v), strict=True):
            assert np.asarray(found) == pytest.approx(np.asarray(true), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", PARTS)
def test_one_part_may_be_known_and_the_others_learned(name):
    model, learned = made(known(name)), made(None)
    q, v = jnp.asarray(STATES[0]), jnp.asarray(RATES[0])
    of = {"mass_matrix": (0, 1), "potential_energy": (2,), "input_matrix": (3,), "dissipation_matrix": (4,)}
    for i, values in enumerate(zip(fields(model, q, v), fields(ACROBOT, q, v), fields(learned, q, v), strict=True)):
        found, true, other = map(np.asarray, values)
        assert found == pytest.approx(true if i in of[name] else other, rel=1e-12)
    assert list(given_parts(model)) == [name]


def test_functions_and_numbers_are_parts_too():
    functions = known(
        mass_matrix=ACROBOT.mass_matrix,
        potential_energy=ACROBOT.potential_energy,
        dissipation_matrix=ACROBOT.dissipation_matrix,
        input_matrix=np.array([[0.0], [1.0]]),
    )
    model = made(functions)
    q, v = jnp.asarray(STATES[1]), jnp.asarray(RATES[1])
    for found, true in zip(fields(model, q, v), fields(ACROBOT, q, v), strict=True):
        assert np.asarray(found) == pytest.approx(np.asarray(true), rel=1e-12)
    assert isinstance(model.actuation, KnownValue)
    block = KnownFunction(ACROBOT.potential_energy)
    assert made(known(potential_energy=block)).potential is block


CORRECTED = tuple(PARTS)


@pytest.mark.parametrize("correct", [(), CORRECTED], ids=["exact", "corrected"])
def test_known_models_keep_the_laws(correct, scrambled):
    model = scrambled(made(dataclasses.replace(known(*PARTS), correct=correct)), 1, 0.3)
    for check in (check_mass_matrix, check_power_balance, check_periodicity, check_round_trip):
        check(model)


@pytest.mark.parametrize("name", PARTS)
def test_a_correction_is_silent_at_first_and_then_changes_its_part(name, scrambled):
    exact, corrected = made(known(*PARTS)), made(dataclasses.replace(known(*PARTS), correct=(name,)))
    q, v = jnp.asarray(STATES[0]), jnp.asarray(RATES[0])
    loud = eqx.tree_at(lambda m: m.parameters, scrambled(corrected, 1), exact.parameters)
    of = {"mass_matrix": {0, 1}, "potential_energy": {2}, "input_matrix": {3}, "dissipation_matrix": {4}}[name]
    triples = zip(*(fields(model, q, v) for model in (exact, corrected, loud)), strict=True)
    for i, (plain, silent, changed) in enumerate(triples):
        assert np.asarray(silent) == pytest.approx(np.asarray(plain), rel=1e-12, abs=1e-12)
        assert np.allclose(plain, changed, rtol=1e-6, atol=1e-9) == (i not in of)
    assert count_parameters(corrected, corrections=0) == 2
    assert given_parts(corrected)[name] == "given up to a correction"


@pytest.mark.parametrize("correct", [(), CORRECTED], ids=["exact", "corrected"])
def test_a_known_model_comes_back_from_its_file(correct, scrambled, tmp_path):
    model = scrambled(made(dataclasses.replace(known(*PARTS), correct=correct)), 2)
    save(tmp_path / "model.safetensors", model)
    assert eqx.tree_equal(load(tmp_path / "model.safetensors"), model)


def test_parameters_of_older_files_that_start_at_zero_have_unit_one(scrambled, tmp_path):
    path, parts = tmp_path / "model.safetensors", known(*PARTS, parameters=OPEN | {"b": 0.0})
    scales = dataclasses.replace(Scales.units(SPACE, 1), parameters={"b": 3.0})
    new, old = (scrambled(made(parts, scales=each), 2) for each in (scales, None))
    save(path, new)
    assert eqx.tree_equal(load(path), new)
    b, m2 = np.asarray(old.parameters.values)
    assert np.asarray(new.parameters.values) == pytest.approx([3 * b, m2])
    save(path, old)
    arrays, metadata = load_arrays(path)
    assert metadata["structure"]["fields"]["parameters"]["fields"].pop("unit", "absent") is None
    save_arrays(path, arrays, metadata)
    assert eqx.tree_equal(load(path), old)


@pytest.mark.parametrize(
    "text", ["__import__('os')", "q1.real", "9**9**9", "(" * 3000, "q9", "1" * 5000], ids=lambda text: text[:9]
)
def test_a_file_with_a_hostile_formula_is_refused(text, tmp_path):
    path = tmp_path / "model.safetensors"
    save(path, made(known(*PARTS)))
    arrays, metadata = load_arrays(path)
    metadata["structure"]["fields"]["potential"]["fields"]["formula"]["fields"]["texts"][0] = text
    save_arrays(path, arrays, metadata)
    with pytest.raises(StorageError, match="must describe a model of this version"):
        load(path)


def test_functions_are_not_saved(tmp_path):
    for part in ({"potential_energy": ACROBOT.potential_energy}, {"dissipation_matrix": ACROBOT.dissipation_matrix}):
        with pytest.raises(StorageError, match="Give known parts as formulas"):
            save(tmp_path / "model", made(known(**part)))


@eqx.filter_jit
def motion(model, q, v, us):
    path = rollout(model, q, v, 0.01 * jnp.arange(12.0), us)
    return path.q, path.rates


def test_predictions_do_not_depend_on_the_scale(scrambled):
    functions = known(dissipation_matrix=ACROBOT.dissipation_matrix, mass_matrix=ACROBOT.mass_matrix)
    us = jnp.ones((12, 1))
    for parts in (known(*PARTS), dataclasses.replace(known(*PARTS), correct=CORRECTED), functions):
        model = scrambled(made(parts), 3, 0.3)
        plain, scaled = (
            motion(m, jnp.asarray(STATES[0]), jnp.asarray(RATES[0]), us) for m in (model, rescale(model, 7.0))
        )
        for before, after in zip(plain, scaled, strict=True):
            assert np.asarray(after) == pytest.approx(np.asarray(before), abs=1e-9)
        assert np.asarray(rescale(model, 7.0).mass_matrix(jnp.ones(2))) == pytest.approx(
            np.asarray(model.mass_matrix(jnp.ones(2))) / 7, rel=1e-9
        )


ONE_MASS = {"potential_energy": "-m*g*cos(q1)", "constants": {"g": 9.81}, "parameters": {"m": 1.0}}
SCALES = [
    (known("mass_matrix"), ("mass_matrix",)),  # m2 alone cannot take the factor up
    (known("mass_matrix", "input_matrix"), ("mass_matrix", "input_matrix")),
    (known("dissipation_matrix"), ("dissipation_matrix",)),
    (KnownParts(dissipation_matrix=[["b", 0], [0, "2*b"]], parameters={"b": 1.0}), ()),
    (KnownParts(**ONE_MASS), ()),
    (KnownParts(**ONE_MASS | {"correct": ("potential_energy",), "parameters": {"m": 1.0}}), ()),
    (KnownParts(**ONE_MASS, input_matrix=[["m"], [0]]), ()),
    (KnownParts(**ONE_MASS, input_matrix=[["m**2"], [0]]), ("potential_energy", "input_matrix")),
    (KnownParts(potential_energy=0, input_matrix=[[0], [0]]), ()),
    (KnownParts(potential_energy="2*sqrt(q1)"), ("potential_energy",)),  # Not a number where q1 is below zero.
    (KnownParts(potential_energy="k*sqrt(q1)", parameters={"k": 1.0}), ()),
]


@pytest.mark.parametrize(("parts", "expected"), SCALES, ids=[str(i) for i in range(len(SCALES))])
def test_what_is_known_fixes_the_scale_unless_its_parameters_can_take_it_up(parts, expected):
    model = made(parts)
    assert parts_that_fix_the_scale(model) == expected
    fixes_all = "none: only ratios are known; one constant that is fixes all: `input_matrix`, or a mass under `[known]`"
    assert anchor(model) == (f"{', '.join(expected)} given" if expected else fixes_all)


def test_free_motion_fixes_no_scale():
    free = build(SMALL, SPACE, 0, key=jax.random.key(0))
    assert anchor(free) == "none: only ratios are known; one constant that is fixes all: a mass under `[known]`"


def test_magnitudes_are_momenta_of_known_inertia_and_known_forces():
    us = np.ones((20, 1))
    assert known_magnitudes(known("mass_matrix"), SPACE, STATES, RATES, us).force is None
    found = known_magnitudes(known(*PARTS), SPACE, STATES, RATES, us)
    momenta = [fields(ACROBOT, jnp.asarray(q), jnp.asarray(v))[0] @ v for q, v in zip(STATES, RATES, strict=True)]
    assert found.momentum == pytest.approx(np.sqrt(np.mean(np.square(momenta), axis=0)))
    assert found.force == pytest.approx([0.0, 1.0])
    slopes = [fields(ACROBOT, jnp.asarray(q), jnp.asarray(q))[2] for q in STATES]
    load = known_magnitudes(known("potential_energy", "dissipation_matrix"), SPACE, STATES, RATES, us).force
    assert load == pytest.approx(np.sqrt(np.mean(np.square(slopes), axis=0)))
    drag = known_magnitudes(known("dissipation_matrix"), SPACE, STATES, RATES, us).force
    assert drag == pytest.approx(np.sqrt(np.mean(RATES**2, axis=0)) * [0.2, 0.05])


UNFIT = [
    ({"mass_matrix": [[1, 2], [2, 1]]}, "`mass_matrix` must be positive definite at every state"),
    ({"mass_matrix": [[1, 0.1], [0, 1]]}, "`mass_matrix` must be symmetric"),
    ({"mass_matrix": [["1/0", 0], [0, 1]]}, "`mass_matrix` must be finite"),
    ({"dissipation_matrix": [["v1", 0], [0, 1]]}, "`dissipation_matrix` must be positive semidefinite"),
    ({"potential_energy": "q1**2"}, "must have a slope that is the same after a turn of q1.*period of 2π"),
    ({"input_matrix": [["q2"], [1]]}, "`input_matrix` must be the same after a turn of q2"),
    ({"potential_energy": "log(q1)"}, "must have a slope that is finite|a turn"),
]


@pytest.mark.parametrize(("part", "message"), UNFIT, ids=[message for _, message in UNFIT])
def test_what_no_mechanism_has_is_refused_at_the_states_in_the_data(part, message):
    with pytest.raises(ValueError, match=message):
        check_known(KnownParts(**part), SPACE, 1, STATES, RATES)


def test_what_a_mechanism_has_is_not_refused():
    check_known(known(*PARTS), SPACE, 1, STATES, RATES)
    check_known(KnownParts(potential_energy="3*q1", dissipation_matrix=[[0, 0], [0, 0]]), SPACE, 1, STATES, RATES)


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e3])
def test_units_do_not_make_a_matrix_definite_or_not(unit):
    """The second coordinate is counted in another unit: 200 kg beside 1e-4 kg m² are as definite as in any other."""

    def check(name, a, b, c):
        part: dict[str, Any] = {name: [[a, b * unit], [b * unit, c * unit**2]]}
        check_known(KnownParts(**part), SPACE, 1, STATES, RATES)

    check("mass_matrix", 200.0, 10.0, 1.0)
    check("dissipation_matrix", 4.0, 2.0, 1.0)
    check("dissipation_matrix", 0.0, 0.0, 1.0)
    for name, *entries in (
        ("mass_matrix", 200.0, 15.0, 1.0),
        ("mass_matrix", 200.0, 0.0, -1.0),
        ("dissipation_matrix", 4.0, 2.1, 1.0),
        ("dissipation_matrix", 4.0, 0.0, -1e-3),
        ("dissipation_matrix", 0.0, 0.1, 1.0),
    ):
        with pytest.raises(ValueError, match=r"must be positive (semi)?definite"):
            check(name, *entries)


@pytest.mark.parametrize("coupling", [1e-2, 1e-5, 1e-9])
@pytest.mark.parametrize("other", [0, 1])
def test_a_joint_without_friction_of_its_own_has_no_coupling_however_small(coupling, other):
    """vᵀ D v = 2 ε v₁ v₂ + d v₂² is negative at v = (−1, ε)."""
    v = np.array([-1.0, coupling])
    matrix: Any = [[0, coupling], [coupling, other]]
    assert v @ np.array(matrix) @ v < 0
    with pytest.raises(ValueError, match="`dissipation_matrix` must be positive semidefinite"):
        check_known(KnownParts(dissipation_matrix=matrix), SPACE, 1, STATES, RATES)


MISFITS = [
    ({"mass_matrix": [[1]]}, "`mass_matrix` must be 2 × 2; got 1 × 1"),
    ({"input_matrix": [[1, 0], [0, 1]]}, "`input_matrix` must be 2 × 1; got 2 × 2"),
    ({"potential_energy": "cos(q3)"}, "has the coordinates q1 to q2; got `q3`"),
    ({"mass_matrix": lambda q: q}, "must be a function that gives an array, 2 × 2; got 2"),
    ({"mass_matrix": lambda q: [[1.0 + q[0] ** 2, 0.0], [0.0, 1.0]]}, r"gives an array; got list. Return `jnp.array"),
    ({"potential_energy": lambda q: None}, "gives an array; got NoneType"),
    (
        {"potential_energy": lambda q: np.cos(q[0])},
        "`potential_energy` must be a function that JAX can trace .* in place",
    ),
    ({"potential_energy": lambda q: 1.0 if q[0] > 0 else 0.0}, "and `jnp.where` in place of `if`"),
    ({"potential_energy": lambda q: jnp.sum(q[q > 0])}, r"must be a function that JAX can trace .* of `x\[x > 0\]`"),
    ({"dissipation_matrix": lambda q, v: jnp.outer(q, v)[:1]}, "2 × 2; got 1 × 2"),
]


@pytest.mark.parametrize(("part", "message"), MISFITS, ids=[message for _, message in MISFITS])
def test_parts_of_another_mechanism_are_refused(part, message):
    with pytest.raises(ValueError, match=message):
        made(KnownParts(**part))


@pytest.mark.parametrize("kind", ["naive", "geometric", "unstructured"])
def test_models_without_such_parts_refuse_them(kind):
    with pytest.raises(ValueError, match=f"kinds dissipative and symoden; got {kind}"):
        made(known("mass_matrix"), dataclasses.replace(SMALL, kind=kind))


def test_a_model_without_friction_refuses_known_friction():
    frictionless = dataclasses.replace(SMALL, kind="symoden")
    assert given_parts(made(known("mass_matrix"), frictionless)) == {"mass_matrix": "given up to parameters"}
    with pytest.raises(ValueError, match="has no friction; got a known `dissipation_matrix`"):
        made(known("dissipation_matrix"), frictionless)
