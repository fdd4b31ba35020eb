"""The table [known] of a description."""

from pathlib import Path

import pytest

from symoden.data import DataError, read_dataset
from symoden.data._description import read_description

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
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


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
    (('correct = ["potential_energy"]', 'correct = "all"'), "`correct` must be a list of names"),
    (('correct = ["potential_energy"]', 'correct = ["input_matrix"]'), "`correct` must name parts that are given"),
    (("[known.parameters]\nm = 2", "parameters = 2"), "got `m`: give its value"),
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
