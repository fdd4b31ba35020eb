"""Single samples of an input that are far beyond all others are named, others are not."""

import numpy as np
import pytest

from symoden.data import check_dataset

from .conftest import arm, written


def spikes(folder, u):
    log = arm(samples=len(u))
    log[:, 5] = u
    (check,) = check_dataset(written(folder, log)).recordings
    return [one for one in check.findings if one.kind == "spike"]


def torque(seed, kind):
    """An input of 500 samples."""
    generator = np.random.default_rng(seed)
    k = np.arange(500)
    made = {
        "sine": 2 * np.sin(0.1 * k),
        "noise": generator.normal(size=500),
        "steps": np.repeat(generator.normal(size=25), 20),
        "counts": np.round(36 * np.sin(0.05 * k)) + 2048,
    }
    return made[kind]


@pytest.mark.parametrize("kind", ["sine", "noise", "steps", "counts"])
@pytest.mark.parametrize("rows", [[300], [40, 200, 333]])
def test_samples_far_beyond_all_others_are_named(tmp_path, kind, rows):
    u = torque(0, kind)
    u[rows] += 5 * np.ptp(u)
    (one,) = spikes(tmp_path, u)
    assert (one.level, one.channel, len(one.spans)) == ("warning", "u1", len(rows))
    assert ("one sample" if len(rows) == 1 else "3 single samples") in one.text


@pytest.mark.parametrize("kind", ["sine", "noise", "steps", "counts"])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_said_of_what_a_command_may_be(tmp_path, kind, seed):
    u = torque(seed, kind)
    assert spikes(tmp_path, u) == []
    u[100:110] += 5 * np.ptp(u)  # A pulse.
    assert spikes(tmp_path, u) == []
    u = torque(seed, kind)
    u[10::40] += 5 * np.ptp(u)  # Impulses at a rate.
    assert spikes(tmp_path, u) == []


@pytest.mark.parametrize("seed", range(3))
def test_impulses_on_nothing_at_all_are_commands(tmp_path, seed):
    u = np.zeros(500)
    u[[100, 300]] = 3.0
    assert spikes(tmp_path, u + 1e-15 * np.random.default_rng(seed).normal(size=500)) == []
