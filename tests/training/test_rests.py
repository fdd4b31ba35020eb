"""What stands still for long is a small part of what training sees, in every stage."""

import dataclasses

import jax
import numpy as np
import pytest

from symoden.data import Trajectory
from symoden.models import build
from symoden.spaces import Space
from symoden.training import TrainingConfig
from symoden.training._data import adam_data, hold_out, levenberg_data, longer_data, regression_data


@pytest.fixture(scope="module")
def rested(pendulum):
    """Recordings that end in a rest four times as long as their motion, seen by an encoder."""

    def rest(recording):
        after = 4 * len(recording)
        ts = recording.ts[-1] + 0.05 * np.arange(1, after + 1)
        held = np.broadcast_to(recording.q[-1:], (after, 1))
        return Trajectory(
            name=recording.name,
            ts=np.concatenate([recording.ts, ts]),
            q=np.round(np.concatenate([recording.q, held]), 3),
            rates=np.concatenate([recording.rates, np.zeros((after, 1))]),
            us=np.concatenate([recording.us, np.zeros((after, 1))]),
        )

    dataset = pendulum(samples=400, count=4)
    return dataclasses.replace(dataset, train=tuple(map(rest, dataset.train)))


def count_at_rest(windows):
    return int(np.sum(np.ptp(np.asarray(windows.q), axis=1) < 0.003))


@pytest.mark.parametrize("cut", [adam_data, levenberg_data, regression_data, longer_data])
def test_few_windows_are_of_rests(rested, plain, cut):
    config = TrainingConfig(validation=0.3)
    dataset = hold_out(rested, config)
    model = build(plain, Space.parse("T1"), 1, key=jax.random.key(0))
    if cut is longer_data:
        found = longer_data(dataset, model, levenberg_data(dataset, model, config), config)
        assert found
    else:
        found = [cut(dataset, model, config)]
    for data in found:
        for windows in (data.train, data.held_out):
            rests, count = count_at_rest(windows), len(windows.q)
            assert count > 4
            assert 0 < rests <= max(1, (count - rests) // 9)
