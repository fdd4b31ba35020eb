"""A cell is trained once: what is on disk is read, what was interrupted goes on, what failed says so."""

import dataclasses
import json
import math

import equinox as eqx
import pytest

from symoden.experiments import (
    BlockErrors,
    Cell,
    CellResult,
    MeanStd,
    cell_folder,
    read_model,
    read_result,
    read_results,
    read_run,
    result_as_json,
    run_cell,
    write_result,
)
from symoden.models import ModelConfig
from symoden.storage import StorageError
from symoden.training import TrainingConfig, TrainingError

CELL = Cell(task="pendulum", model="dissipative", preset="default", seed=1, trajectories=6, noise=0.01)


@pytest.fixture(autouse=True)
def quick(monkeypatch, tiny):
    monkeypatch.setattr("symoden.experiments._run_cell.preset", tiny)


def forbid(monkeypatch, *names):
    """Fail where one of these is called."""

    def called(*arguments, **options):
        raise AssertionError("This must not be done again.")

    for name in names:
        monkeypatch.setattr(f"symoden.experiments._run_cell.{name}", called)


@pytest.fixture(scope="module")
def finished(tmp_path_factory, tiny):
    """A finished cell; not to be written to."""
    folder = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("symoden.experiments._run_cell.preset", tiny)
        return folder, run_cell(folder, CELL)


def copied(finished, tmp_path, *names):
    """Some files of the finished cell in another folder."""
    folder, _ = finished
    run = cell_folder(tmp_path, CELL)
    run.mkdir(parents=True)
    for name in names:
        (run / name).write_bytes((cell_folder(folder, CELL) / name).read_bytes())
    return run


def test_a_cell_is_trained_scored_and_kept(finished):
    folder, result = finished
    run = cell_folder(folder, CELL)
    assert run == folder / "cells" / "pendulum-dissipative-default-1-n6-s0.01"
    assert (result.cell, result.error) == (CELL, None)
    assert result.parameters is not None
    assert result.parameters > 0
    assert result.blocks is not None
    assert result.seconds is not None
    assert result.seconds > 0
    config = read_run(run)
    assert (config.source, config.seed, config.trajectories, config.noise) == ("pendulum", 1, 6, 0.01)
    assert (config.training.seed, config.data.recordings["train"]) == (1, 6)
    assert read_result(run) == result
    assert read_results(folder) == (result,)


def test_a_finished_cell_is_read(finished, monkeypatch):
    folder, result = finished
    forbid(monkeypatch, "train_run", "score_task", "read_source", "write_result")
    assert run_cell(folder, CELL) == result


def test_a_trained_cell_is_only_scored(finished, tmp_path, monkeypatch):
    run = copied(finished, tmp_path, "config.json", "model.safetensors", "metrics.jsonl")
    forbid(monkeypatch, "train_run")
    found, known = run_cell(tmp_path, CELL), finished[1]
    last = json.loads((run / "metrics.jsonl").read_text().splitlines()[-1])
    assert found == dataclasses.replace(known, seconds=last["seconds"])


def test_a_killed_cell_goes_on(finished, tmp_path):
    folder, result = finished
    run = copied(finished, tmp_path, "config.json")
    found = run_cell(tmp_path, CELL)
    assert eqx.tree_equal(read_model(run), read_model(cell_folder(folder, CELL)))
    assert dataclasses.replace(found, seconds=result.seconds) == result


def test_a_process_that_was_killed_while_it_wrote_is_no_obstacle(tmp_path, monkeypatch):
    run = cell_folder(tmp_path, CELL)
    run.mkdir(parents=True)
    (run / ".config.json.abc").write_text("{")

    def stop(*arguments, **options):
        raise TrainingError("stop")

    monkeypatch.setattr("symoden.experiments._runs.fit", stop)
    assert run_cell(tmp_path, CELL).error == "stop"
    assert not (run / ".config.json.abc").exists()


def test_a_failure_is_a_result(tmp_path, monkeypatch):
    def diverge(*arguments, **options):
        raise TrainingError("Every rollout\n diverged.")

    monkeypatch.setattr("symoden.experiments._run_cell.train_run", diverge)
    failed = run_cell(tmp_path, CELL)
    assert failed == CellResult(cell=CELL, error="Every rollout diverged.")
    forbid(monkeypatch, "train_run")
    assert run_cell(tmp_path, CELL) == failed
    assert result_as_json(failed) == {
        "task": "pendulum",
        "space": None,
        "model": "dissipative",
        "preset": "default",
        "trajectories": 6,
        "noise": 0.01,
        "seed": 1,
        "parameters": None,
        "train_error": None,
        "test_error": None,
        "prediction_error": None,
        "seconds": None,
        "blocks": None,
        "error": "Every rollout diverged.",
    }


def test_other_settings_are_refused(finished, monkeypatch, tiny):
    def other(name, *, task, kind):
        model, training = tiny(name, task=task, kind=kind)
        return model, dataclasses.replace(training, adam_steps=6)

    monkeypatch.setattr("symoden.experiments._run_cell.preset", other)
    with pytest.raises(ValueError, match=r"begun with other settings .* another `training`\. Choose another folder"):
        run_cell(finished[0], CELL)


def test_rollouts_that_diverge_are_null_on_disk_and_infinite_in_memory(tmp_path):
    blocks = BlockErrors(
        gauge=2.0, inverse_mass=0.1, potential=0.2, actuation=0.3, dissipation=math.inf, dissipation_median=0.5
    )
    result = CellResult(cell=CELL, test=MeanStd(math.inf, math.inf), prediction=MeanStd(1.0, 2.0), blocks=blocks)
    run = cell_folder(tmp_path, CELL)
    write_result(run, result)
    text = (run / "result.json").read_text()
    assert "Infinity" not in text
    assert json.loads(text)["test_error"] == {"mean": None, "std": None}
    assert read_result(run) == result


DAMAGES = {
    "truncated": (lambda text: text[: len(text) // 2], "is damaged: .* Remove it"),
    "no object": (lambda text: "[1]", "must be an object; got .* Remove it"),
    "misspelt": (lambda text: text.replace('"seconds"', '"moments"'), "no key `moments`.* Remove it"),
    "misspelt block": (lambda text: text.replace('"gauge"', '"gouge"'), "`blocks` has no key `gouge`.* Remove it"),
    "text": (lambda text: text.replace('"seed": 1', '"seed": "one"'), "`seed` must be int.* Remove it"),
    "other task": (lambda text: text.replace('"pendulum"', '"pendulm"'), "got 'pendulm'.* Remove it"),
    "other cell": (
        lambda text: text.replace('"seed": 1', '"seed": 2'),
        "must be the result of the cell .*-1-n6.*-2-n6",
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_result_is_named(finished, tmp_path, damage):
    run = copied(finished, tmp_path, "result.json")
    change, message = DAMAGES[damage]
    path = run / "result.json"
    path.write_text(change(path.read_text()))
    with pytest.raises(StorageError, match=rf"result\.json`.*{message}"):
        run_cell(tmp_path, CELL)
    with pytest.raises(StorageError, match=r"result\.json"):
        read_results(tmp_path)


def test_damaged_metrics_are_named(finished, tmp_path):
    run = copied(finished, tmp_path, "config.json", "model.safetensors")
    (run / "metrics.jsonl").write_text("{}\n")
    with pytest.raises(StorageError, match=r"metrics\.jsonl` is damaged"):
        run_cell(tmp_path, CELL)


def test_data_too_few_to_train_on_fail_a_cell_and_not_the_rest(tmp_path, monkeypatch):
    monkeypatch.setattr("symoden.experiments._run_cell.preset", lambda *_, **__: (ModelConfig(), TrainingConfig()))
    lonely = Cell(task="pendulum", model="naive", preset="default", seed=0, trajectories=1)
    result = run_cell(tmp_path, lonely)
    assert result.error is not None
    assert "validation needs recordings" in result.error
    assert run_cell(tmp_path, lonely) == result
