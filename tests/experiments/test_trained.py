"""Saved models of cells, side by side."""

import dataclasses

import jax
import pytest

from symoden.experiments import (
    Cell,
    CellResult,
    RunConfig,
    own_trajectories,
    read_contests,
    read_source,
    summarize,
    write_run,
)
from symoden.models import ModelConfig, build, save
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.training import TrainingConfig


@pytest.fixture(scope="module")
def data():
    return summarize(read_source("pendulum").dataset)


@pytest.fixture
def saved(tmp_path, data):
    """Save an untrained model as a cell, and return its result."""

    def save_cell(kind, *, error=None, **cell):
        cell = Cell(**({"task": "pendulum", "model": kind, "preset": "default", "seed": 0} | cell))
        config = ModelConfig(kind=kind, flow=(3,), energy=(3,))
        folder = tmp_path / "cells" / cell.name
        run = RunConfig(source=cell.task, seed=cell.seed, model=config, training=TrainingConfig(), data=data)
        write_run(folder, dataclasses.replace(run, preset=cell.preset))
        save(folder / "model.safetensors", build(config, Space.parse("T1"), 1, key=jax.random.key(cell.seed)))
        return CellResult(cell=cell, error=error)

    return save_cell


def test_models_of_one_seed_stand_side_by_side_in_the_paper_s_order(tmp_path, saved):
    results = [saved("dissipative"), saved("naive"), saved("dissipative", seed=1), saved("symoden", preset="paper")]
    first, second = read_contests(tmp_path, results)
    assert (first.name, first.preset, list(first.trained)) == ("pendulum", "default", ["naive", "dissipative"])
    assert (second.preset, list(second.trained)) == ("paper", ["symoden"])
    assert first.source.seed == 0
    assert first.source.dataset.space == "T1"
    assert len(first.source.prediction) == 64


def test_the_seed_with_most_models_is_taken(tmp_path, saved):
    results = [saved("naive"), saved("dissipative", error="diverged"), saved("naive", seed=2), saved("symoden", seed=2)]
    (found,) = read_contests(tmp_path, results)
    assert found.source.seed == 2
    assert list(found.trained) == ["naive", "symoden"]


def test_cells_with_other_data_do_not_take_part(tmp_path, saved):
    results = [saved("naive"), saved("symoden", noise=0.05), saved("unstructured", trajectories=16)]
    (found,) = read_contests(tmp_path, [*results, saved("dissipative", trajectories=320)])
    assert list(found.trained) == ["naive", "dissipative"]
    assert own_trajectories("pendulum") == 320


def test_a_model_that_is_gone_is_named(tmp_path, saved):
    result = saved("naive")
    (tmp_path / "cells" / result.cell.name / "model.safetensors").unlink()
    with pytest.raises(StorageError, match=r"no `model\.safetensors`"):
        read_contests(tmp_path, [result])


def test_without_finished_cells_there_is_nothing(tmp_path, saved):
    assert read_contests(tmp_path, []) == ()
    assert read_contests(tmp_path, [dataclasses.replace(saved("naive"), error="diverged")]) == ()
