"""The paper's tasks: their facts, and what is refused."""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from symoden.experiments import PAPER, TASKS, MeanStd, task
from symoden.spaces import Space

TABLE = Path(__file__).resolve().parents[2].parent / "shared" / "paper" / "table1.csv"


@pytest.mark.parametrize("name", TASKS)
def test_a_task_is_consistent_in_itself(name):
    found = task(name)
    n, m = found.system.space.size, found.system.inputs
    assert found.name == name
    assert Space.parse(found.space).size == n
    assert len(found.position_bounds) == len(found.rate_bounds) == len(found.position_names) == n
    assert all(low < high for low, high in found.position_bounds + found.rate_bounds)
    assert {len(u) for u in found.input_values} == {m}
    assert len(found.input_names) == m
    assert (0.0,) * m in found.input_values
    assert (found.points, found.prediction_points, found.n_train, found.n_test) == (20, 40, 64, 64)


@pytest.mark.parametrize(
    ("name", "space", "momenta", "dt", "inputs"),
    [
        ("pendulum-canonical", "R1", True, 0.05, 5),
        ("pendulum", "T1", False, 0.05, 5),
        ("cartpole", "R1 T1", False, 0.02, 5),
        ("acrobot", "T2", False, 0.05, 5),
        ("cartpole-full", "R1 T1", False, 0.02, 9),
        ("acrobot-full", "T2", False, 0.05, 9),
    ],
)
def test_a_task_is_observed_as_in_the_paper(name, space, momenta, dt, inputs):
    found = task(name)
    assert (found.space, found.system.momenta, found.dt) == (space, momenta, dt)
    assert len(set(found.input_values)) == len(found.input_values) == inputs


def test_the_pendulums_are_the_papers():
    q = jnp.array([0.3])
    canonical, upright = task("pendulum-canonical").system, task("pendulum").system
    for system in (canonical, upright):
        assert system.inverse_mass_matrix(q).item() == pytest.approx(3.0)
        assert system.dissipation_matrix(q, q).item() == pytest.approx(0.1)
    assert canonical.potential_energy(q).item() == pytest.approx(5 * (1 - np.cos(0.3)))
    assert upright.potential_energy(q).item() == pytest.approx(5 * (1 + np.cos(0.3)))


def test_full_actuation_changes_nothing_but_the_inputs():
    q = jnp.array([0.3, 0.4])
    for name in ("cartpole", "acrobot"):
        system, full = task(name).system, task(f"{name}-full").system
        assert full.input_matrix(q).tolist() == np.eye(2).tolist()
        assert full.hamiltonian(q, q) == system.hamiltonian(q, q)
        assert full.dissipation_matrix(q, q).tolist() == system.dissipation_matrix(q, q).tolist()


def test_an_unknown_task_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"one of pendulum-canonical, pendulum, .*; got 'cart-pole'"):
        task("cart-pole")


def test_tasks_beyond_the_paper_have_no_errors_of_the_paper():
    assert dict(task("cartpole-full").paper) == {}
    assert task("acrobot").paper["dissipative"].prediction == MeanStd(12.72, 32.12)
    assert "geometric" not in task("pendulum-canonical").paper


def test_the_papers_errors_are_those_of_its_table():
    if not TABLE.is_file():
        pytest.skip("the paper's table is not here")
    names = dict(zip("1234", PAPER, strict=True))
    with TABLE.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(models) for models in PAPER.values())
    for row in rows:
        errors = PAPER[names[row["task"]]][row["model"]]
        assert errors.parameters_millions == float(row["parameters_millions"])
        for part in ("train", "test", "prediction"):
            assert getattr(errors, part) == (float(row[f"{part}_mean"]), float(row[f"{part}_std"]))
