"""A run's settings come back as they were written, and nothing else is taken for them."""

import dataclasses
import json
import shutil

import jax
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.experiments import (
    RunConfig,
    TrainingSummary,
    evaluation_solver,
    read_model,
    read_run,
    read_run_source,
    summarize,
    train_run,
    write_run,
)
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, build, save
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.training import TrainingConfig

PLAIN = BlockConfig(constant=True)
SMALL = ModelConfig(inverse_mass=PLAIN, potential=BlockConfig(hidden=(4,)), actuation=PLAIN, friction=PLAIN, knees=())


def swing(name="swing", *, samples=30, size=1):
    ts = 0.1 * np.arange(samples)
    q = np.stack([np.cos(ts + i) for i in range(size)], axis=1)
    rates = np.stack([-np.sin(ts + i) for i in range(size)], axis=1)
    return Trajectory(name=name, ts=ts, q=q, rates=rates, us=np.ones((samples, 1)))


def settings(**changes):
    dataset = Dataset(name="swing", space="T1", train=(swing(),))
    training = TrainingConfig(adam_steps=3, lm_steps=0, clip=None)
    plain = {"source": "pendulum", "model": SMALL, "training": training, "data": summarize(dataset)}
    return RunConfig(**(plain | changes))


def changed(folder, change):
    path = folder / "config.json"
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def test_a_project_can_be_moved_with_its_runs(tmp_path):
    old, new, elsewhere = (tmp_path / name for name in ("old", "new", "elsewhere"))
    old.mkdir()
    (old / "arm.toml").write_text("")
    write_run(old / "runs" / "arm", settings(source=str(old / "arm.toml")))
    old.rename(new)
    moved = read_run(new / "runs" / "arm")
    assert moved.source == str((new / "arm.toml").resolve())
    old.mkdir()
    (old / "arm.toml").write_text("")  # What is where it was is not looked for.
    assert read_run(new / "runs" / "arm").source == str(old / "arm.toml")
    (old / "arm.toml").unlink()
    shutil.move(new / "runs", elsewhere)
    with pytest.raises(ValueError, match=r"old/arm.toml` must be the description .* as `source` into the run's config"):
        read_run_source(read_run(elsewhere / "arm"))


@pytest.mark.parametrize("kind", ["dissipative", "unstructured", "symoden", "naive", "geometric"])
def test_settings_come_back_as_they_were(tmp_path, kind):
    config = settings(model=ModelConfig(kind=kind), space="R1", seed=7, preset="paper")
    write_run(tmp_path / "run", config)
    assert read_run(str(tmp_path / "run")) == config


def test_versions_and_commit_are_kept(tmp_path):
    write_run(tmp_path, settings())
    kept = read_run(tmp_path)
    assert kept.versions["jax"] == jax.__version__
    assert kept.commit is None or len(kept.commit) == 40


def test_a_setting_added_later_takes_its_default(tmp_path):
    write_run(tmp_path, settings())
    changed(tmp_path, lambda value: value["training"].pop("patience"))
    assert read_run(tmp_path).training.patience == TrainingConfig().patience
    trained = TrainingSummary(outcome="converged", completed=True, seconds=1.0, verdicts={"growth": "not kept"})
    write_run(tmp_path, settings(trained=trained))
    changed(tmp_path, lambda value: value["trained"].pop("hardly_judged"))
    assert read_run(tmp_path).trained == trained


def misspelt(value):
    value["training"]["learning_rte"] = 1.0


def text_for_number(value):
    value["training"]["adam_steps"] = "many"


def fraction_for_count(value):
    value["training"]["adam_steps"] = 1.5


def truth_for_count(value):
    value["seed"] = True


def unknown_kind(value):
    value["model"]["kind"] = "magic"


def number_for_layers(value):
    value["model"]["potential"]["hidden"] = 4


def without_data(value):
    del value["data"]


def negative_count(value):
    value["training"]["batch_size"] = 0


def one_bound(value):
    value["data"]["ranges"]["rates"] = [[1.0]]


REFUSED = {
    misspelt: r"config.json`, `training` has no key `learning_rte`",
    text_for_number: r"`training`, `adam_steps` must be int; got 'many'",
    fraction_for_count: r"`adam_steps` must be int; got 1.5",
    truth_for_count: r"`seed` must be int; got True",
    unknown_kind: r"`kind` must be .*dissipative.*; got 'magic'",
    number_for_layers: r"`potential`, `hidden` must be tuple.*; got 4",
    without_data: r"must have the key `data`",
    negative_count: r"`batch_size` must be a whole number of at least 1; got 0",
    one_bound: r"`ranges`, `rates` must be tuple\[float, float\]; got \[1.0\]",
}


@pytest.mark.parametrize("change", REFUSED, ids=lambda change: change.__name__)
def test_settings_that_are_no_settings_are_refused(tmp_path, change):
    write_run(tmp_path, settings())
    changed(tmp_path, change)
    with pytest.raises(StorageError, match=REFUSED[change]):
        read_run(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00", '{"source": NaN}'])
def test_a_damaged_config_is_refused(tmp_path, text):
    (tmp_path / "config.json").write_text(text)
    with pytest.raises(StorageError, match=r"config\.json"):
        read_run(tmp_path)


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(StorageError, match="must be the folder of a run"):
        read_run(tmp_path)


def test_a_run_without_its_model_says_that_training_did_not_end(tmp_path):
    write_run(tmp_path, settings())
    with pytest.raises(StorageError, match=r"Its training did not end; go on with: symoden train --out \S+ --resume"):
        read_model(tmp_path)
    save(tmp_path / "model.safetensors", build(SMALL, Space.parse("T1"), 1, key=jax.random.key(0)))
    assert read_model(tmp_path).inputs == 1


@pytest.mark.parametrize("read", [read_run, read_model])
def test_what_an_interrupted_fit_has_left_is_told_from_other_folders(read, tmp_path):
    (tmp_path / "checkpoints").mkdir()
    with pytest.raises(StorageError, match=r"`symoden\.fit` was interrupted there .* goes on with `resume=True`"):
        read(tmp_path)


def test_training_never_overwrites_what_is_there(tmp_path):
    (tmp_path / "precious.txt").write_text("data")
    with pytest.raises(ValueError, match="must be empty, absent or the folder of a run"):
        train_run(tmp_path, settings(), Dataset(name="swing", space="T1", train=(swing(),)))
    with pytest.raises(ValueError, match="must be empty, absent or the folder of a run"):
        train_run(tmp_path / "precious.txt", settings(), Dataset(name="swing", space="T1", train=(swing(),)))
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_rollouts_are_at_least_as_fine_as_in_training():
    assert evaluation_solver(settings()).substeps == 4
    assert evaluation_solver(settings(training=TrainingConfig(lm_substeps=8))).substeps == 8
    assert evaluation_solver(settings(substeps=16)).substeps == 16


def test_other_data_must_be_of_the_same_mechanism():
    config = settings(source="pendulum", data=dataclasses.replace(settings().data, input_names=("u",)))
    assert read_run_source(config).name == "pendulum"
    with pytest.raises(ValueError, match="must have the space of the run, `T1`; got `R1 T1`"):
        read_run_source(config, "cartpole")
    momenta = dataclasses.replace(config, data=dataclasses.replace(config.data, momenta=True))
    with pytest.raises(ValueError, match="1 and momenta; got 1 and velocities"):
        read_run_source(dataclasses.replace(momenta, source="cartpole"), "pendulum")


def test_a_run_that_was_told_its_space_reads_other_data_so():
    data = dataclasses.replace(settings().data, momenta=True)
    told = settings(source="arm.toml", space="T1", data=data)
    assert read_run_source(told, "pendulum-canonical").dataset.space == "T1"


DRIVEN = Dataset(name="d", space="T1", train=(swing(), swing(samples=31)), input_matrix=np.eye(1))


def test_a_run_keeps_what_its_coordinates_are_measured_in(tmp_path):
    data = summarize(dataclasses.replace(DRIVEN, space="R1", position_units=("rad",)))
    write_run(tmp_path, settings(data=data))
    assert read_run(tmp_path).data.position_units == ("rad",)
    changed(tmp_path, lambda value: value["data"].pop("position_units"))  # As of runs from before this was kept.
    assert read_run(tmp_path).data.position_units == ("",)
    changed(tmp_path, lambda value: value["data"].update(position_units=["km"]))
    with pytest.raises(StorageError, match=r"`data`: `position_units` must be .* got \('km',\)"):
        read_run(tmp_path)


def test_a_run_keeps_how_far_apart_rows_are(tmp_path):
    write_run(tmp_path, settings())
    assert read_run(tmp_path).data.step == pytest.approx(0.1)
    changed(tmp_path, lambda value: value["data"].pop("step"))  # As of runs from before this was kept.
    assert read_run(tmp_path).data.step == 0.0


def told(**more):
    return dataclasses.replace(DRIVEN, train=tuple(dataclasses.replace(each, **more) for each in DRIVEN.train))


OTHERS = {
    "a piece": dataclasses.replace(DRIVEN, train=(swing("a#1"), swing("a#2", samples=31))),
    "first samples": told(initial_samples=5),
    "estimated rates": told(noise_gain=30.0),
    "their ends": told(one_sided=0.1),
    "length": dataclasses.replace(DRIVEN, train=(swing(), swing(samples=32))),
    "part": dataclasses.replace(DRIVEN, train=DRIVEN.train[:1], test=DRIVEN.train[1:]),
    "space": dataclasses.replace(DRIVEN, space="R1"),
    "momenta": dataclasses.replace(DRIVEN, momenta=True),
    "hold": dataclasses.replace(DRIVEN, hold="linear"),
    "gain": dataclasses.replace(DRIVEN, input_matrix=-3 * np.eye(1)),
    "no gain": dataclasses.replace(DRIVEN, input_matrix=None),
    "known": dataclasses.replace(DRIVEN, known=KnownParts(potential_energy="cos(q1)")),
}


@pytest.mark.parametrize("name", OTHERS)
def test_the_digest_tells_data_apart(name):
    other = OTHERS[name]
    assert dataclasses.replace(DRIVEN, name="e").digest == summarize(DRIVEN).digest
    assert other.digest != DRIVEN.digest


def test_what_recordings_are_called_does_not_count_but_for_what_are_pieces_of_one():
    named = {
        names: dataclasses.replace(DRIVEN, train=tuple(swing(name, samples=30 + k) for k, name in enumerate(names)))
        for names in (("a", "b"), ("x", "y"), ("a#1", "a#2"), ("x#1", "x#2"), ("a#1", "b#1"))
    }
    digests = [each.digest for each in named.values()]
    assert digests[0] == digests[1] != digests[2]
    assert digests[2] == digests[3] != digests[4]


def test_a_run_keeps_which_coordinates_are_cyclic():
    ranges = summarize(dataclasses.replace(DRIVEN, known=KnownParts(cyclic=("q1",)))).ranges
    assert ranges.cyclic == (0,)
    assert ranges.outside(np.full((1, 1), np.nan), DRIVEN.train[0].rates[:1], None, Space.parse("T1")).all()
