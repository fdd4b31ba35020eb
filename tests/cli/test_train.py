"""Training through the command line: what it prints and leaves behind, and how it goes on."""

import dataclasses
import json
import shlex
import shutil

import equinox as eqx
import numpy as np
import pytest

from symoden.cli import _train, main
from symoden.experiments import read_model, read_run
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig

PLAIN = BlockConfig(constant=True)


def tiny(name, *, task, kind):
    """Settings that train in a moment, whatever is asked for."""
    del name, task
    model = ModelConfig(
        kind=kind,
        inverse_mass=PLAIN,
        potential=BlockConfig(hidden=(4,)),
        actuation=PLAIN,
        friction=PLAIN,
        knees=(),
        flow=(4,),
        energy=(4,),
    )
    lm_steps = 2 if kind == "dissipative" else 0
    return model, TrainingConfig(
        adam_steps=20, lm_steps=lm_steps, lm_substeps=2, growth_steps=0, relevance_steps=0, batch_size=32
    )


def same_weights(one, other):
    """Whether two runs have the same model, bit for bit."""
    return bool(eqx.tree_equal(read_model(one), read_model(other)))


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr("symoden.cli._train.preset", tiny)


@pytest.fixture(scope="module")
def trained(tmp_path_factory, arm):
    """A finished run; not to be written to."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("symoden.cli._train.preset", tiny)
        assert main(["train", str(arm), "--out", str(folder)]) == 0
    return folder


@pytest.mark.parametrize(
    ("space", "kind", "given", "named"),
    [
        ("T6", "dissipative", (), True),
        ("R3 T3", "dissipative", (), False),
        ("T6", "unstructured", (), False),
        ("T6", "dissipative", ("mass_matrix", "potential_energy"), False),
        ("T6", "symoden", ("potential_energy",), True),
    ],
)
def test_many_joints_of_which_nothing_is_known_are_named(space, kind, given, named, capsys):
    _train._name_many_joints(kind, space, given)
    assert ("A URDF says how they are joined" in capsys.readouterr().err) == named


def test_a_run_holds_what_the_contract_says(trained, arm):
    assert sorted(path.name for path in trained.iterdir()) == [
        "checkpoints",
        "config.json",
        "metrics.jsonl",
        "model.safetensors",
    ]
    config = read_run(trained)
    assert (config.source, config.seed, config.preset, config.model.kind) == (str(arm), 0, "default", "dissipative")
    assert config.training.adam_steps == 20
    assert config.substeps == 2
    assert config.trained is not None
    assert (config.trained.outcome, config.trained.completed) == ("all steps taken", True)
    assert [json.loads(line)["stage"] for line in (trained / "metrics.jsonl").read_text().splitlines()]
    assert read_model(trained).inputs == 1


def test_train_says_what_it_does_and_how_well_it_did(arm, tmp_path, capsys):
    assert main(["train", str(arm), "--out", str(tmp_path / "run"), "--seed", "2", "--model", "symoden"]) == 0
    printed = capsys.readouterr()
    first, *progress, poor = printed.err.splitlines()
    assert poor.startswith("warning: over 1 s predictions are off by")  # Of a model without friction, after few steps.
    assert "symoden model" in first
    assert "seed 2" in first
    assert progress
    assert all("loss" in line for line in progress)
    assert "\x1b" not in printed.err + printed.out
    assert "1 s median" in printed.out
    assert "parameters" in printed.out
    assert f"the run is in {tmp_path / 'run'}" in printed.out.splitlines()[-1]


def test_training_is_told_to_keep_what_is_disturbed(arm, trained, tmp_path, capsys):
    assert main(["train", str(arm), "--out", str(tmp_path / "run"), "--keep-disturbed"]) == 0
    assert read_run(tmp_path / "run").training.left_out == ()
    assert main(["train", "--out", str(tmp_path / "run"), "--keep-disturbed", "--resume"]) == 0
    capsys.readouterr()
    assert main(["train", "--out", str(trained), "--keep-disturbed", "--resume"]) == 2
    assert "`--keep-disturbed` must be that of the run" in capsys.readouterr().err


def test_train_gives_one_object_with_the_scores(tmp_path, capsys):
    words = [
        "train",
        "pendulum-canonical",
        "--space",
        "T1",
        "--out",
        str(tmp_path / "run"),
        "--model",
        "naive",
        "--json",
    ]
    assert main(words) == 0
    (line,) = capsys.readouterr().out.splitlines()
    answer = json.loads(line)
    assert (answer["task"], answer["completed"]) == ("pendulum-canonical", True)
    assert answer["prediction_error"]["mean"] > 0
    assert main(["evaluate", str(tmp_path / "run"), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores == {key: answer[key] for key in scores}


def test_a_model_that_explains_little_is_called_so(arm, tmp_path, capsys, monkeypatch):
    for k, (bound, good, said) in enumerate([(0.0, 0.0, True), (1e9, 0.0, False), (0.0, 1e9, False)]):
        monkeypatch.setattr(_train, "_POOR", bound)
        monkeypatch.setattr(_train, "_GOOD", good)  # Of predictions, which count more than a few windows.
        assert main(["train", str(arm), "--out", str(tmp_path / f"{k}")]) == 0
        assert ("is much of the motion" in capsys.readouterr().err) == said


def test_fewer_and_noisy_trajectories_stay_with_the_run(tmp_path, capsys):
    words = ["train", "pendulum", "--out", str(tmp_path / "run"), "--trajectories", "7", "--noise", "0.1"]
    assert main([*words, "--model", "symoden"]) == 0
    assert "7 recordings" in capsys.readouterr().err
    config = read_run(tmp_path / "run")
    assert (config.trajectories, config.noise) == (7, 0.1)
    assert main([*words, "--resume", "--max-minutes", "1e-9"]) == 0
    assert main([*words[:-1], "0.2", "--resume"]) == 2
    assert "`--noise` must be that of the run" in capsys.readouterr().err


def test_a_resumed_run_ends_as_one_that_was_never_stopped(trained, arm, tmp_path, capsys):
    words = ["train", str(arm), "--out", str(tmp_path / "run")]
    assert main([*words, "--max-minutes", "1e-9"]) == 0
    assert "stopped at the time limit" in capsys.readouterr().out
    assert main(["evaluate", str(tmp_path / "run")]) == 0
    assert "not all of training is done: stopped at the time limit" in capsys.readouterr().err
    assert (tmp_path / "run" / "model.safetensors").is_file()
    assert main(["train", "--out", str(tmp_path / "run"), "--resume"]) == 0
    assert same_weights(trained, tmp_path / "run")


def test_what_came_of_a_run_stays_where_its_log_is_removed(arm, tmp_path, monkeypatch):
    model, training = tiny("default", task=None, kind="dissipative")
    judged = dataclasses.replace(training, adam_steps=2, relevance_steps=1)
    monkeypatch.setattr("symoden.cli._train.preset", lambda name, *, task, kind: (model, judged))
    run = tmp_path / "run"
    assert main(["train", str(arm), "--out", str(run)]) == 0
    before = read_run(run).trained
    assert before is not None
    assert before.verdicts
    (run / "metrics.jsonl").unlink()
    assert main(["train", "--out", str(run), "--resume"]) == 0
    after = read_run(run).trained
    assert after is not None
    assert dataclasses.replace(after, seconds=before.seconds) == before


def test_members_join_a_run_that_has_ended_and_make_its_bands(trained, arm, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("symoden.training._ensemble._ASTRAY", 1e9)  # So few steps do not reach the model's basin.
    run = tmp_path / "run"
    shutil.copytree(trained, run)
    words = ["train", str(arm), "--out", str(run), "--resume"]
    assert main([*words, "--members", "1"]) == 2
    assert "at least 2" in capsys.readouterr().err
    assert main([*words, "--members", "2"]) == 0
    assert "2 models from other initial weights" in capsys.readouterr().out
    assert same_weights(run, trained)
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["members"] == 2
    assert main(["inspect", str(run)]) == 0
    assert "from 2 models from other initial weights" in " ".join(capsys.readouterr().out.split())
    assert main(["evaluate", str(run), "--bands"]) == 0
    assert "90% bands" in capsys.readouterr().out
    assert main(["predict", str(run), str(arm), "--out", str(tmp_path / "paths.npz"), "--bands"]) == 0
    with np.load(tmp_path / "paths.npz") as file:
        assert np.isfinite(file["test:b/q_half_width"][:20]).all()


def test_resuming_where_nothing_is_starts_a_run(trained, arm, tmp_path, capsys):
    assert main(["train", str(arm), "--out", str(tmp_path / "run"), "--resume"]) == 0
    assert "holds no run yet" in capsys.readouterr().err
    assert same_weights(trained, tmp_path / "run")


def test_an_interrupted_run_goes_on_by_the_command_that_is_advised(trained, arm, tmp_path, capsys, monkeypatch):
    def interrupt(dataset, **options):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("symoden.experiments._runs.fit", interrupt)
        assert main(["train", str(arm), "--out", str(tmp_path / "run 1")]) == 130
    _, _, advised = capsys.readouterr().err.splitlines()[-1].partition("continue with: symoden ")
    assert main(shlex.split(advised)) == 0
    assert same_weights(trained, tmp_path / "run 1")


def test_a_unit_that_is_told_later_joins_a_run(described, tmp_path):
    text, run = described.read_text().replace("T1", "R1"), tmp_path / "run"
    described.write_text(text)
    words = ["train", str(described), "--out", str(run), "--max-minutes", "1e-9"]
    assert main(words) == 0
    assert read_run(run).data.position_units == ("",)
    described.write_text(text.replace('"R1"', '"R1"\nunits = { q = "rad" }'))  # The numbers stay as they were.
    assert main([*words, "--resume"]) == 0
    assert read_run(run).data.position_units == ("rad",)


def test_the_space_of_a_run_stays_with_it(arm, tmp_path):
    folder = tmp_path / "run"
    assert main(["train", str(arm), "--space", "R1", "--out", str(folder), "--max-minutes", "1e-9"]) == 0
    assert str(read_model(folder).space) == "R1"
    assert main(["evaluate", str(folder)]) == 0
    assert main(["predict", str(folder), str(arm), "--out", str(tmp_path / "paths.npz")]) == 0
    with np.load(tmp_path / "paths.npz") as file:
        assert file["train:a/q_predicted"].shape == (80, 1)


def test_parameters_that_ran_to_zero_are_named_with_what_keeps_them_there(capsys):
    starts = {"k": -0.15, "m": 2.0, "free": 0.0, "rotor": 1.0}
    _train._name_vanished(starts, {"k": -0.002, "m": 0.4, "free": 1e-9})
    said = capsys.readouterr().err
    assert "`k` (-0.002 from -0.15). Where the other sign is possible, start at 0" in said
    assert not any(f"`{name}`" in said for name in ("m", "free", "rotor"))
    _train._name_vanished(starts, starts)
    assert capsys.readouterr().err == ""
