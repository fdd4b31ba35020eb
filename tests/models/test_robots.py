"""Models of rigid bodies on joints: M and V are those of the bodies whatever these weigh."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import Links, count_parameters
from symoden.evaluation._inspect import identified_parameters
from symoden.known import Body, KnownParts, Robot
from symoden.models import BlockConfig, ModelConfig, build, given_parts, load, parts_that_fix_the_scale, rescale, save
from symoden.spaces import Space
from symoden.systems import Acrobot
from symoden.testing import check_mass_matrix, check_periodicity, check_power_balance

SMALL = ModelConfig(friction=BlockConfig(constant=True), knees=())


def random_robot(seed, *, branched=True):
    """Bodies of any shape on joints in any direction."""
    generator = np.random.default_rng(seed)
    bodies = []
    for k in range(4):
        points = generator.normal(size=(10, 4)) * [0.1, 0.2, 0.05, 0]
        points += [*generator.normal(size=3) * 0.1, 1]
        frame = np.eye(4)
        frame[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0]
        frame[:3, :3] *= np.linalg.det(frame[:3, :3])
        frame[:3, 3] = 0.3 * generator.normal(size=3)
        axis = generator.normal(size=3)
        bodies.append(
            Body(
                joint=f"j{k}",
                coordinate=[2, 0, 3, 1][k],
                parent=(-1, 0, 0 if branched else 1, 2)[k],
                prismatic=k == 1,
                axis=tuple((axis / np.linalg.norm(axis)).tolist()),
                origin=tuple(map(tuple, frame.tolist())),
                inertia=tuple(map(tuple, (0.1 * points.T @ points).tolist())),
            )
        )
    return Robot(bodies=tuple(bodies), gravity=(0.3, -0.2, -9.7))


def scrambled(links, seed=0):
    """The same bodies with other numbers."""
    theta = 0.5 * jax.random.normal(jax.random.key(seed), links.theta.shape)
    return eqx.tree_at(lambda links: links.theta, links, theta)


def pose(robot, k, q):
    """Pose of a body, joint after joint."""
    body = robot.bodies[k]
    before = jnp.eye(4) if body.parent < 0 else pose(robot, body.parent, q)
    axis, x = jnp.asarray(body.axis), q[body.coordinate]
    motion = jnp.eye(4)
    if body.prismatic:
        motion = motion.at[:3, 3].set(x * axis)
    else:
        turned = jax.vmap(
            lambda e: jnp.cos(x) * e + jnp.sin(x) * jnp.cross(axis, e) + (1 - jnp.cos(x)) * axis * (axis @ e)
        )(jnp.eye(3))
        motion = motion.at[:3, :3].set(turned.T)
    return before @ jnp.asarray(body.origin) @ motion


@pytest.mark.parametrize("branched", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_energy_is_that_of_the_points_of_the_bodies(seed, branched):
    robot = random_robot(seed, branched=branched)
    with jax.enable_x64(True):
        links = scrambled(Links.of(robot), seed)
        q, v = jax.random.normal(jax.random.key(seed), (2, 4), float)

        def energies(q, v):
            kinetic = potential = 0.0
            for k, root in enumerate(links._roots()):
                T, velocity = jax.jvp(lambda q, k=k: pose(robot, k, q), (q,), (v,))
                kinetic += 0.5 * jnp.sum((velocity @ root) ** 2)
                potential -= jnp.asarray(robot.gravity) @ (T @ root @ root.T)[:3, 3]
            drives = links.rotors.value * jnp.exp(links.theta[:, -1])
            return kinetic + 0.5 * jnp.sum(drives * v[np.array(links.coordinates)] ** 2), potential

        kinetic, potential = energies(q, v)
        assert float(0.5 * v @ links.mass_matrix(q) @ v) == pytest.approx(float(kinetic), rel=1e-10)
        assert float(links.potential_energy(q)) == pytest.approx(float(potential), rel=1e-10)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_whatever_is_learned_bodies_are_such_as_can_be(seed):
    links = scrambled(Links.of(random_robot(seed)), seed)
    found = {name: float(value) for name, value in links.quantities.items()}
    for joint in links.joints:
        xx, yy, zz, xy, xz, yz = (found[f"{joint}.I{axes}"] for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert found[f"{joint}.m"] > 0
        assert moments[0] > 0
        assert moments[2] < (moments[0] + moments[1]) * (1 + 1e-5)  # The triangle's inequality.
        assert found[f"{joint}.rotor"] > 0


def test_a_planar_arm_is_the_acrobot():
    acrobot = Acrobot(masses=(1.0, 0.8), centres=(0.4, 0.3), inertias=(0.1, 0.07), dampings=(0.0, 0.0))

    def body(k, parent, at, mass, centre, inertia):
        second = inertia / 2 * np.eye(3)  # About every axis the same.
        place = np.array([0, 0, -centre])
        J = np.block([[second + mass * np.outer(place, place), mass * place[:, None]], [mass * place, mass]])
        frame = np.eye(4)
        frame[2, 3] = at
        matrices = (tuple(map(tuple, each.tolist())) for each in (frame, J))
        origin, pseudo = matrices
        return Body(
            joint=f"j{k}", coordinate=k, parent=parent, prismatic=False, axis=(0, 1, 0), origin=origin, inertia=pseudo
        )

    robot = Robot(
        bodies=(body(0, -1, 0.0, 1.0, 0.4, 0.1), body(1, 0, -acrobot.lengths[0], 0.8, 0.3, 0.07)),
        gravity=(0, 0, -float(acrobot.gravity)),
    )
    links = Links.of(robot)
    links = eqx.tree_at(lambda links: links.rotors.array, links, jnp.zeros(2))
    for q in jax.random.normal(jax.random.key(0), (5, 2)):
        assert np.asarray(links.mass_matrix(q)) == pytest.approx(np.asarray(acrobot.mass_matrix(q)), rel=1e-4)
        slopes = [jax.grad(each)(q) for each in (links.potential_energy, acrobot.potential_energy)]
        assert np.asarray(slopes[0]) == pytest.approx(np.asarray(slopes[1]), rel=1e-4, abs=1e-4)


@pytest.fixture
def model():
    space = Space.parse("R1 T3")
    robot = random_robot(0)
    order = {2: 1, 0: 0, 3: 2, 1: 3}  # The one that slides is the second body, and its coordinate the first.
    bodies = tuple(dataclasses.replace(body, coordinate=order[body.coordinate]) for body in robot.bodies)
    known = KnownParts(robot=dataclasses.replace(robot, bodies=bodies))
    model: Any = build(SMALL, space, 4, input_matrix=np.eye(4), known=known, key=jax.random.key(0))
    return eqx.tree_at(lambda model: model.parameters.links, model, scrambled(model.parameters.links))


def test_a_model_of_bodies_keeps_the_laws(model):
    check_mass_matrix(model)
    check_power_balance(model)
    check_periodicity(model)


def test_a_model_of_bodies_says_what_was_given_and_what_was_found(model):
    assert given_parts(model) == {
        "mass_matrix": "given up to parameters",
        "potential_energy": "given up to parameters",
        "input_matrix": "given",
    }
    assert parts_that_fix_the_scale(model) == ("input_matrix",)
    found = identified_parameters(model)
    assert len(found) == 44
    assert found["j0.m"] == pytest.approx(float(model.parameters.links.quantities["j0.m"]))
    assert count_parameters(model) == 44 + 10  # And friction.


def test_a_model_of_bodies_comes_back_from_its_file(model, tmp_path):
    save(tmp_path / "model.safetensors", model)
    assert eqx.tree_equal(model, load(tmp_path / "model.safetensors"))


def test_predictions_of_a_model_of_bodies_do_not_depend_on_the_scale(model):
    other, q = rescale(model, 3.0), jnp.array([0.1, 0.2, -0.5, 1.0])
    assert np.asarray(other.mass_matrix(q)) == pytest.approx(np.asarray(model.mass_matrix(q)) / 3, rel=1e-5)
    rates = [each.derivative(jnp.zeros(()), each.encode(q, jnp.ones(4)), jnp.ones(4)) for each in (model, other)]
    assert np.asarray(rates[0][:4]) == pytest.approx(np.asarray(rates[1][:4]), rel=1e-4)
    assert np.asarray(rates[0][4:]) == pytest.approx(3 * np.asarray(rates[1][4:]), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize(
    ("space", "message"), [("T3", "one joint for each of the 3 coordinates; got 4"), ("T4", "Joint `j1` slides")]
)
def test_joints_must_be_the_coordinates(space, message):
    space = Space.parse(space)
    with pytest.raises(ValueError, match=message):
        build(SMALL, space, 0, known=KnownParts(robot=random_robot(0)), key=jax.random.key(0))
