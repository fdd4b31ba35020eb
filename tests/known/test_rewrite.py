"""What was found of a robot goes into the text of its file, and nothing else in it changes."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from symoden.known import Identified, Robot, read_urdf, rewrite_urdf

ARM = """<?xml version="1.0"?>
<!-- <link name="upper"> of a comment -->
<robot name="arm">
  <material name="grey > white"><color rgba="1 1 1 1"/></material>
  <link name="base"><inertial><mass value="5"/></inertial></link>
  <link name="upper">
    <visual><origin xyz="0 0 1"/><geometry><mesh filename='a"b.stl'/></geometry></visual>
    <inertial>
      <mass value="1.5"/> <origin rpy="0.1 0.2 0.3" xyz="0 0.1 -0.2"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.015" ixy="0.001" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="lower"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>{}</inertial></link>
  <link name="tool">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.25"/>{}</inertial>
  </link>
  <link name="frame"/>
  <link name="light"><inertial><mass value="0"/></inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/> <child link="upper"/> <axis xyz="0 2 0"/>
    <limit effort="3" velocity="2" lower="-1" upper="1"/>
    <dynamics damping="0.1" other="&lt;x&gt;" friction="0.2"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.4"/><axis xyz="0 0 -1"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/><child link="tool"/><origin xyz="0 0 -0.2" rpy="0.5 0.2 0.3"/>
  </joint>
  <joint name="marker" type="fixed"><parent link="tool"/><child link="frame"/></joint>
  <joint name="grip" type="continuous"><parent link="tool"/><child link="light"/></joint>
</robot>
"""
POINTS = ARM.replace("{}", "")
ARM = ARM.replace("{}", '<inertia ixx="0.004" iyy="0.003" izz="0.002" ixy="0" ixz="0.0001" iyz="0"/>')
JOINTS = ["slide", "shoulder"]
AT = {"grip": 0.4}
WRITTEN = re.compile(rb"<inertial>.*?</inertial>|<dynamics[^>]*>(</dynamics>)?", re.DOTALL)
COMMENT = re.compile(rb"\s*<!--\s*Found.*?-->", re.DOTALL)


def body(mass, centre, spread):
    """Pseudo-inertia of a body of any shape."""
    centre = np.array(centre)
    root = np.array(spread)
    J = np.block([[root @ root.T + np.outer(centre, centre), centre[:, None]], [centre, 1.0]])
    return tuple(map(tuple, (mass * J).tolist()))


UPPER = body(2.2, [0.03, -0.02, -0.25], [[0.1, 0, 0], [0.02, 0.08, 0], [-0.01, 0.03, 0.12]])
LOWER = body(0.4, [0.01, 0.02, -0.3], [[0.05, 0, 0], [-0.02, 0.06, 0], [0.01, 0.0, 0.07]])
FOUND = {
    "shoulder": Identified(inertia=UPPER, damping=0.75, friction=1.25),
    "slide": Identified(inertia=LOWER, damping=3.0),
}


@pytest.fixture
def arm(tmp_path):
    """Reads a text as a file."""

    def read(text=ARM, encoding="utf-8") -> Robot:
        path = tmp_path / "arm.urdf"
        path.write_bytes(text.encode(encoding))
        return read_urdf(path, joints=JOINTS, at=AT)

    return read


def read_back(written, tmp_path):
    path = tmp_path / "written.urdf"
    path.write_bytes(written)
    return read_urdf(path, joints=JOINTS, at=AT)


def masses(content):
    nodes = [(node.get("name"), node.find("inertial/mass")) for node in ET.fromstring(content).findall("link")]
    return {name: float(mass.get("value", "")) for name, mass in nodes if mass is not None}


@pytest.mark.parametrize(
    ("change", "encoding"),
    [
        (("", ""), "utf-8"),
        (("\n", "\r\n"), "utf-8"),
        (("\n", " "), "utf-8"),
        (("  ", "\t"), "utf-8"),
        (("", ""), "utf-8-sig"),
        (("shoulder", "épaule --"), "utf-8"),
        (('version="1.0"', 'version="1.0" encoding="latin-1"'), "latin-1"),
        (('friction="0.2"/>', 'friction="0.2"></dynamics>'), "utf-8"),
    ],
)
def test_bodies_and_friction_come_back_and_all_else_stays(arm, tmp_path, monkeypatch, change, encoding):
    text = ARM.replace(*change) if change[0] else ARM
    shoulder = "shoulder".replace(*change)
    monkeypatch.setitem(globals(), "JOINTS", ["slide", shoulder])
    robot = arm(text, encoding)
    found = {shoulder: FOUND["shoulder"], "slide": FOUND["slide"]}
    written = rewrite_urdf(robot, found, comment=[f"Found -- of {shoulder}---", ""])
    back = read_back(written, tmp_path)
    assert [each.joint for each in back.bodies] == [shoulder, "slide"]
    for each, inertia in zip(back.bodies, (UPPER, LOWER), strict=True):
        np.testing.assert_allclose(each.inertia, inertia, rtol=1e-9, atol=1e-11)
    joints = {node.get("name"): node.iter("dynamics") for node in ET.fromstring(written).findall("joint")}
    assert {name: dict(tag.attrib) for name, tags in joints.items() for tag in tags} == {
        shoulder: {"damping": "0.75", "friction": "1.25", "other": "<x>"},
        "slide": {"damping": "3", "friction": "0"},
    }
    assert len(COMMENT.findall(written)) == 1
    rests = [b"".join(WRITTEN.sub(b"", COMMENT.sub(b"", part)).split()) for part in (text.encode(encoding), written)]
    assert rests[0] == rests[1]
    assert (b"\r\n" in written) == ("\r\n" in text)


def test_links_of_one_body_share_what_was_found_of_it(arm):
    robot = arm()
    written = rewrite_urdf(robot, FOUND)
    before, after = masses(robot.file.read_bytes()), masses(written)
    assert after["lower"] + after["tool"] == pytest.approx(0.4)
    assert after["tool"] / after["lower"] == pytest.approx(before["tool"] / before["lower"])
    assert (after["base"], after["light"]) == (5, 0)
    assert set(after) == set(before)
    assert b"<!--\n" not in written
    assert b'    <inertial>\n      <origin xyz="' in written
    assert b'  <dynamics damping="3" friction="0"/>\n  </joint>' in written


def test_links_that_are_points_are_read_a_little_thicker_than_they_are_written(arm, tmp_path):
    for each, inertia in zip(read_back(rewrite_urdf(arm(POINTS), FOUND), tmp_path).bodies, (UPPER, LOWER), strict=True):
        np.testing.assert_allclose(each.inertia, inertia, atol=1e-4 * np.abs(inertia).max())


def test_what_is_not_found_stays(arm, tmp_path):
    robot = arm()
    assert rewrite_urdf(robot, {}) == robot.file.read_bytes()
    same = {each.joint: Identified(inertia=each.inertia) for each in robot.bodies}
    written = rewrite_urdf(robot, same)
    assert masses(written) == pytest.approx(masses(robot.file.read_bytes()))
    assert written.count(b"<dynamics") == 1
    for mine, theirs in zip(read_back(written, tmp_path).bodies, robot.bodies, strict=True):
        np.testing.assert_allclose(mine.inertia, theirs.inertia, rtol=1e-9, atol=1e-12)


def test_what_cannot_be_rewritten_is_refused(arm):
    robot = arm()
    with pytest.raises(ValueError, match="must come from a URDF file"):
        rewrite_urdf(Robot(bodies=robot.bodies), FOUND)
    wide = arm(ARM.replace('version="1.0"', 'version="1.0" encoding="utf-16"'), "utf-16")
    with pytest.raises(ValueError, match="Save it as plain XML in UTF-8"):
        rewrite_urdf(wide, FOUND)
    for text, message in (
        ("<robot", "must be an XML file"),
        (ARM.replace("<robot", '<!DOCTYPE r [<!ENTITY a "b">]><robot'), "without a DOCTYPE"),
        (ARM.replace('name="slide"', 'name="glide"'), "`slide`: none of that name"),
    ):
        robot.file.write_text(text)
        with pytest.raises(ValueError, match=message):
            rewrite_urdf(robot, FOUND)
    robot.file.unlink()
    with pytest.raises(FileNotFoundError):
        rewrite_urdf(robot, FOUND)
