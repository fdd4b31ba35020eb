"""Rows of the table: medians and ranges over seeds, beside the paper's values."""

import math

import pytest

from symoden.experiments import PAPER, Cell, CellResult, MeanStd, table_rows
from symoden.models import Kind


def result(test, *, seed=0, task="pendulum", model: Kind = "dissipative", seconds: float | None = 10.0, **options):
    cell = Cell(task=task, model=model, preset=options.pop("preset", "default"), seed=seed, **options)
    return CellResult(
        cell=cell,
        parameters=100 + seed,
        train=MeanStd(test / 2, 0.5),
        test=MeanStd(test, seed + 0.25),
        prediction=MeanStd(2 * test, 1.0),
        seconds=seconds,
    )


def failed(seed, **options):
    return CellResult(
        cell=Cell(task="pendulum", model="dissipative", preset="default", seed=seed, **options), error="no"
    )


def test_the_median_seed_and_the_range():
    (row,) = table_rows([result(value, seed=seed) for seed, value in enumerate((0.4, 0.01, 0.02, 0.3, 9.0))])
    assert (row.task, row.model, row.seeds, row.failed, row.parameters) == ("pendulum", "dissipative", 5, 0, 100)
    assert row.test is not None
    assert (row.test.median, row.test.least, row.test.greatest) == (0.3, 0.01, 9.0)
    assert row.test.spread == MeanStd(0.3, 3.25)
    assert row.test.paper == MeanStd(0.13, 0.25)
    assert row.test.ratio == pytest.approx(0.13 / 0.3)
    assert row.train is not None
    assert row.train.paper == MeanStd(0.15, 0.27)
    assert row.prediction is not None
    assert (row.prediction.median, row.prediction.paper) == (0.6, MeanStd(1.04, 1.3))


def test_of_an_even_number_the_lower_of_the_two_in_the_middle():
    (row,) = table_rows([result(value, seed=seed) for seed, value in enumerate((4.0, 1.0, 3.0, 2.0))])
    assert row.test is not None
    assert row.test.spread == MeanStd(2.0, 3.25)


def test_seconds_are_the_median():
    (row,) = table_rows([result(1.0, seed=seed, seconds=seconds) for seed, seconds in enumerate((5.0, 30.0, None))])
    assert row.seconds == 17.5


def test_failed_seeds_are_counted_and_diverged_ones_are_the_worst():
    (row,) = table_rows([failed(0), result(1.0, seed=1), result(math.inf, seed=2), result(2.0, seed=3)])
    assert (row.seeds, row.failed) == (3, 1)
    assert row.test is not None
    assert (row.test.median, row.test.greatest) == (2.0, math.inf)
    (row,) = table_rows([failed(0), failed(1)])
    assert (row.seeds, row.failed, row.parameters, row.test, row.seconds) == (0, 2, None, None, None)


def test_a_perfect_model_has_no_ratio():
    (row,) = table_rows([result(0.0)])
    assert row.test is not None
    assert row.test.ratio is None


def test_rows_are_in_the_papers_order_whatever_the_order_of_results():
    others: tuple[Kind, ...] = ("symoden", "geometric", "naive", "unstructured")
    results = [
        result(1.0, task="acrobot"),
        result(1.0, trajectories=64),
        result(1.0, trajectories=16),
        result(1.0, noise=0.05),
        result(1.0, preset="paper"),
        result(1.0),
        *(result(1.0, model=model) for model in others),
        result(1.0, task="pendulum-canonical", space="T1"),
        result(1.0, task="pendulum-canonical"),
    ]
    found = [(row.task, row.space, row.preset, row.trajectories, row.noise, row.model) for row in table_rows(results)]
    assert found == [
        ("pendulum-canonical", None, "default", None, 0.0, "dissipative"),
        ("pendulum-canonical", "T1", "default", None, 0.0, "dissipative"),
        ("pendulum", None, "default", None, 0.0, "naive"),
        ("pendulum", None, "default", None, 0.0, "geometric"),
        ("pendulum", None, "default", None, 0.0, "unstructured"),
        ("pendulum", None, "default", None, 0.0, "symoden"),
        ("pendulum", None, "default", None, 0.0, "dissipative"),
        ("pendulum", None, "default", None, 0.05, "dissipative"),
        ("pendulum", None, "default", 16, 0.0, "dissipative"),
        ("pendulum", None, "default", 64, 0.0, "dissipative"),
        ("pendulum", None, "paper", None, 0.0, "dissipative"),
        ("acrobot", None, "default", None, 0.0, "dissipative"),
    ]


def test_the_paper_stands_beside_what_it_did():
    def paper(**options):
        (row,) = table_rows([result(1.0, **options)])
        assert row.test is not None
        return row.test.paper

    assert paper(task="pendulum-canonical", space="T1") == PAPER["pendulum-canonical"]["dissipative"].test
    assert paper(preset="paper") == PAPER["pendulum"]["dissipative"].test
    assert paper(task="cartpole-full") is None
    assert paper(trajectories=64) is None
    assert paper(noise=0.01) is None
