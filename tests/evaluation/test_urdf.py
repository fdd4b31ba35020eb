"""A learned robot as a URDF file: the model's inertia and gravity, and its friction where two numbers tell it."""

import dataclasses
from typing import Any

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

import symoden
from symoden.blocks import Links
from symoden.evaluation import Ranges
from symoden.evaluation._inspect import identified_parameters
from symoden.known import KnownParts, read_urdf
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space

SMALL = ModelConfig(friction=BlockConfig(constant=True), knees=())
SPACE = Space.parse("R1 T3")
JOINTS = ["slide", "elbow", "shoulder", "wrist"]
AT = {"finger": 0.3, "thumb": -0.2}
RANGES = Ranges(positions=((-0.5, 0.5), *[(-3.0, 3.0)] * 3), rates=((-1.0, 2.0),) * 4, inputs=())
TREE = (  # Joint, its kind, its parent and its child.
    ("mount", "fixed", "world", "base"),
    ("shoulder", "revolute", "base", "upper"),
    ("cover", "fixed", "upper", "shell"),
    ("slide", "prismatic", "upper", "lower"),
    ("elbow", "continuous", "upper", "other"),
    ("wrist", "revolute", "lower", "hand"),
    ("finger", "revolute", "hand", "first"),
    ("thumb", "continuous", "hand", "second"),
)


def random_urdf(seed):
    """A tree with branches, links that are fixed to others, and fingers that stand still."""
    generator = np.random.default_rng(seed)

    def numbers(values):
        return " ".join(f"{value:.17g}" for value in values)

    def origin(size):
        return f'<origin xyz="{numbers(size * generator.normal(size=3))}" rpy="{numbers(generator.normal(size=3))}"/>'

    text = ['<robot name="random">\n  <link name="world"/>']
    for _, _, _, child in TREE:
        turn = Rotation.from_rotvec(generator.normal(size=3)).as_matrix()
        inertia = turn @ np.diag(generator.uniform(0.02, 0.03, 3)) @ turn.T  # Such as a body can have.
        entries = zip(("xx", "xy", "xz", "yy", "yz", "zz"), inertia[np.triu_indices(3)], strict=True)
        moments = " ".join(f'i{axes}="{value:.17g}"' for axes, value in entries)
        weight = f'{origin(0.1)}<mass value="{generator.uniform(0.5, 2):.17g}"/><inertia {moments}/>'
        text.append(f'  <link name="{child}">\n    <inertial>{weight}</inertial>\n  </link>')
    for name, kind, parent, child in TREE:
        axis = f'<axis xyz="{numbers(generator.normal(size=3))}"/>'
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        text.append(f'  <joint name="{name}" type="{kind}">{ends}{origin(0.3)}{axis}</joint>')
    return "\n".join([*text, "</robot>\n"])


def model_of(robot, *, seed=0, **known) -> Any:
    """A model of a robot, with other numbers than it was given."""
    made: Any = build(
        SMALL, SPACE, 4, input_matrix=np.eye(4), known=KnownParts(robot=robot, **known), key=jax.random.key(0)
    )
    theta = 0.3 * jax.random.normal(jax.random.key(seed), (4, 11), float)
    return eqx.tree_at(lambda model: model.parameters.links.theta, made, theta)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("robots")


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(random_urdf(0))
    return read_urdf(path, joints=JOINTS, at=AT)


@eqx.filter_jit
def energies(links, q):
    """M without drives, and V."""
    bare = eqx.tree_at(lambda links: links.rotors.array, links, jnp.zeros_like(links.rotors.array))
    return jax.vmap(bare.mass_matrix)(q), jax.vmap(links.potential_energy)(q)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_the_file_has_the_inertia_and_the_gravity_of_the_model(folder, seed):
    path, gravity = folder / "arm.urdf", (0.3, -0.2, -9.7)
    path.write_text(random_urdf(seed))
    robot = read_urdf(path, joints=JOINTS, at=AT, gravity=gravity)
    model = model_of(robot, seed=seed)
    joints = symoden.write_urdf(folder / "found.urdf", model, robot)
    found = Links.of(read_urdf(folder / "found.urdf", joints=JOINTS, at=AT, gravity=gravity))
    q = jax.random.normal(jax.random.key(seed), (5, 4), float)
    (mass, energy), (M, V) = energies(found, q), energies(model.parameters.links, q)
    np.testing.assert_allclose(mass, M, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(energy - energy[0], V - V[0], rtol=1e-7, atol=1e-7)
    # And these are the model's own, but for the drives that it names.
    drives = {joint.joint: joint.drive for joint in joints}
    total = np.asarray(jax.vmap(model.mass_matrix)(q)) - np.diag([drives[name] for name in JOINTS])
    np.testing.assert_allclose(mass, total, rtol=1e-7, atol=1e-8)
    assert all(joint.damping is joint.friction is joint.missed is None for joint in joints)
    text = (folder / "found.urdf").read_text()
    assert "<dynamics" not in text
    assert f"elbow: {drives['elbow']:.6g} kg m^2\n" in text
    assert f"slide: {drives['slide']:.6g} kg\n" in text


def test_numbers_that_the_data_do_not_tell_are_listed(robot, tmp_path):
    model, out = model_of(robot), tmp_path / "found.urdf"
    found = identified_parameters(model)
    told, untold = "elbow.m", "slide.cx"
    symoden.write_urdf(out, model, robot, bands={told: 0.1 * abs(found[told]), untold: 12 * abs(found[untold])})
    text = out.read_text()
    assert "Of these numbers the data hardly tell even the size" in text
    assert f"  {untold}: {found[untold]:.4g} +- {12 * abs(found[untold]):.2g}\n" in text
    assert f"  {told}: " not in text
    read_urdf(out, joints=JOINTS, at=AT)
    symoden.write_urdf(out, model, robot, bands={told: 0.1 * abs(found[told])})
    assert "hardly tell" not in out.read_text()


def test_friction_is_written_where_two_numbers_tell_it(robot, tmp_path):
    dry = [f"0.3 + 0.5/sqrt(v{i}**2 + 1e-6)" for i in (1, 2, 3, 4)]
    dry[1] = "3*sqrt(v2**2 + 1e-6)"  # Drag.
    dry[2] = "(2 + 2*cos(q3))"  # Friction of its own at every angle.
    rows = [[dry[i] if i == k else 0.0 for k in range(4)] for i in range(4)]
    model = model_of(robot, dissipation_matrix=rows)
    still = dataclasses.replace(RANGES, rates=(*RANGES.rates[:3], (0.0, 0.0)))
    joints = symoden.write_urdf(tmp_path / "found.urdf", model, robot, ranges=still)
    found: dict[str, Any] = {joint.joint: joint for joint in joints}
    slide = found["slide"]
    assert (slide.damping, slide.friction) == pytest.approx((0.3, 0.5), rel=1e-2)
    assert slide.missed < 0.01
    for name in ("elbow", "shoulder"):
        assert found[name].missed > 0.2
        assert (found[name].damping, found[name].friction) == (None, None)
    assert found["wrist"].missed is None
    text = (tmp_path / "found.urdf").read_text()
    assert text.count("<dynamics") == 1
    assert f'<dynamics damping="{slide.damping:.12g}" friction="{slide.friction:.12g}"/></joint>' in text
    assert "wrist: all, because the joint did not move: its friction is not written" in text
    assert f"elbow: {found['elbow'].missed:.1%} of it: its friction is not written" in text


def test_velocities_of_momentum_data_are_those_of_the_model(robot, tmp_path):
    rows = [["1.5" if i == k else 0.0 for k in range(4)] for i in range(4)]
    model = dataclasses.replace(model_of(robot, dissipation_matrix=rows), momenta=True)
    for joint in symoden.write_urdf(tmp_path / "found.urdf", model, robot, ranges=RANGES):
        assert joint.damping == pytest.approx(1.5)
        assert joint.friction == 0


def test_the_file_says_what_it_lacks(robot, tmp_path):
    known: Any = KnownParts(robot=robot, correct=("potential_energy",))
    free = build(SMALL, SPACE, 4, known=known, key=jax.random.key(0))
    symoden.write_urdf(tmp_path / "found.urdf", free, robot)
    text = (tmp_path / "found.urdf").read_text()
    assert "Without what the model adds to rigid bodies: potential_energy." in text
    assert "Nothing fixed the unit of forces" in text
    symoden.write_urdf(tmp_path / "found.urdf", model_of(robot), robot)
    assert "Nothing fixed" not in (tmp_path / "found.urdf").read_text()


def test_only_the_robot_of_the_model_is_written_and_not_over_its_own_file(robot, tmp_path):
    model, out = model_of(robot), tmp_path / "found.urdf"
    with pytest.raises(ValueError, match="a model that was given a robot"):
        symoden.write_urdf(out, symoden.Pendulum(), robot)
    with pytest.raises(ValueError, match="must come from a URDF file"):
        symoden.write_urdf(out, model, dataclasses.replace(robot, file=None))
    before = robot.file.read_text()
    for other in (
        read_urdf(robot.file, joints=JOINTS[::-1], at=AT),
        dataclasses.replace(robot, bodies=robot.bodies[:3]),
        dataclasses.replace(robot, bodies=(dataclasses.replace(robot.bodies[0], axis=(1, 0, 0)), *robot.bodies[1:])),
    ):
        with pytest.raises(ValueError, match="must be the robot that the model was given"):
            symoden.write_urdf(out, model, other)
    with pytest.raises(ValueError, match="must not be the file"):
        symoden.write_urdf(robot.file, model, robot)
    assert robot.file.read_text() == before
    robot.file.write_text("<robot")
    with pytest.raises(ValueError, match=r"arm\.urdf`: a URDF must be an XML file"):
        symoden.write_urdf(out, model, robot)
    robot.file.unlink()
    with pytest.raises(ValueError, match=r"arm\.urdf` cannot be read: No such file"):
        symoden.write_urdf(out, model, robot)
    assert not out.exists()
