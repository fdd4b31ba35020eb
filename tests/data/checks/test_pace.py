"""A swing that is sampled far faster than it moves, or too slowly, is said to be."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import Dataset, Trajectory
from symoden.data.checks._pace import find_fast_sampling, find_finer_sampling, find_slow_sampling
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


def estimated(data):
    """The same with rates that count as estimated ones."""
    (run,) = data.train
    return dataclasses.replace(data, train=(dataclasses.replace(run, noise_gain=1.0),))


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


@settings(max_examples=20)
@given(frequency=st.floats(0.5, 100), samples=st.floats(4, 40))
def test_few_rows_in_a_period_are_told(frequency, samples):
    data = estimated(swing(2 * np.pi * frequency, 1 / (frequency * samples), samples=2_000))
    found = find_slow_sampling(data, TURNS)
    assert len(found) == (samples < 12.4) or 12.2 < samples < 12.6
    assert all((one.kind, one.level) == ("time", "warning") for one in found)


@pytest.mark.parametrize(("samples", "told"), [(10, True), (12, True), (13, False), (15, False)])
def test_twelve_rows_in_a_period_are_enough(samples, told):
    assert bool(find_slow_sampling(estimated(swing(2 * np.pi, 1 / samples, samples=2_000)), TURNS)) == told


def test_of_measured_velocities_nothing_is_said():
    data = swing(10, 0.1, samples=2_000)
    assert find_slow_sampling(data, TURNS) == []
    (one,) = find_slow_sampling(estimated(data), TURNS)
    assert "estimated too small" in one.advice


def test_nothing_is_too_slow_for_what_is_absent_or_rests():
    assert find_slow_sampling(Dataset(name="none", space="T2", train=(), test=swing(3, 0.001).train), TURNS) == []
    assert find_slow_sampling(estimated(swing(0, 0.001)), TURNS) == []


def test_rows_that_resample_makes_sparse_are_not_the_loggers():
    data = estimated(swing(10, 0.1, samples=2_000))
    (one,) = find_slow_sampling(data, TURNS, resample=0.1, logged=0.001)
    assert one.text.endswith("rows are 0.1 s apart by `resample`")
    assert one.advice.startswith("Take a smaller `resample`: those of the logs are 0.001 s apart, or move slower: ")
    for resample in (None, 0.1):
        (one,) = find_slow_sampling(data, TURNS, resample=resample, logged=0.1)
        assert one.text.endswith("rows are 0.1 s apart")
        assert one.advice.startswith("Log faster, or move slower: ")


@pytest.mark.parametrize(
    ("resample", "told"), [(None, False), (0.01, False), (0.007, False), (0.005, True), (0.1, False)]
)
def test_rows_between_those_of_the_logs_are_named(resample, told):
    found = find_finer_sampling(resample=resample, logged=0.01)
    assert [one.text[:50] for one in found] == ["`resample = 0.005` makes 2 rows of each one of the"] * told
