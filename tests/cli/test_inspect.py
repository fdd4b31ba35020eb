"""`inspect --urdf` writes the robot that a run identified."""

import json
from typing import Any

import numpy as np
import pytest

from symoden.cli import main
from symoden.experiments import read_model
from symoden.known import read_urdf

from .conftest import write_description, write_untrained_run

ROD = """<robot name="rod">
  <link name="wall"/>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="0.2" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="hinge" type="continuous"><parent link="wall"/><child link="rod"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture
def described(tmp_path):
    path = write_description(tmp_path)
    (tmp_path / "rod.urdf").write_text(ROD)
    path.write_text(f'{path.read_text()}[known]\nrobot = "rod.urdf"\n')
    return path


@pytest.fixture
def run(described, tmp_path):
    return write_untrained_run(tmp_path / "run", described)


def test_inspect_writes_the_robot(run, tmp_path, capsys):
    out = tmp_path / "found.urdf"
    assert main(["inspect", str(run), "--urdf", str(out), "--json"]) == 0
    urdf = json.loads(capsys.readouterr().out.splitlines()[-1])["urdf"]
    assert urdf["out"] == str(out)
    (joint,) = urdf["joints"]
    model: Any = read_model(run)
    assert joint["drive"] == pytest.approx(float(model.parameters.links.drives[0]))
    (body,), (given,) = read_urdf(out).bodies, read_urdf(tmp_path / "rod.urdf").bodies
    np.testing.assert_allclose(body.inertia, given.inertia, rtol=1e-6, atol=1e-9)  # Nothing was learned.
    assert joint["damping"] == pytest.approx(float(model.dissipation_matrix(np.zeros(1), np.ones(1))[0, 0]), rel=1e-6)
    assert f'<dynamics damping="{joint["damping"]:.12g}" friction="0"/></joint>' in out.read_text()
    assert (tmp_path / "rod.urdf").read_text() == ROD
    assert main(["inspect", str(run), "--urdf", str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"the identified robot is in {out}" in printed
    assert "drives have no place in a URDF" in printed
    assert "hardly tell even the size" in out.read_text()  # Nothing was learned.


def test_what_cannot_be_written_is_refused_before_anything_takes_time(run, arm_run, described, tmp_path, capsys):
    def said(run, out="found.urdf"):
        assert main(["inspect", str(run), "--urdf", str(tmp_path / out)]) == 2
        assert not (tmp_path / "found.urdf").exists()
        return " ".join(capsys.readouterr().err.split())

    assert "needs a run that was given a robot; this one was not" in said(arm_run)
    assert "must end in .urdf" in said(run, "found.xml")
    assert "must not be the file that the robot was read from" in said(run, "rod.urdf")
    (tmp_path / "rod.urdf").write_text(ROD.replace('xyz="0 1 0"', 'xyz="1 0 0"'))
    assert "must be the robot that the model was given" in said(run)
    (tmp_path / "rod.urdf").unlink()
    assert "rod.urdf` cannot be read" in said(run)
    described.unlink()
    assert "the robot's file, which the run's data name; they cannot be read" in said(run)
