"""A model that predicts better with the other `hold` is a reason to ask for it."""

import jax.numpy as jnp
import numpy as np
import pytest

import symoden
from symoden.cli._other_hold import name_other_hold
from symoden.integrate import RK4

STEP = 0.05


def recordings(hold, inputs):
    """A pendulum under sampled inputs that act so between the samples."""
    ts = STEP * np.arange(80)
    made = []
    for k in range(3):
        us = inputs(ts, k)[:, None]
        path = symoden.rollout(
            symoden.Pendulum(),
            jnp.array([0.5 * k]),
            jnp.zeros(1),
            jnp.asarray(ts),
            jnp.asarray(us),
            solver=RK4(8),
            hold=hold,
        )
        made.append(
            symoden.Trajectory(name=f"run{k}", ts=ts, q=np.asarray(path.q), rates=np.asarray(path.rates), us=us)
        )
    return tuple(made)


@pytest.mark.parametrize("other", ["zero", "linear"])
@pytest.mark.parametrize("true", ["zero", "linear"])
def test_the_hold_that_predicts_better_is_named(capsys, true, other):
    train = recordings(true, lambda ts, k: 3 * np.sin(7 * ts + k))
    dataset = symoden.Dataset(name="swing", space="T1", train=train, hold=other)
    name_other_hold(symoden.Pendulum(), dataset, RK4(8))
    said = capsys.readouterr().err
    assert (f'`hold = "{true}"`' in said.partition("warning: ")[2]) == (true != other)
    assert (f'% of those with "{other}": no reason to change it' in said) == (true == other)


def test_constant_inputs_tell_nothing(capsys):
    train = recordings("zero", lambda ts, k: np.full(len(ts), 1.0 + k))
    name_other_hold(symoden.Pendulum(), symoden.Dataset(name="swing", space="T1", train=train), RK4(8))
    assert capsys.readouterr().err == ""


def test_few_windows_tell_nothing(capsys):
    train = recordings("zero", lambda ts, k: 3 * np.sin(7 * ts + k))[:1]
    name_other_hold(symoden.Pendulum(), symoden.Dataset(name="swing", space="T1", train=train, hold="linear"), RK4(8))
    said = capsys.readouterr().err
    assert "warning" not in said
    assert "windows are too few to tell" in said
