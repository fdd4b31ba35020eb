"""What the data of a run leave open is computed as its training was, once."""

import dataclasses

import jax
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.experiments import RunConfig, read_posterior, summarize
from symoden.models import BlockConfig, ModelConfig, build, save
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.training import MODEL, POSTERIOR, Laplace, TrainingConfig, infer_posterior

PLACE = "symoden.experiments._posteriors"
PLAIN = BlockConfig(constant=True)
SETTINGS = ModelConfig(inverse_mass=PLAIN, potential=BlockConfig(hidden=(2,)), actuation=PLAIN, friction=PLAIN)


def swing(speed=1.0):
    ts = 0.1 * np.arange(60)
    return Trajectory(
        name="swing", ts=ts, q=np.cos(speed * ts)[:, None], rates=-np.sin(speed * ts)[:, None], us=np.ones((60, 1))
    )


def read(*run):
    """What `read_posterior` finds in a run without members."""
    found = read_posterior(*run)
    assert isinstance(found, Laplace)
    return found


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Folder, model, settings and data of a run; and how many steps between samples each inference took."""
    taken = []

    def inferred(model, dataset, training, *, substeps):
        taken.append(substeps)
        return infer_posterior(model, dataset, training, substeps=substeps)

    monkeypatch.setattr(f"{PLACE}.infer_posterior", inferred)
    dataset = Dataset(name="swing", space="T1", train=(swing(),))
    model = build(SETTINGS, Space.parse("T1"), 1, key=jax.random.key(0))
    save(tmp_path / MODEL, model)
    config = RunConfig(
        source="pendulum", model=SETTINGS, training=TrainingConfig(lm_horizon=5), data=summarize(dataset)
    )
    return (tmp_path, model, config, dataset), taken


def test_bands_take_the_steps_that_training_settled_on(run):
    (folder, model, plain, dataset), taken = run
    finer = dataclasses.replace(plain, training=TrainingConfig(lm_horizon=5, lm_substeps=8))
    for config in (plain, dataclasses.replace(plain, substeps=2), finer):
        read(folder, model, config, dataset)
    assert taken == [1, 2, 8]


def test_it_is_inferred_once_for_a_model_its_data_and_its_settings(run):
    (folder, model, config, dataset), taken = run
    first, again = read(folder, model, config, dataset), read(folder, model, config, dataset)
    assert taken == [1]
    for name in ("theta", "factor", "windows", "effective"):
        assert np.array_equal(getattr(first, name), getattr(again, name)), name
    energy = lambda model: model.hamiltonian(jax.numpy.ones(1), jax.numpy.ones(1))[None]
    assert np.array_equal(first.project(energy), again.project(energy))

    others = dataclasses.replace(dataset, train=(swing(1.1),))
    assert not np.array_equal(read(folder, model, config, others).factor, first.factor)
    read(folder, model, config, dataset)
    other = build(SETTINGS, Space.parse("T1"), 1, key=jax.random.key(1))
    save(folder / MODEL, other)
    assert not np.array_equal(read(folder, other, config, dataset).theta, first.theta)
    assert len(taken) == 4


@pytest.mark.parametrize("harm", ["cut", "another file of symoden"])
def test_what_is_damaged_is_inferred_anew(run, harm):
    (folder, model, config, dataset), taken = run
    first = read(folder, model, config, dataset)
    path = folder / POSTERIOR
    path.write_bytes(path.read_bytes()[:-9] if harm == "cut" else (folder / MODEL).read_bytes())
    for _ in range(2):
        assert np.array_equal(read(folder, model, config, dataset).factor, first.factor)
    assert len(taken) == 2


def test_a_run_that_can_only_be_read_has_one_too(run, monkeypatch):
    (folder, model, config, dataset), taken = run

    def refuse(path, *_, **__):
        raise StorageError(f"`{path}` must be writable")

    monkeypatch.setattr(f"{PLACE}.save_laplace", refuse)
    for _ in range(2):
        assert read(folder, model, config, dataset).windows > 0
    assert len(taken) == 2
    assert not (folder / POSTERIOR).exists()
