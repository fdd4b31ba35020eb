"""What was varied, found in the table's rows."""

import numpy as np
import pytest

from symoden.experiments import Cell, CellResult, MeanStd, is_own, row_name, sweeps, table_rows


def result(model="dissipative", error=1.0, **cell):
    cell = Cell(**({"task": "pendulum", "model": model, "preset": "default", "seed": 0} | cell))
    errors = MeanStd(error, 0.0)
    return CellResult(cell=cell, parameters=1, train=errors, test=errors, prediction=errors, seconds=1.0)


def test_errors_over_trajectories_and_over_noise():
    results = [
        *(result(error=error, seed=seed) for seed, error in enumerate((1.0, 3.0, 2.0))),
        result(error=9.0, trajectories=16),
        result(error=0.5, trajectories=1280),
        result(error=5.0, noise=0.05),
        result(error=4.0, noise=0.01),
        result(error=7.0, noise=0.01, trajectories=16),
        result("naive", error=8.0),
    ]
    counts, noises = sweeps(table_rows(results))
    assert (counts.name, counts.preset, counts.quantity, counts.own) == (
        "pendulum",
        "default",
        "training trajectories [1]",
        320.0,
    )
    curve = counts.curves["dissipative"]
    np.testing.assert_array_equal(curve.values, [16, 320, 1280])
    np.testing.assert_array_equal(curve.median, [9.0, 2.0, 0.5])
    np.testing.assert_array_equal(curve.least, [9.0, 1.0, 0.5])
    np.testing.assert_array_equal(curve.greatest, [9.0, 3.0, 0.5])
    assert list(counts.curves) == ["naive", "dissipative"]
    assert noises.quantity == "standard deviation of noise [SI]"
    np.testing.assert_array_equal(noises.curves["dissipative"].values, [0.0, 0.01, 0.05])
    np.testing.assert_array_equal(noises.curves["dissipative"].median, [2.0, 4.0, 5.0])


def test_one_value_is_no_sweep_and_presets_are_kept_apart():
    assert sweeps(table_rows([result(), result("naive"), result(preset="paper", trajectories=16)])) == ()


def test_the_task_s_own_number_said_outright_is_the_same_point():
    own = result(error=1.0)
    both = sweeps(table_rows([own, result(error=2.0, trajectories=320), result(trajectories=16)]))
    np.testing.assert_array_equal(both[0].curves["dissipative"].median, [1.0, 1.0])


def test_what_failed_is_a_point_without_an_error():
    failed = CellResult(
        cell=Cell(task="pendulum", model="naive", preset="default", seed=0, trajectories=16), error="diverged"
    )
    (sweep,) = sweeps(table_rows([failed, result(), result(trajectories=64)]))
    np.testing.assert_array_equal(sweep.curves["naive"].median, [np.nan])
    np.testing.assert_array_equal(sweep.curves["dissipative"].median, [1.0, 1.0])


@pytest.mark.parametrize(
    ("cell", "name"), [({}, "pendulum"), ({"task": "cartpole", "space": "R1 R1"}, "cartpole-R1R1")]
)
def test_names_can_be_those_of_files(cell, name):
    (row,) = table_rows([result(**cell)])
    assert row_name(row) == name
    assert is_own(row)
