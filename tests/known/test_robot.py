"""Robots from URDF files: what is read, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest

from symoden.known import KnownParts, read_urdf

TWO = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"><inertial><mass value="5"/></inertial></link>
  <link name="upper">
    <inertial>
      <origin xyz="0 0 -0.2" rpy="0 0 0"/><mass value="1.5"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="lower"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0 0 0.05"/><mass value="0.25"/></inertial></link>
  <link name="finger"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 2 0"/></joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.4"/><axis xyz="0 0 -1"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/><child link="tool"/><origin xyz="0 0 -0.2" rpy="3.141592653589793 0 0"/>
  </joint>
  <joint name="grip" type="continuous"><parent link="tool"/><child link="finger"/></joint>
</robot>
"""


@pytest.fixture
def urdf(tmp_path):
    def write(text=TWO):
        path = tmp_path / "arm.urdf"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_joints_are_read_from_the_base_outwards(urdf):
    robot = read_urdf(urdf())
    assert [body.joint for body in robot.bodies] == ["shoulder", "slide", "grip"]
    assert [body.parent for body in robot.bodies] == [-1, 0, 1]
    assert [body.prismatic for body in robot.bodies] == [False, True, False]
    assert robot.bodies[0].axis == (0.0, 1.0, 0.0)
    assert robot.gravity == (0.0, 0.0, -9.81)


def test_what_hangs_on_a_body_by_joints_that_stay_belongs_to_it(urdf):
    robot = read_urdf(urdf(), joints=["slide", "shoulder"], gravity=[0, 0, -1.62])
    assert [(body.joint, body.coordinate) for body in robot.bodies] == [("shoulder", 1), ("slide", 0)]
    upper, lower = (np.array(body.inertia) for body in robot.bodies)
    assert upper[3] == pytest.approx([0, 0, -0.3, 1.5])
    # Half a kilogram at -0.1, and a quarter on the tool that is turned round: 0.2 below and 0.05 more.
    assert lower[3] == pytest.approx([0, 0, -0.05 - 0.25 * 0.25, 0.75])
    assert robot.gravity == (0.0, 0.0, -1.62)


def test_moments_of_inertia_about_a_centre_and_pseudo_inertias_say_the_same(urdf):
    J = np.array(read_urdf(urdf()).bodies[0].inertia)
    second = J[:3, :3] - np.outer(J[3, :3], J[3, :3]) / J[3, 3]
    inertia = np.trace(second) * np.eye(3) - second
    assert inertia == pytest.approx(np.diag([0.02, 0.02, 0.001]), rel=0.05, abs=1e-9)


@pytest.mark.parametrize("inertia", ["0 0 0", "1 1 1e-9", "-1 -1 -1", "1 0.1 0.1"])
def test_every_body_with_a_mass_is_one_that_can_be(urdf, inertia):
    x, y, z = inertia.split()
    robot = read_urdf(urdf(TWO.replace('ixx="0.02" iyy="0.02" izz="0.001"', f'ixx="{x}" iyy="{y}" izz="{z}"')))
    assert np.linalg.eigvalsh(np.array(robot.bodies[0].inertia)).min() > 0


REFUSED = [
    (("<robot", "<model"), "must be an XML file"),
    ((TWO, "<mujoco/>"), "must begin with <robot>; got <mujoco>"),
    (('<?xml version="1.0"?>', '<!DOCTYPE r [<!ENTITY a "b">]>'), "without a DOCTYPE"),
    (('value="1.5"', 'value="heavy"'), "link `upper`: its mass must be 1 finite number; got 'heavy'"),
    (('value="1.5"', 'value="-1"'), "link `upper`: its mass must not be below zero"),
    (('value="1.5"', 'value="nan"'), "link `upper`: its mass must be 1 finite number"),
    (('xyz="0 0 -0.4"', 'xyz="0 0"'), "joint `slide`: its origin must be 3 finite numbers; got '0 0'"),
    (('xyz="0 2 0"', 'xyz="0 0 0"'), "joint `shoulder`: its axis must have a length"),
    (
        ('type="prismatic"', 'type="planar"'),
        "`slide` must be fixed, revolute or continuous or prismatic; got planar",
    ),
    (('child link="lower"', 'child link="arm"'), "there is no `arm`"),
    (('child link="lower"', 'child link="upper"'), "the link `upper` has 2"),
    (('name="slide"', 'name="shoulder"'), "the joint `shoulder` has 2"),
    (('parent link="base"', 'parent link="tool"'), "go round in a circle"),
    (('name="slide"', ""), "every joint must have a name"),
    (('<axis xyz="0 2 0"/>', '<mimic joint="slide"/>'), "joint `shoulder` must move by itself; it mimics `slide`"),
    (('<child link="finger"/>', '<child link="finger"/><mimic joint="slide"/>'), "joint `grip` must move by itself"),
]


@pytest.mark.parametrize(("change", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_what_is_no_robot_is_refused(urdf, change, message):
    with pytest.raises(ValueError, match=message):
        read_urdf(urdf(TWO.replace(*change)))


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (["elbow"], "`elbow`: none of that name"),
        (["flange"], "`flange`: fixed"),
        (["slide", "slide"], "`slide`: twice"),
        ([], "must have a joint that moves"),
        (["grip"], "must have a mass; none has"),
    ],
)
def test_coordinates_must_be_joints_that_move(urdf, joints, message):
    with pytest.raises(ValueError, match=message):
        read_urdf(urdf(), joints=joints)


def test_fingers_that_mimic_each_other_stay_at_zero_where_neither_is_a_coordinate(urdf):
    thumb = (
        '<joint name="thumb" type="continuous"><parent link="tool"/><child link="tip"/><mimic joint="grip"/></joint>'
    )
    path = urdf(TWO.replace("</robot>", f'<link name="tip"/>{thumb}</robot>'))
    assert [body.joint for body in read_urdf(path, joints=["shoulder", "slide"]).bodies] == ["shoulder", "slide"]
    for joints in (None, ["shoulder", "grip"], ["thumb"]):
        with pytest.raises(
            ValueError, match=r"joint `thumb` must move by itself; it mimics `grip`\. .* leave both out"
        ):
            read_urdf(path, joints=joints)


def test_joints_that_stand_still_may_stand_anywhere(urdf):
    (lower,) = read_urdf(urdf(), joints=["slide"], at={"shoulder": -math.pi / 2}).bodies
    origin = np.array(lower.origin)  # The upper link hangs along -z; turned by a quarter about y, it lies along x.
    assert origin[:3, 3] == pytest.approx([0.4, 0, 0])
    assert origin[:3, :3] @ lower.axis == pytest.approx([1, 0, 0])
    (upper,) = read_urdf(urdf(), joints=["shoulder"], at={"slide": 0.3, "grip": 1}).bodies
    masses, heights = (1.5, 0.5, 0.25), (-0.2, -0.8, -0.95)
    assert np.array(upper.inertia)[2, 3] == pytest.approx(np.dot(masses, heights))


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"slide": 0.1}, "that are not in `joints`, .*: `grip`; got `slide` at 0.1"),
        ({"flange": 1}, "got `flange` at 1"),
        ({"wrist": 1}, "got `wrist` at 1"),
        ({"grip": math.nan}, r"by numbers below 1e\+06 .* got `grip` at nan"),
        ({"grip": 10**400}, "got `grip` at 10000"),
    ],
)
def test_only_joints_that_do_not_move_are_held(urdf, at, message):
    with pytest.raises(ValueError, match=message):
        read_urdf(urdf(), joints=["shoulder", "slide"], at=at)


@pytest.mark.parametrize("gravity", [[0, -9.81], [0, 0, math.inf]])
def test_gravity_must_be_three_numbers(urdf, gravity):
    with pytest.raises(ValueError, match="`gravity` must be 3 finite numbers"):
        read_urdf(urdf(), gravity=gravity)


def test_a_long_chain_is_read_as_well(urdf):
    links = "".join(f'<link name="l{k}"><inertial><mass value="1"/></inertial></link>' for k in range(3000))
    kinds = ["fixed"] * 2998 + ["continuous"]
    ends = '<parent link="l{0}"/><child link="l{1}"/>'
    joints = "".join(f'<joint name="j{k}" type="{kinds[k]}">{ends.format(k, k + 1)}</joint>' for k in range(2999))
    (body,) = read_urdf(urdf(f'<robot name="chain">{joints}{links}</robot>')).bodies
    assert body.joint == "j2998"


def test_a_robot_gives_inertia_and_energy_once(urdf):
    robot = read_urdf(urdf())
    assert KnownParts(robot=robot).given == ("mass_matrix", "potential_energy")
    assert KnownParts(robot=robot, input_matrix=[[1], [0], [0]], correct=("mass_matrix",)).correct == ("mass_matrix",)
    twice: tuple[dict[str, Any], ...] = ({"mass_matrix": [[1]]}, {"potential_energy": "0"})
    for part in twice:
        with pytest.raises(ValueError, match="must be given once; a robot gives it too"):
            KnownParts(robot=robot, **part)
