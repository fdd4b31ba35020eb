"""Inputs that change together, or never within a file, are named; others are not."""

import numpy as np
import pytest

from symoden import KnownParts
from symoden.data import Dataset, Trajectory, check_dataset
from symoden.data.checks import find_tied_positions, find_untold_inputs

STEP, ROWS = 0.01, 200


def log(name, us):
    """A recording of one angle under given inputs, which begin with rows of zeros."""
    us = np.asarray(us, float).reshape(ROWS, -1).copy()
    us[:2] = 0.0
    ts = STEP * np.arange(ROWS)
    return Trajectory(name=name, ts=ts, q=np.sin(ts)[:, None], rates=np.cos(ts)[:, None], us=us)


def found(*train, **more):
    return find_untold_inputs(Dataset(name="d", space="T1", train=train, **more))


def constant(*values):
    return np.tile(np.array(values, float), (ROWS, 1))


def noise(seed, inputs=1):
    return np.random.default_rng(seed).normal(0, 1, (ROWS, inputs))


def test_inputs_that_change_together_are_named_with_in_how_many_ways():
    constants = log("a", constant(1018, 217, 531, 443)), log("b", constant(716, 681, 782, 406))
    (finding,) = found(*constants, log("c", 300 * noise(0) * np.ones(4)), input_names=("3", "4", "5", "6"))
    assert (finding.kind, finding.level, finding.channel) == ("together", "warning", "")
    assert finding.text == (
        "in [train] `3`, `4`, `5`, `6` change together within files, as if they were 1 input: what each of them does "
        "is not told"
    )
    assert finding.advice.startswith("Record motions in which these inputs change one after another, or give `input_m")


def test_inputs_of_which_two_are_one_are_named_and_others_are_not():
    us = noise(1, 3)
    us[:, 2] = 1e-3 * (us[:, 0] + 1e-3 * us[:, 2])
    (finding,) = found(log("a", us))
    assert finding.text.startswith("in [train] `u1`, `u3` change together within files, as if they were 1 input: ")
    us[:, 2] += 1e-4 * noise(2)[:, 0]
    assert found(log("a", us)) == []


@pytest.mark.parametrize("inputs", [1, 2])
def test_inputs_that_never_change_within_a_file_are_noted(inputs):
    values = [(1, 5), (2, 4), (4, 8), (3, -1)]
    (finding,) = found(*(log(f"{k}", constant(*each[:inputs])) for k, each in enumerate(values)))
    assert (finding.level, finding.channel) == ("note", "u1" if inputs == 1 else "")
    assert "within a file: what " in finding.text
    assert finding.text.endswith(" told by comparing files alone")
    assert finding.advice.startswith("Nothing need be done if nothing else differs from file to file. Else record")


def test_two_values_do_not_tell_two_inputs_apart():
    (finding,) = found(log("a", constant(1, 5)), log("b", constant(2, 4)))
    assert (finding.level, finding.text.split(": ")[1]) == ("warning", "what each of them does is not told")


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_inputs_that_change_by_themselves_are_not_named(scale):
    us = noise(3, 2) * [1, scale]
    assert found(log("a", us)) == []
    assert found(log("a", us * [1, 0]), log("b", us * [0, 1])) == []  # One after the other.
    pulse = np.where(np.arange(ROWS)[:, None] == 50, [0, scale], us * [1, 0])
    assert found(log("a", pulse)) == []


def test_pieces_of_a_file_are_one():
    assert found(log("a#1", constant(1)), log("a#2", constant(2))) == []


def test_nothing_is_said_where_the_input_matrix_is_given_or_nothing_changes():
    log_of_two = log("a", noise(0) * np.ones(2))
    assert found(log_of_two)
    assert found(log_of_two, input_matrix=np.array([[1.0, 2.0]])) == []
    assert found(log_of_two, known=KnownParts(input_matrix=[[1, "a"]], parameters={"a": 2.0})) == []
    assert found(log("a", constant(1, 2))) == []
    assert found(log("a", np.zeros((ROWS, 0)))) == []
    assert found(test=(log_of_two,)) == []


def test_an_input_that_does_nothing_is_none_of_those_that_change_together():
    (finding,) = found(log("a", np.column_stack([noise(0), noise(0), constant(1)])))
    assert "`u1`, `u2` change" in finding.text


def test_the_check_says_it():
    ts = STEP * np.arange(ROWS)
    u = noise(0)[:, 0]
    said = {"space": "T1", "time": "t", "positions": ["q"], "inputs": ["a", "b"], "train": {"files": ["run"]}}
    tables = {"run": {"t": ts, "q": np.sin(ts), "a": u, "b": 2 * u}}
    (finding,) = [one for one in check_dataset(said, tables=tables).findings if one.kind == "together"]
    assert "`a`, `b` change together" in finding.text


def moving(*positions):
    ts = STEP * np.arange(ROWS)
    q = np.stack(positions, axis=1)
    return Trajectory(name="a", ts=ts, q=q, rates=np.gradient(q, STEP, axis=0), us=np.zeros((ROWS, 0)))


@pytest.mark.parametrize(("apart", "named"), [(1e-3, True), (0.05, False)])
def test_positions_that_follow_one_path_are_noted(apart, named):
    ts = STEP * np.arange(ROWS)
    path, other = np.sin(3 * ts), np.cos(7 * ts)
    tied = 0.3 - 2 * path + apart * np.sin(11 * ts)
    findings = find_tied_positions(Dataset(name="d", space="T3", train=(moving(path, other, tied),)))
    assert bool(findings) == named
    for finding in findings:
        assert (finding.kind, finding.level) == ("together", "note")
        assert finding.text.startswith("in [train] `q1`, `q3` move together, as if they were 1 joint: ")


def test_joints_that_stand_still_are_not_taken_for_tied_ones():
    ts = STEP * np.arange(ROWS)
    assert not find_tied_positions(Dataset(name="d", space="T2", train=(moving(np.sin(ts), np.full(ROWS, 0.5)),)))
    assert not find_tied_positions(Dataset(name="d", space="T1", train=(moving(np.sin(ts)),)))


def test_joints_that_turn_on_and_are_apart_by_half_a_radian_are_not_tied():
    ts = STEP * np.arange(ROWS)
    wound = moving(25 * ts + 0.5 * np.cos(7 * ts), -50 * ts + 0.5 * np.sin(5 * ts))
    assert not find_tied_positions(Dataset(name="d", space="T2", train=(wound,)))


def test_where_one_file_tells_joints_apart_they_are_not_tied():
    ts = STEP * np.arange(ROWS)
    far, near = (moving(s * np.sin(3 * ts), s * np.sin(3 * ts) + a * np.cos(ts)) for s, a in ((100, 0), (1, 1)))
    assert find_tied_positions(Dataset(name="d", space="R2", train=(far,)))
    assert not find_tied_positions(Dataset(name="d", space="R2", train=(far, near)))


def test_where_inertia_and_energy_are_given_nothing_is_untold():
    ts = STEP * np.arange(ROWS)
    known = KnownParts(mass_matrix=[["1", "0"], ["0", "1"]], potential_energy="0")
    dataset = Dataset(name="d", space="T2", train=(moving(np.sin(ts), np.sin(ts)),), known=known)
    assert not find_tied_positions(dataset)
