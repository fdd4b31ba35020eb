"""A small data set, and a run of an untrained model on it, made once."""

import jax
import numpy as np
import pytest

from symoden.experiments import RunConfig, read_source, summarize, write_run
from symoden.models import BlockConfig, ModelConfig, build, save
from symoden.spaces import Space
from symoden.training import TrainingConfig

PLAIN = BlockConfig(constant=True)
SMALL = ModelConfig(
    inverse_mass=PLAIN, potential=BlockConfig(hidden=(4,)), actuation=PLAIN, friction=PLAIN, knees=(), flow=(4,)
)
DESCRIPTION = """
space = "T1"
time = "t"
positions = ["q"]
velocities = ["v"]
inputs = ["u"]
input_matrix = [[1]]
[train]
files = ["a.csv"]
[test]
files = ["b.csv"]
"""


def write_recording(path, *, phase=0.0, samples=80):
    t = 0.05 * np.arange(samples)
    columns = np.stack([t, np.sin(2 * t + phase), 2 * np.cos(2 * t + phase), np.sin(9 * t)], axis=1)
    np.savetxt(path, columns, delimiter=",", header="t,q,v,u", comments="", fmt="%.17g")


def write_description(folder):
    write_recording(folder / "a.csv")
    write_recording(folder / "b.csv", phase=1.0, samples=60)
    path = folder / "arm.toml"
    path.write_text(DESCRIPTION)
    return path


def write_untrained_run(folder, name, model=SMALL, **changes):
    source = read_source(str(name))
    config = RunConfig(
        source=source.name, model=model, training=TrainingConfig(), data=summarize(source.dataset), **changes
    )
    data = source.dataset
    built = build(
        model,
        Space.parse(data.space),
        data.inputs,
        momenta=data.momenta,
        input_matrix=data.input_matrix,
        known=data.known,
        key=jax.random.key(0),
    )
    write_run(folder, config)
    save(folder / "model.safetensors", built)
    return folder


@pytest.fixture
def described(tmp_path):
    return write_description(tmp_path)


@pytest.fixture(scope="session")
def arm(tmp_path_factory):
    """Description of a data set; not to be written to."""
    return write_description(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="session")
def arm_run(tmp_path_factory, arm):
    """Run on the data set; not to be written to."""
    return write_untrained_run(tmp_path_factory.mktemp("runs") / "arm", arm)


@pytest.fixture(scope="session")
def task_run(tmp_path_factory):
    """Run on task 2; not to be written to."""
    return write_untrained_run(tmp_path_factory.mktemp("runs") / "pendulum", "pendulum")
