"""A source is a task or the description of a data set."""

import numpy as np
import pytest

from symoden.data import DataError
from symoden.experiments import TASKS, absolute_name, read_source

DESCRIPTION = 'space = "T1"\ntime = "t"\npositions = ["q"]\nvelocities = ["v"]\n[train]\nfiles = ["a.csv"]\n'


@pytest.fixture
def described(tmp_path):
    t = 0.1 * np.arange(20)
    np.savetxt(tmp_path / "a.csv", np.stack([t, t, 0 * t + 1], 1), delimiter=",", header="t,q,v", comments="")
    path = tmp_path / "arm.toml"
    path.write_text(DESCRIPTION)
    return path


def test_a_task_comes_with_all_its_parts():
    source = read_source("pendulum", seed=3)
    assert source.task is TASKS["pendulum"]
    assert {name: len(part) for name, part in source.parts.items()} == {"train": 320, "test": 320, "prediction": 64}
    again = read_source("pendulum", seed=4)
    assert not np.array_equal(source.dataset.train[0].q, again.dataset.train[0].q)


def test_a_task_can_be_told_another_space_for_the_same_numbers():
    own, told = read_source("pendulum-canonical"), read_source("pendulum-canonical", space="T1")
    assert (own.dataset.space, told.dataset.space) == ("R1", "T1")
    for one, other in zip(own.dataset.recordings, told.dataset.recordings, strict=True):
        np.testing.assert_array_equal(one.q, other.q)


def test_a_description_is_named_by_its_absolute_path(described, monkeypatch):
    monkeypatch.chdir(described.parent)
    source = read_source("arm.toml")
    assert source.name == absolute_name("arm.toml") == str(described.resolve())
    assert source.task is None
    assert list(source.parts) == ["train"]


def test_what_is_neither_is_refused():
    with pytest.raises(ValueError, match=r"must be a task \(pendulum-canonical, .*\) or the file .*; got 'pendulm'"):
        read_source("pendulm")


def test_lengths_of_a_task_can_be_told_to_be_angles():
    assert read_source("cartpole", trajectories=2).dataset.position_units == ("m", "rad")
    assert read_source("cartpole", space="T2", trajectories=2).dataset.position_units == ("rad", "rad")


def test_a_space_of_another_size_is_refused(described):
    with pytest.raises(DataError, match="the space `T2` has 2 coordinates, the recordings have 1"):
        read_source("pendulum", space="T2")
    with pytest.raises(DataError, match="`R1 T1` has 2"):
        read_source(str(described), space="R1 T1")
