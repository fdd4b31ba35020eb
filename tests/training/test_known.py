"""Learning what is not known: parameters are recovered, and the rest comes out in physical units."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.blocks import Correction
from symoden.data import Dataset, DataWarning, Trajectory
from symoden.integrate import RK4, rollout
from symoden.known import Body, KnownParts, Robot
from symoden.models import BlockConfig, ModelConfig
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.systems import CartPole, Pendulum
from symoden.training import TrainingConfig, fit, measure_scales
from symoden.training._prepare import prepare

CONSTANT = BlockConfig(constant=True)
TRUTH = Pendulum(damping=0.2)
INERTIA, LOAD = float(TRUTH.mass_matrix(jnp.zeros(1))[0, 0]), float(TRUTH.potential_energy(jnp.array([jnp.pi]))) / 2
MODEL = ModelConfig(
    inverse_mass=CONSTANT, potential=BlockConfig(hidden=(4,)), actuation=CONSTANT, friction=CONSTANT, knees=()
)
STEPS = TrainingConfig(
    validation=0.0, adam_steps=0, lm_steps=8, lm_horizon=7, lm_substeps=4, growth_steps=0, relevance_steps=0
)
EXACT: dict[str, Any] = {
    "mass_matrix": [["J"]],
    "potential_energy": "-w*cos(q1)",
    "input_matrix": [[1]],
    "dissipation_matrix": [["d"]],
}


def knowing(dataset, **parts: Any):
    return dataclasses.replace(dataset, known=KnownParts(**parts))


def test_two_parameters_are_recovered_in_a_few_steps(pendulum):
    dataset = knowing(pendulum(), **EXACT, constants={"J": INERTIA}, parameters={"w": 2 * LOAD, "d": 0.05})
    found: Any = fit(dataset, model=MODEL, config=STEPS).model
    assert found.parameters.names == ("w", "d")
    assert np.asarray(found.parameters.values) == pytest.approx([LOAD, 0.2], rel=1e-4)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
def test_parameters_that_start_at_zero_are_recovered_in_any_unit(pendulum, unit):
    parts = EXACT | {"mass_matrix": [[unit * INERTIA]], "input_matrix": [[unit]]}
    dataset = knowing(pendulum(), **parts, parameters={"w": 0.0, "d": 0.0})
    found: Any = fit(dataset, model=MODEL, config=STEPS).model
    assert np.asarray(found.parameters.values) / unit == pytest.approx([LOAD, 0.2], rel=1e-3)


def test_arrays_of_a_known_module_stay_as_they_are_and_one_warning_says_so(pendulum):
    load = eqx.nn.Linear(1, "scalar", use_bias=False, key=jax.random.key(0))
    potential = jax.tree_util.Partial(lambda load, q: load(jnp.cos(q)), load)
    with pytest.warns(DataWarning, match=r"arrays in the known `potential_energy` stay as they are: .* `parameters`"):
        found: Any = fit(knowing(pendulum(), potential_energy=potential), model=MODEL, config=STEPS, max_minutes=1e-9)
    assert eqx.tree_equal(found.model.potential.function, potential)


def test_a_known_inertia_gives_the_rest_in_physical_units(pendulum):
    formula = {"potential_energy": "-w*cos(q1)", "parameters": {"w": 3 * LOAD}}  # Could take any unit up.
    dataset = knowing(pendulum(), mass_matrix=[[INERTIA]], **formula)
    found: Any = fit(dataset, model=MODEL, config=STEPS).model
    q, v = jnp.array([0.4]), jnp.array([0.7])
    assert found.mass_matrix(q)[0, 0] == pytest.approx(INERTIA, rel=1e-6)
    assert found.input_matrix(q)[0, 0] == pytest.approx(1.0, rel=1e-3)
    assert found.dissipation_matrix(q, v)[0, 0] == pytest.approx(0.2, rel=1e-3)
    assert jax.grad(found.potential_energy)(q)[0] == pytest.approx(LOAD * np.sin(0.4), rel=1e-3)


def test_a_part_that_is_nearly_right_is_corrected_in_the_growth_stage(pendulum):
    nearly = EXACT | {"potential_energy": f"-{0.8 * LOAD}*cos(q1)", "correct": ("potential_energy",)}
    dataset = knowing(pendulum(count=4), **nearly, constants={"J": INERTIA, "d": 0.2})
    config = dataclasses.replace(STEPS, validation=0.25, growth_steps=6, adam_steps=5)
    stages, state = prepare(dataset, MODEL, config)[:2]
    assert [stage.name for stage in stages] == ["growth"]  # Nothing else is free.
    long = dataclasses.replace(dataset, train=pendulum(count=12, samples=200).train)
    stages, _ = prepare(long, MODEL, dataclasses.replace(config, lm_horizon=None))[:2]
    assert [stage.name for stage in stages] == ["growth"]  # Nor in longer windows.
    before: Any = state.model
    after: Any = fit(dataset, model=MODEL, config=config).model
    assert isinstance(after.potential.correction.function, Correction)
    q = jnp.array([1.2])
    slopes = [float(jax.grad(model.potential_energy)(q)[0]) for model in (before, after)]
    assert slopes == pytest.approx([0.8 * LOAD * np.sin(1.2), LOAD * np.sin(1.2)], rel=0.02)


def test_what_hangs_on_a_robots_joint_is_recovered(pendulum):
    guess = np.array([[0.3, 0, 0, 0], [0, 0.3, 0, 0], [0, 0, 0.5, -0.4], [0, 0, -0.4, 0.8]])
    body = Body(
        joint="hinge",
        coordinate=0,
        parent=-1,
        prismatic=False,
        axis=(0, 1, 0),
        origin=tuple(map(tuple, np.eye(4).tolist())),
        inertia=tuple(map(tuple, guess.tolist())),
    )
    formulas = {name: EXACT[name] for name in ("input_matrix", "dissipation_matrix")}
    dataset = knowing(pendulum(), robot=Robot(bodies=(body,)), parameters={"d": 0.05}, **formulas)
    # Nothing is drawn that Adam were needed for.
    for steps, names in ((8, ["regression", "levenberg-marquardt"]), (0, ["adam"])):
        config = dataclasses.replace(STEPS, adam_steps=9, lm_steps=steps, restarts=1)
        assert [stage.name for stage in prepare(dataset, MODEL, config)[0]] == names
    found: Any = fit(dataset, model=MODEL, config=STEPS).model
    q = jnp.array([0.4])
    assert found.mass_matrix(q)[0, 0] == pytest.approx(INERTIA, rel=1e-3)
    assert jax.grad(found.potential_energy)(q)[0] == pytest.approx(LOAD * np.sin(0.4), rel=1e-3)
    assert found.parameters.quantities["d"] == pytest.approx(0.2, rel=1e-3)


def test_nothing_to_learn_is_refused(pendulum, quick):
    dataset = knowing(pendulum(), **EXACT, constants={"J": 1.0, "w": 1.0, "d": 0.1})
    with pytest.raises(ValueError, match="must have something to learn; every part is given"):
        fit(dataset, model=MODEL, config=quick)
    correctable = dataclasses.replace(dataset, known=dataclasses.replace(dataset.known, correct=("potential_energy",)))
    with pytest.raises(ValueError, match=r"corrections of these need `lm_steps` and `growth_steps`; got \d+ and 0"):
        fit(correctable, model=MODEL, config=dataclasses.replace(quick, growth_steps=0))


def test_known_parts_that_no_mechanism_has_are_refused_before_training(pendulum, quick):
    with pytest.raises(ValueError, match="`mass_matrix` must be positive definite"):
        fit(knowing(pendulum(), mass_matrix=[["cos(q1) - 1.1"]]), model=MODEL, config=quick)


def test_functions_cannot_be_kept_in_a_folder_which_is_said_before_training(pendulum, quick, tmp_path):
    dataset = knowing(pendulum(), potential_energy=lambda q: LOAD * (1 - jnp.cos(q[0])))
    said = []
    with pytest.raises(StorageError, match=r"which is code\. Give known parts as formulas.* leave `folder` out"):
        fit(dataset, model=MODEL, config=quick, folder=tmp_path / "run", progress=said.append)
    assert (said, list(tmp_path.iterdir())) == ([], [])
    short = dataclasses.replace(quick, adam_steps=9, growth_steps=0, relevance_steps=0)
    assert fit(dataset, model=MODEL, config=short).completed


def recording():
    ts = np.linspace(0.0, 2.0, 81)
    q, v = np.stack([np.sin(ts), 2 * np.cos(ts)], axis=1), np.stack([np.cos(ts), -2 * np.sin(ts)], axis=1)
    return Trajectory(name="a", ts=ts, q=q, rates=v, us=np.ones((81, 1)))


@pytest.mark.parametrize(
    ("name", "formulas", "factor"),
    [
        ("mass_matrix", [["3", "0"], ["0", "5"]], "momentum"),
        ("potential_energy", "3*q1 + 4*q2", "force"),
        ("dissipation_matrix", [["3", "0"], ["0", "4"]], "force"),
        ("input_matrix", [["2 + 0*q1"], ["0"]], "force"),
    ],
)
def test_scales_are_those_of_the_known_part(name, formulas, factor):
    space, trajectory = Space.parse("R2"), recording()
    known: Any = {name: formulas}
    doubled: Any = {name: f"2*({formulas})" if isinstance(formulas, str) else twice(formulas)}
    scales, other = (
        measure_scales([trajectory], space, momenta=False, known=KnownParts(**parts)) for parts in (known, doubled)
    )
    assert other.momentum == pytest.approx(2 * scales.momentum)
    if factor == "momentum":
        assert scales.momentum == pytest.approx(np.sqrt(np.mean((trajectory.rates * [3, 5]) ** 2, axis=0)))


@given(factor=st.floats(-12, 12).map(lambda power: 10.0**power))
@settings(max_examples=10, deadline=None)
@pytest.mark.parametrize(
    ("name", "formulas", "change"),
    [
        ("mass_matrix", [["5", "0"], ["0", "2 + c*o"]], [[0, 0], [0, 1]]),
        ("mass_matrix", [["5", "c*o"], ["c*o", "2"]], [[0, 1], [1, 0]]),
        ("potential_energy", "c*o*q1", [1, 0]),
        ("input_matrix", [["3"], ["c*o"]], [0, 1]),
        ("dissipation_matrix", [["c*o", "0"], ["0", "0"]], [[1, 0], [0, 0]]),
    ],
)
def test_a_parameter_that_starts_at_zero_has_the_unit_in_which_forces_are_typical(factor, name, formulas, change):
    parts: dict[str, Any] = {"mass_matrix": [["5", "0"], ["0", "2"]], name: formulas}
    known = KnownParts(**parts, constants={"c": factor}, parameters={"o": 0.0})
    scales = measure_scales([recording()], Space.parse("R2"), momenta=False, known=known)
    typical = scales.force
    if name == "mass_matrix":
        change = change @ scales.velocity / scales.time
    elif name == "dissipation_matrix":
        change = change @ scales.velocity
    size = np.linalg.norm(change / typical)
    assert scales.parameters == {"o": pytest.approx(1 / (factor * size), rel=1e-6)}


def test_what_inputs_hold_is_as_large_as_they_are_however_slow_the_motion():
    parts: dict[str, Any] = {"mass_matrix": [["5", "0"], ["0", "2"]], "input_matrix": [["300"], ["0"]]}
    known = KnownParts(**parts, potential_energy="o*q1", parameters={"o": 0.0})
    units = measure_scales([recording()], Space.parse("R2"), momenta=False, known=known).parameters
    assert units == {"o": pytest.approx(300.0)}


@pytest.mark.parametrize("formula", ["o**2*q1", "o*p*q1", "o + q1", "sqrt(o**2)*q1"])
def test_a_parameter_without_effect_at_first_order_has_unit_one(formula):
    parameters = {"o": 0.0, "w": 2.0} | ({"p": 0.0} if "p" in formula else {})
    known = KnownParts(potential_energy=f"{formula} + w*q2", parameters=parameters)
    units = measure_scales([recording()], Space.parse("R2"), momenta=False, known=known).parameters
    assert units == {name: 1.0 for name, start in parameters.items() if start == 0}


def twice(rows):
    return [[f"2*({formula})" for formula in row] for row in rows]


def test_momenta_in_the_data_have_the_last_word():
    space, trajectory = Space.parse("R2"), recording()
    plain, known = (
        measure_scales([trajectory], space, momenta=True, known=parts)
        for parts in (None, KnownParts(mass_matrix=[[3, 0], [0, 5]]))
    )
    assert np.array_equal(plain.momentum, known.momentum)


def test_the_input_matrix_is_given_once():
    with pytest.raises(ValueError, match="`input_matrix` must be given once"):
        Dataset(
            name="a",
            space="R2",
            train=(recording(),),
            input_matrix=np.ones((2, 1)),
            known=KnownParts(input_matrix=[[1], [1]]),
        )


def test_a_cyclic_coordinate_is_learned_to_be_one():
    """The inertia of a cart with a pole is found from eight seconds, and is the same forty metres away."""
    truth = CartPole()
    generator = np.random.default_rng(0)
    recordings = []
    for k in range(4):
        ts, us = 0.02 * np.arange(100), np.repeat(generator.normal(size=(10, 1)), 10, axis=0)
        start, rates = jnp.asarray(generator.normal(size=(2, 2)))
        path = rollout(truth, start, rates, jnp.asarray(ts), jnp.asarray(us), solver=RK4(4))
        q, rates = np.asarray(path.q), np.asarray(path.rates)
        recordings.append(Trajectory(name=str(k), ts=ts, q=q, rates=rates, us=us))
    parts = KnownParts(cyclic=("q1",))
    dataset = Dataset(name="cart", space="R1 T1", train=tuple(recordings), known=parts, input_matrix=np.eye(2)[:, :1])
    found: Any = fit(dataset, config=dataclasses.replace(STEPS, validation=0.25)).model
    here, there = (jnp.array([place, 0.7]) for place in (0.0, 40.0))
    for place in (here, there):
        assert np.asarray(found.mass_matrix(place)) == pytest.approx(np.asarray(truth.mass_matrix(here)), rel=0.02)
