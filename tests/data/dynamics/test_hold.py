"""Inputs that are held where they are called joined by lines, or the other way round, are named."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset

STEP = 0.02
FINE = 20  # Steps of integration between rows.


def pendulum(path, hold, *, noise=0.0, samples=1200, seed=0):
    """A damped pendulum under a sum of sines that acts as `hold` says."""
    rng = np.random.default_rng(seed)
    ts = STEP * np.arange(samples)
    u = 2 * np.sin(np.outer(ts, rng.uniform(1, 8, 4)) + rng.uniform(0, 6, 4)).sum(axis=1)
    states = np.zeros((samples, 2))
    for k in range(samples - 1):
        q, v = states[k]
        for i in range(FINE):
            push = u[k] if hold == "zero" else u[k] + (i + 0.5) / FINE * (u[k + 1] - u[k])
            v += STEP / FINE * (push - 9 * np.sin(q) - 0.4 * v)
            q += STEP / FINE * v
        states[k + 1] = q, v
    measured = states + rng.normal(0, noise, states.shape) * [1, 10] if noise else states
    np.savetxt(path / "run.csv", np.column_stack([ts, measured, u]), delimiter=",", header="t,q,v,u", comments="")


def found(path, hold):
    """What is said of it where the description calls its input so."""
    file = path / "run.toml"
    file.write_text(
        f'space = "T1"\ntime = "t"\npositions = ["q"]\nvelocities = ["v"]\ninputs = ["u"]\nhold = "{hold}"\n'
        '[train]\nfiles = ["run.csv"]\n'
    )
    return [one for one in check_dataset(file).findings if one.kind in {"hold", "delay"}]


@pytest.mark.parametrize("noise", [0.0, 3e-4])
@pytest.mark.parametrize(("true", "other"), [("zero", "linear"), ("linear", "zero")])
def test_the_other_hold_is_named_and_the_true_one_is_not(tmp_path, true, other, noise):
    pendulum(tmp_path, true, noise=noise)
    assert found(tmp_path, true) == []
    (one,) = found(tmp_path, other)
    assert (one.kind, one.level, one.channel) == ("hold", "warning", "u")
    assert f'`hold = "{true}"`' in one.advice


@pytest.mark.parametrize("seed", range(3))
def test_noise_tells_nothing_of_it(tmp_path, seed):
    pendulum(tmp_path, "linear", noise=0.02, seed=seed)
    assert found(tmp_path, "zero") == []
    assert found(tmp_path, "linear") == []


@pytest.mark.filterwarnings("ignore:.*velocities are estimated")  # Without noise these are better.
def test_training_is_warned_of_it_as_well(tmp_path):
    pendulum(tmp_path, "linear")
    found(tmp_path, "zero")
    with pytest.warns(DataWarning, match='Write `hold = "linear"`'):
        read_dataset(tmp_path / "run.toml")
