"""Inputs whose work takes out what friction would have to give are named, others are not."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from symoden.data import Dataset, DataWarning, Trajectory, check_dataset, read_dataset
from symoden.data.description import Description
from symoden.data.dynamics._input_work import _Work, find_input_work
from symoden.data.signals._lag import lag_inputs

STEP, FINE = 0.01, 10


def arm(seed, *, samples=3000, friction=3.0, viscous=0.5, lag=0.0, waves=False):
    """Two coupled joints under gravity, one an angle, with dry friction and random steps, or waves, of their inputs.

    Returns:
        The recording of what was commanded, and the true g.
    """
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2))
    inertia = 0.2 * (root @ root.T) + 0.3 * np.eye(2)
    g = np.diag(rng.uniform(0.5, 2.0, 2) * rng.choice([-1, 1], 2))
    rows = np.repeat(rng.uniform(-6, 6, (samples // 40 + 1, 2)), 40, axis=0)[:samples]
    ts = STEP * np.arange(samples)
    if waves:
        rows = 6 * np.sin(ts[:, None] * rng.uniform(3, 6, 2) + rng.uniform(0, 6, 2))
    log = Trajectory(name="run", ts=ts, q=np.zeros((samples, 2)), rates=np.zeros((samples, 2)), us=rows)
    acts = lag_inputs(log, (lag,), hold="zero").us if lag else rows
    acts = np.concatenate([rows[: samples - len(acts)], acts])
    inverse, q, v, states = np.linalg.inv(inertia), np.zeros(2), np.zeros(2), np.zeros((samples, 4))
    for k in range(samples):
        states[k] = np.concatenate([q, v])
        for _ in range(FINE):
            force = g @ acts[k] - [2 * q[0], 2 * np.sin(q[1])] - friction * np.tanh(v / 0.02) - viscous * v
            v = v + STEP / FINE * inverse @ force
            q = q + STEP / FINE * v
    q, v = np.split(states + rng.normal(0, 5e-4, states.shape) * [1, 1, 4, 4], 2, axis=1)
    return Trajectory(name="run", ts=ts, q=q, rates=v, us=rows), g


def said(recording, g, *, momenta=False):
    data = Dataset(
        name="arm", space="R1 T1", train=(recording,), input_matrix=g, input_names=("u", "w"), momenta=momenta
    )
    description = Description(path=Path("arm.toml"), space="R1 T1", positions=())
    return find_input_work(data, description, np.array([False, True]))


def test_inputs_of_the_wrong_sign_are_named_and_others_are_not():
    missed = []
    for seed in range(8):
        recording, g = arm(seed)
        assert said(recording, g) == []
        for signs, named in (((-1, 1), "u"), ((1, -1), "w"), ((-1, -1), "")):
            found = said(recording, g * signs)
            missed.extend([(seed, signs)] * (not found))
            for one in found:
                assert (one.kind, one.level, one.channel) == ("sign", "warning", named)
                assert all((f"{name} = -1" in one.advice) == (sign < 0) for name, sign in zip("uw", signs, strict=True))
    assert len(missed) <= 2  # Of 24.


def test_the_worst_coordinate_is_named():
    recording, g = arm(3)
    (one,) = said(recording, -g)
    assert "of `q2` were negative" in one.text


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
def test_where_lengths_are_counted_from_does_not_matter(offset):
    recording, g = arm(1)
    moved = dataclasses.replace(recording, q=recording.q + np.array([offset, 0.0]))
    assert said(moved, g) == []
    (here,), (there,) = said(recording, -g), said(moved, -g)
    assert here == there


def test_an_offset_of_an_input_is_no_wrong_sign():
    """A wheel that turns one way: the offset's work goes with the angle."""
    rng = np.random.default_rng(0)
    ts = STEP * np.arange(6000)
    v = 0.5 + 0.2 * np.sin(0.5 * ts)
    q = np.cumsum(v) * STEP
    u = 0.02 * v - 0.1 + rng.normal(0, 0.05, len(ts))
    log = Trajectory(name="run", ts=ts, q=q[:, None], rates=v[:, None] + rng.normal(0, 0.01, (6000, 1)), us=u[:, None])
    data = Dataset(name="wheel", space="T1", train=(log,), input_matrix=np.eye(1))
    description = Description(path=Path("wheel.toml"), space="T1", positions=())
    assert find_input_work(data, description, np.array([True])) == []


@pytest.mark.parametrize("seed", range(4))
def test_a_lag_is_no_wrong_sign(seed):
    """It leaves a friction below zero, but a kinetic energy above."""
    recording, g = arm(seed, lag=0.1, friction=0.05, viscous=0.3, waves=True)
    data = Dataset(name="arm", space="R1 T1", train=(recording,), input_matrix=g)
    kinetic, friction = _Work.of(data, g, np.array([False, True])).told((1, 1)).whole
    assert kinetic.min() > 4
    assert friction.min() < -3
    assert said(recording, g) == []


def test_what_tells_nothing_is_not_looked_at():
    recording, g = arm(0)
    assert said(recording, -g) != []
    assert said(recording, None) == []  # The sign of a g that is learned is free.
    assert said(recording, -g, momenta=True) == []
    assert said(recording.cut(0, 150, name="run"), -g) == []


def test_a_short_log_of_a_geared_arm_is_warned_of(tmp_path):
    """Too short for a regression of accelerations."""
    recording, g = arm(1, samples=500)
    rows = np.column_stack([recording.ts, recording.q, recording.rates, recording.us])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,x,q,vx,vq,u,w", comments="")
    file = tmp_path / "run.toml"
    text = 'space = "R1 T1"\ntime = "t"\npositions = ["x", "q"]\nvelocities = ["vx", "vq"]\ninputs = ["u", "w"]\n'
    text += '[train]\nfiles = ["run.csv"]\n'
    for matrix, named in ((g, []), (g * [1, -1], ["w"])):
        file.write_text(f"input_matrix = {matrix.tolist()}\n{text}")
        assert [one.channel for one in check_dataset(file).findings if one.kind == "sign"] == named
    with pytest.warns(DataWarning, match="`w` does work as if the friction or the kinetic energy of `q` were negative"):
        read_dataset(file)
