"""The table [known] of a description."""

from pathlib import Path

import pytest

from symoden.data import DataError, read_dataset
from symoden.data.description._description import read_description

LEAST = 'space = "T1"\ntime = "t"\npositions = ["q"]\n[train]\nfiles = ["a.csv"]\n'
KNOWN = """
[known]
mass_matrix = [["m*l**2"]]
potential_energy = "-m*g*l*cos(q1)"
dissipation_matrix = [[0.1]]
correct = ["potential_energy"]
[known.constants]
g = 9.81
l = 0.5
[known.parameters]
m = 2
"""
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def described(tmp_path, text):
    path = tmp_path / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_known_arrives_in_the_data_set(tmp_path):
    (tmp_path / "a.csv").write_text("t,q\n" + "".join(f"{0.1 * k},{0.01 * k * k}\n" for k in range(20)))
    known = read_dataset(described(tmp_path, LEAST + KNOWN)).known
    assert known is not None
    assert known.given == ("mass_matrix", "potential_energy", "dissipation_matrix")
    assert known.formulas("potential_energy") == ("-m*g*l*cos(q1)",)
    assert (known.constants, known.parameters, known.correct) == (
        {"g": 9.81, "l": 0.5},
        {"m": 2},
        ("potential_energy",),
    )


def test_nothing_is_known_unless_it_is_said(tmp_path):
    assert read_description(described(tmp_path, LEAST)).known is None


BAD = [
    (("mass_matrix =", "mass ="), r"\[known\] has no key `mass`.*The keys are `mass_matrix, potential_energy"),
    (("l**2", "k**2"), r"\[known\] `mass_matrix`: every name must be .* got `k`"),
    (("l**2", "l^2"), r"\[known\] `mass_matrix`: A formula may contain .* A power is written"),
    (
        ('[["m*l**2"]]\npotential_energy = "-m*g*l*cos(q1)"', "[[1, 0]]\npotential_energy = 0"),
        r"\[known\] `mass_matrix` must be 1 × 1; got 1 × 2\. Give one row per coordinate\.$",  # m stands in none.
    ),
    (("[[0.1]]", '[["a"], [0]]'), r"`dissipation_matrix` must be 1 × 1; got 2 × 1"),
    (("[[0.1]]", '[[0]]\ninput_matrix = [["a"], [0]]'), "`input_matrix` must have 1 row; got 2 × 1"),
    (('correct = ["potential_energy"]', 'correct = "all"'), "`correct` must be a list of names"),
    (('correct = ["potential_energy"]', 'correct = ["input_matrix"]'), "`correct` must name parts that are given"),
    (("correct =", 'cyclic = "q1"\ncorrect ='), "`cyclic` must be a list of names of coordinates; got 'q1'"),
    (("correct =", 'cyclic = ["q1"]\ncorrect ='), "`cyclic` must name .* `q1` stands in `potential_energy`"),
    (("[known.parameters]\nm = 2", "parameters = 2"), "got `m`: give its value"),
    (("space =", 'robot = "arm.urdf"\nspace ='), r"`robot` must stand under \[known\]"),
    ((KNOWN, "known = 3"), r"\[train\] has no key `known`"),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=[message for _, message in BAD])
def test_a_wrong_table_is_refused(tmp_path, change, message):
    with pytest.raises(DataError, match=message) as caught:
        read_description(described(tmp_path, (LEAST + KNOWN).replace(*change)))
    assert str(caught.value).startswith(f"`{tmp_path / 'arm.toml'}`: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("known = 3\n" + LEAST, r"\[known\] must be a table; got 3"),
        (LEAST + "[known]\nconstants = 3\n", r"\[known.constants\] must be a table of names and numbers; got 3"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        read_description(described(tmp_path, text))


def test_the_example_of_an_arm_is_read():
    known = read_description(EXAMPLES / "dfki-c1-known.toml").known
    assert known is not None
    assert len(known.parameters) == 11


@pytest.mark.parametrize(
    ("columns", "told", "cyclic"),
    [
        ('["tilt", "yaw"]', '["yaw"]', ("q2",)),
        ('["tilt", "yaw"]', '["q1", "yaw"]', ("q1", "q2")),
        ('["q0", "q1"]', '["q0", "q2"]', ("q1", "q2")),
        ('["q1", "q2"]', '["q2"]', ("q2",)),
    ],
)
def test_cyclic_coordinates_are_named_by_number_or_column(tmp_path, columns, told, cyclic):
    text = LEAST.replace('space = "T1"', 'space = "T2"').replace('["q"]', columns)
    known = read_description(described(tmp_path, f"{text}[known]\ncyclic = {told}\n")).known
    assert known is not None
    assert known.cyclic == cyclic


def test_a_cyclic_coordinate_that_could_be_two_is_refused(tmp_path):
    text = LEAST.replace('space = "T1"', 'space = "T2"').replace('["q"]', '["q0", "q1"]')
    with pytest.raises(DataError, match=r"which coordinate it means; `q1` .* Write `q2` for the column, `q0` for"):
        read_description(described(tmp_path, f'{text}[known]\ncyclic = ["q1"]\n'))


LINK = '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="2"/></inertial></link>{}</robot>'
HINGE = '<joint name="hinge" type="continuous"><parent link="a"/><child link="b"/></joint>'


def test_a_robot_stands_beside_the_description(tmp_path):
    (tmp_path / "arm.urdf").write_text(LINK.format(HINGE))
    for line in ('robot = "arm.urdf"', 'robot = { urdf = "arm.urdf", joints = ["hinge"], gravity = [0, 0, -9.81] }'):
        known = read_description(described(tmp_path, f"{LEAST}[known]\n{line}\n")).known
        assert known is not None
        assert known.robot is not None
        assert known.given == ("mass_matrix", "potential_energy")
        assert [body.joint for body in known.robot.bodies] == ["hinge"]
        assert known.robot.gravity == (0, 0, -9.81)


BAD_ROBOTS = [
    ("robot = 3", "`robot` must be the path of a URDF file"),
    ("robot = { joints = [] }", "`robot` must be the path of a URDF file"),
    ('robot = "leg.urdf"', "leg.urdf` cannot be read: No such file"),
    ('robot = { urdf = "arm.urdf", joint = ["hinge"] }', "has no key `joint`. Did you mean `joints`"),
    ('robot = { urdf = "arm.urdf", joints = "hinge" }', "`joints` must be a list of names"),
    ('robot = { urdf = "arm.urdf", joints = ["knee"] }', "arm.urdf`: `joints` must be names of joints that move"),
    ('robot = { urdf = "arm.urdf", at = { hinge = "up" } }', "`at` must be a table of joints and where they stand"),
    ('robot = { urdf = "arm.urdf", at = { hinge = 0.5 } }', "that are not in `joints`.*got `hinge` at 0.5"),
    ('robot = { urdf = "arm.urdf", gravity = -9.81 }', "`gravity` must be a list of three numbers"),
    ('robot = { urdf = "arm.urdf", gravity = ["g"] }', "`gravity` must be a list of three numbers"),
    ('robot = { urdf = "arm.urdf", gravity = [0, -9.81] }', "`gravity` must be 3 finite numbers"),
    ('robot = "arm.urdf"\nmass_matrix = [[1]]', "`mass_matrix` must be given once; a robot gives it too"),
]


@pytest.mark.parametrize(("line", "message"), BAD_ROBOTS, ids=[message for _, message in BAD_ROBOTS])
def test_robots_that_cannot_be_meant_are_refused(tmp_path, line, message):
    (tmp_path / "arm.urdf").write_text(LINK.format(HINGE))
    with pytest.raises(DataError, match=message):
        read_description(described(tmp_path, f"{LEAST}[known]\n{line}\n"))
