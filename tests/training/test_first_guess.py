"""Where M and V are given, inputs, drives and friction begin with what a regression finds."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import FRICTION, kinds_in_use
from symoden.known import Body, KnownParts, Robot
from symoden.models import BlockConfig, build
from symoden.spaces import Space
from symoden.systems import LinkChain, Pendulum
from symoden.training._data import hold_out, regression_data
from symoden.training._first_guess import FirstGuess, as_heavy, begin_with, can_be_guessed, guess
from symoden.training._flatten import Flattening, cast
from symoden.training._line_up import line_up
from symoden.training._prepare import prepare
from symoden.training._relevance import Relevance

CHAIN = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.1)  # Of the recordings.
VISCOUS = np.array([0.3, 0.2, 5.0])
MIXED = np.array([[2.0, -0.5, 0.0], [0.0, -3.0, 0.0], [0.0, 0.4, 0.25]])


@pytest.fixture(scope="module")
def mixed(swings):
    """The chain's recordings under inputs of other signs and units, one of which acts on three joints."""
    dataset = swings()
    inverse = np.linalg.inv(MIXED)
    recordings = tuple(dataclasses.replace(each, us=each.us @ inverse.T) for each in dataset.train)
    return dataclasses.replace(dataset, train=recordings)


def known(weight, **others):
    return KnownParts(
        mass_matrix=lambda q: weight * CHAIN.mass_matrix(q),
        potential_energy=lambda q: weight * CHAIN.potential_energy(q),
        **others,
    )


def guessed(dataset, model, config) -> Any:
    with jax.enable_x64(True):
        windows = regression_data(dataset, model, config)
        assert windows is not None
        return guess(cast(model, jnp.float64), windows)


def built(dataset, model, **parts: Any) -> Any:
    space = Space.parse(dataset.space)
    return build(model, space, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(0), **parts)


@pytest.mark.parametrize("weight", [1.0, 0.3])
@pytest.mark.parametrize("damping", [None, 0.1])
def test_it_is_that_of_the_recordings_in_the_unit_of_the_weights(mixed, plain, quick, weight, damping):
    friction = {} if damping is None else {"dissipation_matrix": weight * damping * np.eye(3)}
    found = guessed(mixed, built(mixed, plain, known=known(weight, **friction)), quick)
    assert found.inputs == pytest.approx(weight * MIXED, abs=0.02 * weight * np.abs(MIXED).max())
    assert found.drives is None
    assert (found.viscous is None) == (damping is not None)
    if found.viscous is not None:
        assert found.viscous == pytest.approx(np.full(3, weight * 0.1), rel=0.1)


def test_training_begins_with_it_and_says_how_far_it_is(mixed, plain, quick):
    asks = dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True))
    steps: Any = []
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):
        described = dataclasses.replace(mixed, known=known(1.0))
        begun: Any = prepare(described, asks, quick, lambda *step: steps.append(step))[1].model
    taken, most, losses = zip(*steps, strict=True)
    assert taken == tuple(range(1, len(steps) + 1))
    assert set(most) == {most[0]}
    assert most[0] >= len(steps)
    assert losses[-1] <= losses[0]
    q = np.random.default_rng(0).normal(size=3)
    assert np.asarray(begun.input_matrix(q)) == pytest.approx(MIXED, abs=0.1)


@pytest.mark.parametrize("cyclic", [(), ("q1",)])
@pytest.mark.parametrize("knees", [(), (0.1,)])
def test_a_model_begins_with_what_was_found(mixed, plain, knees, cyclic):
    asks = dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True), knees=knees)
    found = FirstGuess(inputs=MIXED, viscous=VISCOUS)
    model = begin_with(built(mixed, asks, known=dataclasses.replace(known(1.0), cyclic=cyclic)), found)
    q, v = jnp.linspace(-1, 1, 3), jnp.ones(3)
    assert np.asarray(model.input_matrix(q)) == pytest.approx(MIXED, rel=1e-5)
    assert np.asarray(model.dissipation_matrix(q, v)) == pytest.approx(np.diag(VISCOUS), rel=1e-5, abs=1e-6)


def hinge(J, axis=(0, 1, 0)):
    """A robot of one joint, of which these are the moments."""
    pose, inertia = (tuple(map(tuple, np.asarray(matrix).tolist())) for matrix in (np.eye(4), J))
    body = Body(joint="hinge", coordinate=0, parent=-1, prismatic=False, axis=axis, origin=pose, inertia=inertia)
    return KnownParts(robot=Robot(bodies=(body,)))


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-2])
def test_a_joint_that_nothing_but_its_drive_holds_keeps_a_drive_that_can_be(driven, plain, quick, noise):
    """Of a turntable inputs, inertia and friction are known up to a factor alone, and noise must not make one up."""
    dataset = hold_out(driven(lambda q, v, u: (4 * u - v) / 0.5, [0.0], space="T1", noise=noise), quick)
    known = hinge(np.diag([0.05, 0.05, 0.01, 1.0]), axis=(0, 0, 1))
    found = guessed(dataset, model := built(dataset, plain, known=known), quick)
    first = float(np.asarray(model.parameters.links.rotors.array)[0])
    assert 0.005 * first < found.drives[0] < 100 * first
    inertia = 0.1 + found.drives[0]
    assert found.inputs[0, 0] / inertia == pytest.approx(8.0, rel=0.3 if noise == 1e-2 else 0.05)
    assert found.viscous[0] / inertia == pytest.approx(2.0, rel=0.5 if noise == 1e-2 else 0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_is_as_heavy_as_its_file_says_where_nothing_else_gives_a_unit(pendulum, plain, scrambled, seed):
    known, dataset = hinge([[0.3, 0, 0, 0], [0, 0.3, 0, 0], [0, 0, 0.5, -0.4], [0, 0, -0.4, 0.8]]), pendulum()
    begun = built(dataset, plain, known=known)
    learned = scrambled(begun, seed, 0.5)
    q = np.linspace(-3, 3, 40)[:, None]
    model: Any = as_heavy(learned, begun, q)
    states = [jnp.asarray(row) for row in ([0.3], [-0.7], [0.5])]

    def slope(model):
        slopes = [float(jax.grad(model.potential_energy)(jnp.asarray(each))[0]) for each in q]
        return float(np.sqrt(np.mean(np.square(slopes))))

    def acceleration(model, q, v, u):
        load = jax.grad(model.potential_energy)(q) + model.dissipation_matrix(q, v) @ v
        return float((model.inverse_mass_matrix(q) @ (model.input_matrix(q) @ u - load))[0])

    assert slope(model) == pytest.approx(slope(begun), rel=1e-4)
    assert slope(learned) != pytest.approx(slope(begun), rel=1e-2)
    assert acceleration(model, *states) == pytest.approx(acceleration(learned, *states), rel=1e-4)
    factor = slope(model) / slope(learned)
    weighs, before = (
        {name: float(value) for name, value in each.parameters.quantities.items()} for each in (model, learned)
    )
    assert weighs["hinge.m"] == pytest.approx(factor * before["hinge.m"], rel=1e-4)
    assert weighs["hinge.cz"] == pytest.approx(before["hinge.cz"], rel=1e-4)
    given = built(dataset, plain, known=known, input_matrix=np.eye(1))
    assert as_heavy(given, begun, q) is given


@pytest.mark.parametrize("gain", [-4.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_drives_are_what_bodies_leave_of_the_inertia(pendulum, plain, quick, gain):
    truth = Pendulum(damping=0.2)
    inertia = float(truth.mass_matrix(jnp.zeros(1))[0, 0])
    moment = float(truth.potential_energy(jnp.array([jnp.pi]))) / 2 / 9.81  # Mass times distance.
    J = np.diag([0.1 * inertia, 0.0, 0.5 * inertia, 100.0])
    J[2, 3] = J[3, 2] = -moment
    J[1, 1] = 1e-6
    dataset = pendulum(samples=60)
    dataset = dataclasses.replace(
        dataset, train=tuple(dataclasses.replace(each, us=each.us / gain) for each in dataset.train)
    )
    for g in (None, np.array([[gain]])):
        known = hinge(J)
        found = guessed(dataset, built(dataset, plain, known=known, input_matrix=g), quick)
        assert found.drives == pytest.approx([0.4 * inertia], rel=0.02)
        assert found.viscous == pytest.approx([0.2], rel=0.1)
        assert (found.inputs is None) == (g is not None)
        if found.inputs is not None:
            assert found.inputs == pytest.approx(np.array([[gain]]), rel=0.02)
        with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):
            described = dataclasses.replace(dataset, known=known, input_matrix=g)
            begun: Any = prepare(described, plain, quick)[1].model
        assert np.asarray(begun.mass_matrix(np.zeros(1))) == pytest.approx(inertia, rel=0.02)


@pytest.mark.parametrize("dry", [0.5, 0.0])
def test_dry_friction_is_there_from_the_start_where_validation_asks_for_it(driven, plain, quick, dry):
    def accelerate(q, v, u):
        return (2 * u - 0.3 * v - dry * v / np.sqrt(v**2 + 1e-4) - np.sin(q)) / 0.2

    dataset = hold_out(driven(accelerate, [0.0], space="T1", noise=1e-3), quick)
    known = KnownParts(mass_matrix=[["0.2"]], potential_energy="-cos(q1)")
    model = built(dataset, dataclasses.replace(plain, knees=(0.003, 0.03, 0.3)), known=known)
    found = guessed(dataset, model, quick)
    assert found.inputs == pytest.approx(np.array([[2.0]]), rel=0.05)
    assert found.viscous == pytest.approx([0.3], rel=0.1)
    begun = begin_with(model, found)
    if dry:
        assert found.dry == pytest.approx([dry], rel=0.1)
        q, fast = jnp.zeros(1), jnp.array([3.0])
        assert np.asarray(begun.dissipation_matrix(q, fast) @ fast) == pytest.approx([0.9 + dry], rel=0.1)
        assert kinds_in_use(begun) == FRICTION
        _, laws = Flattening.of(begun, corrections=FRICTION)
        pulled = Relevance.start(begun, 1.0).precisions(begun, FRICTION) * np.asarray(laws) ** 2
        assert pulled.max() < 10 < np.max(np.asarray(laws) ** 2)  # Else the first step undoes it.
    else:  # On exact data a billionth of it is a clear gain.
        assert found.dry is None or found.dry[0] < 1e-6


def test_what_nothing_tells_is_zero(mixed, plain, quick):
    silent = tuple(dataclasses.replace(each, us=np.concatenate([each.us, 0 * each.us], axis=1)) for each in mixed.train)
    dataset = dataclasses.replace(mixed, train=silent, input_names=())
    found = guessed(dataset, built(dataset, plain, known=known(1.0)), quick)
    assert np.abs(found.inputs[:, 3:]).max() < 1e-9
    assert found.inputs[:, :3] == pytest.approx(MIXED, abs=0.1)


def test_it_is_for_given_energies_and_what_is_not_given_beside_them(mixed, plain):
    network = dataclasses.replace(plain, scaled=False, actuation=BlockConfig(hidden=(3,)))
    energy = KnownParts(potential_energy=CHAIN.potential_energy)
    momenta = dataclasses.replace(mixed, momenta=True)
    assert can_be_guessed(built(mixed, plain, known=known(1.0)))
    for dataset, model, parts in (
        (mixed, plain, None),
        (mixed, plain, energy),
        (mixed, plain, known(1.0, input_matrix=MIXED)),
        (momenta, plain, known(1.0)),
        (mixed, network, known(1.0)),
    ):
        assert not can_be_guessed(built(dataset, model, known=parts))


def test_inputs_that_turn_are_not_asked_for_anew_where_nothing_was_bent_around_them(mixed, plain, quick):
    model = dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True), knees=(0.1,))
    held = hold_out(mixed, quick)
    for parts, wanted in ((None, True), (known(1.0), False)):
        names = [stage.name for stage in line_up(held, built(held, model, known=parts), (), quick)]
        assert {"regression: actuation", "regression: directions", "friction"} <= set(names)
        assert ("regression: actuation anew" in names) == wanted
        for linear in ("actuation", "directions"):  # The regression has answered; rollouts are slow to ask.
            assert (linear in names) == wanted
