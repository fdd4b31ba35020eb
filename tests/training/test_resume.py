"""A run that is stopped, or killed, and resumed ends with the weights of an uninterrupted one, bit for bit."""

import dataclasses
import functools
import os
import signal
import subprocess
import sys
import time

import equinox as eqx
import pytest

from symoden.models import BlockConfig, load
from symoden.storage import StorageError, load_arrays, save_arrays
from symoden.training import Progress, _levenberg_stage, _line_up, fit
from symoden.training._stopwatch import Stopwatch

PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from symoden.data import Dataset, Trajectory
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig, fit

ts = np.linspace(0.0, 2.0, 41)
swing = Trajectory(name="swing", ts=ts, q=np.cos(ts)[:, None], rates=-np.sin(ts)[:, None], us=np.zeros((41, 0)))
plain = BlockConfig(constant=True)
model = ModelConfig(inverse_mass=plain, potential=BlockConfig(hidden=(4,)), actuation=plain, friction=plain, knees=())
config = TrainingConfig(validation=0.2, restarts=1, adam_steps=int(sys.argv[2]), batch_size=8, horizon=3, lm_steps=2,
     lm_horizon=5, lm_substeps=1, growth_steps=0, relevance_steps=0)
folder = Path(sys.argv[1])
dataset = Dataset(name="spring", space="R1", train=(swing,))
fit(dataset, model=model, config=config, folder=folder, resume=True)
"""


def test_stopped_after_every_stride_and_resumed_gives_the_same_bits(
    pendulum, small, quick, tmp_path, in_strides, monkeypatch
):
    monkeypatch.setattr(_levenberg_stage, "EXPLAINED", 0.0)  # No stage is needless,
    monkeypatch.setattr(_line_up, "CLEAR", -99.0)  # and what must gain clearly is kept, so that all others follow.
    dataset = pendulum(count=8)
    quick = dataclasses.replace(quick, lm_steps=1, growth_steps=2, relevance_steps=1)
    whole = fit(dataset, model=small, config=quick, folder=tmp_path / "whole")
    stages, part, whitened, delivered = set(), whole, False, {}
    for part in in_strides(
        dataset,
        most=50,
        model=small,
        config=quick,
        folder=tmp_path / "parts",
        progress=lambda now: stages.add(now.stage if now.step else f"skipped {now.stage}"),
    ):
        arrays, _ = load_arrays(tmp_path / "parts" / "checkpoints" / "latest.safetensors")
        whitened |= any(array.any() for array in arrays.values() if array.shape == (2, 3, 3))  # Lags.
        if not part.completed:
            assert "time limit of 1e-09 minutes" in part.outcome
            assert " still to come" in part.outcome
            left = part.outcome.partition(", with ")[2].partition(" still")[0].split(", ")
            delivered.setdefault(left[0], []).append(part.model)
    assert part.completed
    assert not {stage for stage in stages if stage.startswith("skipped")}, part.verdicts
    assert {
        "adam 1 of 3",
        "adam 2 of 3",
        "adam 3 of 3",
        "levenberg-marquardt",
        "late inputs",
        "relevance",
        "refit",
        "refit on half",
        "growth",
        "growth on all",
    } <= stages
    before = delivered["refit on half"][0]  # What some recordings alone have made is never delivered.
    halves = [*delivered["refit on half"], *delivered["growth"], delivered["growth on all"][0]]
    assert len(halves) >= 4
    assert all(eqx.tree_equal(model, before) for model in halves)
    assert eqx.tree_equal(part.model, whole.model)
    assert part.loss == whole.loss
    assert part.verdicts == whole.verdicts
    assert "not kept" not in whole.verdicts["growth"]
    assert {"relevance", "refit", "growth", "growth on all"} <= set(whole.verdicts)
    lines = [len((tmp_path / run / "metrics.jsonl").read_text().splitlines()) for run in ("whole", "parts")]
    assert lines[0] == lines[1]
    assert whitened


@pytest.mark.parametrize("text", ["no json\n", '{"step": 1}\n', "3\n"])
def test_damaged_metrics_are_named(pendulum, small, quick, tmp_path, text):
    config = dataclasses.replace(quick, adam_steps=5, lm_steps=0)
    run = functools.partial(fit, pendulum(count=4), model=small, config=config, folder=tmp_path)
    run()
    (tmp_path / "metrics.jsonl").write_text(text)
    with pytest.raises(StorageError, match=r"metrics.jsonl` must have one JSON object a line; .* Remove it"):
        run(resume=True)
    (tmp_path / "metrics.jsonl").unlink()
    assert run(resume=True).completed


def test_what_time_ran_out_for_is_judged_as_cut_short(pendulum, small, quick, tmp_path, in_strides):
    config = dataclasses.replace(quick, adam_steps=5, lm_steps=1, growth_steps=0, relevance_steps=2)
    *parts, last = in_strides(pendulum(count=16), most=20, model=small, config=config, folder=tmp_path)
    during, ended = (part.verdicts["whitened errors"] for part in (parts[-1], last))
    assert during.startswith(("cut short, kept (", "cut short, not kept ("))
    assert ended.startswith(("kept (", "not kept ("))


def test_the_time_limit_is_on_this_run_alone():
    watch = Stopwatch(1.0)
    watch.spent = 600.0
    assert watch.seconds >= 600
    assert not watch.is_over()
    assert Stopwatch(1e-9).is_over()
    assert not Stopwatch(None).is_over()


def test_a_time_limit_says_how_far_training_came_and_few_of_the_stages_to_come():
    said = Stopwatch(2.0).outcome(["inputs", "growth", "growth", "friction", "priors"], 4)
    assert said == (
        "stopped at the time limit of 2 minutes after 4 of 9 stages, with inputs, growth, friction, … still to come"
    )


@pytest.mark.parametrize(
    ("ends", "over"), [([50], False), ([50, 54], False), ([5, 30, 55], True), ([30, 34, 57], True)]
)
def test_a_step_that_would_end_after_the_time_limit_is_not_begun(monkeypatch, ends, over):
    clock = iter([0.0, *ends])
    monkeypatch.setattr("symoden.training._stopwatch.time.monotonic", lambda: float(next(clock)))
    watch = Stopwatch(1.0)
    assert [watch.is_over() for _ in ends] == [*[False] * (len(ends) - 1), over]


@pytest.mark.parametrize("logged", [True, False])
def test_a_finished_run_is_not_trained_again(pendulum, small, quick, tmp_path, logged):
    config = dataclasses.replace(quick, adam_steps=5, lm_steps=1, growth_steps=9, patience=1)
    strides = []
    first = fit(pendulum(), model=small, config=config, folder=tmp_path)
    if not logged:  # What came of the stages does not hang on the log, which may be removed where it is damaged.
        (tmp_path / "metrics.jsonl").unlink()
    again = fit(pendulum(), model=small, config=config, folder=tmp_path, resume=True, progress=strides.append)
    assert strides == []
    with pytest.raises(StorageError, match="must hold no run; it has one"):
        fit(pendulum(), model=small, config=config, folder=tmp_path)
    assert eqx.tree_equal(first.model, again.model)
    assert again.completed
    assert again.outcome == first.outcome == "converged"
    assert repr(first).startswith("FitResult(converged: loss ")
    assert again.verdicts == first.verdicts
    assert first.verdicts
    assert again.hardly_judged == first.hardly_judged


def test_a_damaged_checkpoint_is_refused(pendulum, small, quick, tmp_path):
    config = dataclasses.replace(quick, adam_steps=600, lm_steps=0)
    fit(pendulum(), model=small, config=config, folder=tmp_path, max_minutes=1e-9)
    path = tmp_path / "checkpoints" / "latest.safetensors"
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises(StorageError, match="truncated or damaged"):
        fit(pendulum(), model=small, config=config, folder=tmp_path, resume=True)


@pytest.mark.parametrize("name", ["stage", "seconds", "incumbent_origin", "stages", "data and settings", "findings"])
@pytest.mark.parametrize("value", [None, "soon"])
def test_a_checkpoint_of_another_version_is_refused(pendulum, small, quick, tmp_path, name, value):
    config = dataclasses.replace(quick, adam_steps=2)
    fit(pendulum(), model=small, config=config, folder=tmp_path, max_minutes=1e-9)
    path = tmp_path / "checkpoints" / "latest.safetensors"
    arrays, plain = load_arrays(path)
    others = {key: number for key, number in plain.items() if key != name}
    save_arrays(path, arrays, others if value is None else others | {name: value})
    with pytest.raises(StorageError, match=r"of the same data, settings and version.*start anew"):
        fit(pendulum(), model=small, config=config, folder=tmp_path, resume=True)


@pytest.mark.parametrize("other", ["seed", "prior", "model", "data"])
def test_a_checkpoint_of_other_data_or_settings_is_refused(pendulum, small, quick, tmp_path, other):
    config, folder = dataclasses.replace(quick, adam_steps=2), str(tmp_path)
    fit(pendulum(), model=small, config=config, folder=folder, max_minutes=1e-9)
    parts = {"dataset": pendulum(), "model": small, "config": config}
    changed = {
        "seed": {"config": dataclasses.replace(config, seed=1)},
        "prior": {"config": dataclasses.replace(config, prior=2.0)},
        "model": {"model": dataclasses.replace(small, potential=BlockConfig(hidden=(5,)))},
        "data": {"dataset": pendulum(seed=1)},
    }
    with pytest.raises(StorageError, match="of the same data, settings and version"):
        fit(**(parts | changed[other]), folder=folder, resume=True)
    assert fit(**parts, folder=folder, resume=True, max_minutes=1e-9).seconds > 0


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kill -9 is of POSIX")
def test_a_killed_run_resumes_to_the_same_bits(tmp_path):
    steps = str(200 * 20)
    environment = os.environ | {"JAX_PLATFORMS": "cpu"}

    def command(folder):
        return [sys.executable, "-c", PROGRAM, str(tmp_path / folder), steps]

    checkpoint = tmp_path / "killed" / "checkpoints" / "latest.safetensors"
    with subprocess.Popen(command("killed"), env=environment) as running:
        while not checkpoint.exists() and running.poll() is None:
            time.sleep(0.02)
        running.kill()
    assert running.returncode == -signal.SIGKILL
    assert not (tmp_path / "killed" / "model.safetensors").exists()
    for folder in ("killed", "whole"):
        subprocess.run(command(folder), env=environment, check=True)
    models = [load(tmp_path / run / "model.safetensors") for run in ("killed", "whole")]
    assert eqx.tree_equal(*models)


def test_nothing_is_written_without_a_folder(pendulum, small, quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fit(pendulum(), model=small, config=dataclasses.replace(quick, adam_steps=2, lm_steps=0))
    assert list(tmp_path.iterdir()) == []


def test_printed_progress_is_a_line_of_words():
    assert str(Progress("adam", 3, 10, 0.12345, 0.5, 2.4)) == "adam 3/10  loss 0.1235  validation 0.5  2 s"
    assert str(Progress("growth", 9, 9, 2e-6, None, 60.0, verdict="kept")) == "growth 9/9  loss 2e-06  kept  60 s"


def raising(error, *, when):
    """Progress that raises an error, and what it was told."""
    said = []

    def follow(now):
        said.append(now)
        if when(said):
            raise error
        return True  # As a progress bar may, which wants no end.

    return follow, said


def test_training_ends_when_progress_stops_with_the_best_model_so_far(pendulum, small, quick, tmp_path):
    run = functools.partial(fit, pendulum(), model=small, config=quick, members=2, folder=tmp_path, resume=True)
    follow, said = raising(StopIteration, when=lambda said: len(said) == 2)
    ended = run(progress=follow)
    assert len(said) == 2
    assert not ended.completed
    assert ended.ensemble is None
    assert ended.outcome.startswith("stopped by `progress` after ")
    follow, _ = raising(StopIteration, when=lambda said: said[-1].stage.startswith("model"))
    part = run(progress=follow)
    assert (part.outcome, part.completed) == ("stopped by `progress`, with members still to come", False)
    follow, said = raising(StopIteration, when=lambda _: False)
    assert run(progress=follow).completed
    assert said
    assert all(now.stage.startswith("model ") for now in said)


def test_an_interrupted_run_gives_the_model_of_its_last_stride(pendulum, small, quick, tmp_path):
    run = functools.partial(fit, pendulum(), model=small, config=quick, folder=tmp_path)
    follow, _ = raising(KeyboardInterrupt, when=lambda said: len(said) == 3)
    with pytest.raises(KeyboardInterrupt):
        run(progress=follow)
    follow, said = raising(StopIteration, when=lambda _: True)
    kept = run(resume=True, progress=follow)
    assert len(said) == 1
    assert "by `progress`" in kept.outcome


@pytest.mark.parametrize("minutes", [0.0, -1.0, float("nan")])
def test_a_time_limit_that_is_none_is_refused(pendulum, minutes):
    with pytest.raises(ValueError, match=r"`max_minutes` must be positive; got .*None is no limit"):
        fit(pendulum(), max_minutes=minutes)
