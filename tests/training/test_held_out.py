"""What training learns from, and what it chooses by."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import Dataset, Trajectory, read_dataset
from symoden.training import TrainingConfig, hold_out

TEXT = """
space = "T1"
time = "t"
positions = ["q"]
{more}
[train]
files = ["a.csv"]
[validation]
files = ["b.csv"]
"""


def read(folder, *, samples, more=""):
    """A slow swing with noisy positions, from which fits over many samples make velocities."""
    ts = 0.01 * np.arange(samples)
    for k, name in enumerate("ab"):
        q = 0.3 * np.sin(2 * ts + k) + 1e-3 * np.random.default_rng(k).normal(size=samples)
        table = np.stack([ts, q, 0.6 * np.cos(2 * ts + k)], axis=1)
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t,q,v", comments="", fmt="%.17g")
    (folder / "swing.toml").write_text(TEXT.format(more=more))
    return read_dataset(folder / "swing.toml")


def test_ends_whose_velocities_see_one_side_are_not_learned_from(tmp_path):
    dataset = read(tmp_path, samples=3000)
    held = hold_out(dataset, TrainingConfig())
    (whole,), (inner,) = dataset.train, held.train
    edge = round(whole.one_sided / 0.01)
    assert edge > 10
    assert held.validation == dataset.validation
    np.testing.assert_array_equal(inner.ts, whole.ts[edge:-edge])
    np.testing.assert_array_equal(inner.rates, whole.rates[edge:-edge])
    off = np.abs(whole.rates[:, 0] - 0.6 * np.cos(2 * whole.ts))
    assert np.mean(off[:3] ** 2) > 4 * np.mean(off[edge:-edge] ** 2)


@given(samples=st.integers(300, 900), edge=st.integers(0, 40))
def test_a_twentieth_of_a_recording_is_left_out_at_most(samples, edge):
    ts = 0.01 * np.arange(samples)
    run = Trajectory(
        name="run", ts=ts, q=ts[:, None], rates=0 * ts[:, None], us=np.zeros((samples, 0)), one_sided=0.01 * edge
    )
    dataset = Dataset(name="run", space="R1", train=(run,))
    for _ in range(2):  # What was held out once is not cut again.
        dataset = hold_out(dataset, TrainingConfig(validation=0.0))
        assert samples - len(dataset.train[0]) == (2 * edge if 2 * edge <= 0.05 * samples else 0)


@pytest.mark.parametrize("more", ['velocities = ["v"]\ntrust_velocities = true', ""])
def test_measured_velocities_are_good_to_the_ends(tmp_path, more):
    dataset = read(tmp_path, samples=3000, more=more)
    assert (dataset.train[0].one_sided > 0) == (not more)
