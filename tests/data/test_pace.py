"""A swing that is sampled far faster than it moves is said to be, with the step that is enough."""

import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import Dataset, Trajectory
from symoden.data._pace import find_fast_sampling
from symoden.spaces import Space
from symoden.training import time_scale

TURNS = np.array([True, True])


def swing(frequency, step, *, samples=30_000, noise=0.0):
    rng = np.random.default_rng(0)
    ts = step * np.arange(samples)
    q = np.stack([np.sin(frequency * ts), 0 * ts], axis=1)
    v = np.stack([frequency * np.cos(frequency * ts), 0 * ts], axis=1) + noise * rng.normal(size=(samples, 2))
    run = Trajectory(name="run", ts=ts, q=q, rates=v, us=q[:, :1])
    return Dataset(name="arm", space="T2", train=(run,))


def test_a_slow_swing_at_1000_hertz_is_told_the_step_that_is_enough():
    (finding,) = find_fast_sampling(swing(3, 0.001), TURNS)
    assert (finding.kind, finding.level) == ("time", "note")
    assert "about 10 times as fast as the motion needs" in finding.text
    assert finding.advice.startswith("`resample = 0.01` ")
    assert finding.advice.endswith("about 10 times as fast.")


@settings(max_examples=20)
@given(frequency=st.floats(1, 20), samples=st.floats(80, 500))
def test_the_advised_step_leaves_samples_enough_and_is_advised_once(frequency, samples):
    data = swing(frequency, 1 / (frequency * samples))
    (finding,) = find_fast_sampling(data, TURNS)
    (step,) = map(float, re.findall(r"resample = (\S+)`", finding.advice))
    assert 20 <= time_scale(data.train, Space.parse(data.space)) / step <= 80
    assert find_fast_sampling(swing(frequency, step), TURNS) == []


@pytest.mark.parametrize(
    "data",
    [
        swing(3, 0.001, samples=20_000),
        swing(8, 0.01),
        swing(3, 0.001, noise=2.0),
        Dataset(name="none", space="T2", train=(), test=swing(3, 0.001).train),
    ],
    ids=["few", "fast", "noisy", "none"],
)
def test_what_is_short_fast_noisy_or_absent_is_not(data):
    assert find_fast_sampling(data, TURNS) == []


def test_a_machine_at_rest_is_not():
    assert find_fast_sampling(swing(0, 0.001), TURNS) == []
