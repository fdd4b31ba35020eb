"""Cells of the paper's evaluation: which there are, in which order, and under which names."""

import pytest

from symoden.experiments import Cell, cells
from symoden.models import KINDS

TASKS = ("pendulum-canonical", "pendulum-canonical:T1", "pendulum", "cartpole", "acrobot")


def names(*arguments, **options):
    return [cell.name for cell in cells(*arguments, **options)]


def test_the_dissipative_model_comes_first_then_tasks_then_seeds():
    found = names(["pendulum", "cartpole"], ["naive", "symoden", "dissipative"], ["default"], 2)
    assert found == [
        "pendulum-dissipative-default-0",
        "cartpole-dissipative-default-0",
        "pendulum-dissipative-default-1",
        "cartpole-dissipative-default-1",
        "pendulum-symoden-default-0",
        "cartpole-symoden-default-0",
        "pendulum-naive-default-0",
        "cartpole-naive-default-0",
        "pendulum-symoden-default-1",
        "cartpole-symoden-default-1",
        "pendulum-naive-default-1",
        "cartpole-naive-default-1",
    ]


def test_presets_and_sweeps_come_one_after_the_other():
    found = names(["pendulum"], ["dissipative"], ["paper", "default"], 1, trajectories=[64, 16], noise=[0.0, 0.05])
    assert found == [
        "pendulum-dissipative-paper-0-n64",
        "pendulum-dissipative-default-0-n64",
        "pendulum-dissipative-paper-0-n64-s0.05",
        "pendulum-dissipative-default-0-n64-s0.05",
        "pendulum-dissipative-paper-0-n16",
        "pendulum-dissipative-default-0-n16",
        "pendulum-dissipative-paper-0-n16-s0.05",
        "pendulum-dissipative-default-0-n16-s0.05",
    ]


def test_the_whole_table_is_every_combination_but_the_geometric_model_on_momenta():
    every = cells(TASKS, KINDS, ["default", "paper"], 3)
    assert len(every) == (5 * 5 - 2) * 2 * 3
    assert len({cell.name for cell in every}) == len(every)
    geometric = {cell.task for cell in every if cell.model == "geometric"}
    assert geometric == {"pendulum", "cartpole", "acrobot"}


def test_a_space_of_its_own_is_no_other_space():
    own, told = cells(["pendulum-canonical:R1", "pendulum-canonical:T1", "pendulum-canonical"], ["naive"], ["paper"], 1)
    assert (own.space, told.space) == (None, "T1")
    assert told.name == "pendulum-canonical-T1-naive-paper-0"


def test_names_are_fit_for_files():
    cell = Cell(task="cartpole", model="naive", preset="default", seed=2, space="R1 T1", trajectories=64, noise=0.05)
    assert cell.name == "cartpole-R1T1-naive-default-2-n64-s0.05"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": ["pendulm"]}, "A task must be one of pendulum-canonical, .*; got 'pendulm'"),
        ({"tasks": ["pendulum:Q1"]}, "'Q1'"),
        ({"tasks": ["pendulum:T2"]}, "`pendulum:T2`: the space must have the task's 1 coordinates; `T2` has 2"),
        ({"tasks": []}, "none is left"),
        ({"tasks": ["pendulum-canonical"], "models": ["geometric"]}, "none is left"),
        ({"models": ["magic"]}, "A model must be one of dissipative, .*; got 'magic'"),
        ({"presets": ["fast"]}, "A preset must be one of default, paper; got 'fast'"),
        ({"seeds": 0}, "number of seeds must be at least 1; got 0"),
        ({"trajectories": [64, 0]}, "number of training trajectories must be at least 1; got 0"),
        ({"noise": [-0.1]}, "must be at least 0 and finite; got -0.1"),
        ({"noise": [float("nan")]}, "must be at least 0 and finite; got nan"),
    ],
    ids=str,
)
def test_what_is_no_cell_is_refused(changes, message):
    plain = {"tasks": ["pendulum"], "models": ["naive"], "presets": ["default"], "seeds": 1}
    with pytest.raises(ValueError, match=message):
        cells(**(plain | changes))


def test_the_number_of_trajectories_that_a_task_has_anyway_makes_no_cell_of_its_own():
    names = [cell.name for cell in cells(["cartpole"], ["naive"], ["default"], 1, trajectories=[16, 320, 1280])]
    assert names == ["cartpole-naive-default-0-n16", "cartpole-naive-default-0", "cartpole-naive-default-0-n1280"]
