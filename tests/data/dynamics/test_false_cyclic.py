"""A coordinate that accelerations depend on is named where `cyclic` names it, another one is not."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset

STEP = 0.01
INVERSE = np.linalg.inv([[1.0, 0.3], [0.3, 0.5]])


def head(path, seed, *, samples=1500):
    """A pan and a tilt, which gravity turns, under steps of their motors."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-3, 3, (samples // 40 + 1, 2)), 40, axis=0)[:samples]
    states = np.zeros((samples, 2, 2))
    for k in range(samples - 1):
        q, v = states[k]
        for _ in range(10):
            v = v + STEP / 10 * INVERSE @ (u[k] - [0, 2 * np.sin(q[1])] - 0.5 * v)
            q = q + STEP / 10 * v
        states[k + 1] = q, v
    measured = states + rng.normal(0, 1e-3, states.shape) * [[[1], [3]]]
    rows = np.column_stack([STEP * np.arange(samples), measured[:, 0], measured[:, 1], u])
    np.savetxt(path / "run.csv", rows, delimiter=",", header="t,pan,tilt,vp,vt,u,w", comments="")


def described(path, cyclic, more=""):
    file = path / "run.toml"
    file.write_text(
        'space = "T2"\ntime = "t"\npositions = ["pan", "tilt"]\nvelocities = ["vp", "vt"]\ninputs = ["u", "w"]\n'
        f'{more}[train]\nfiles = ["run.csv"]\n[known]\ncyclic = {cyclic}\n'
    )
    return file


@pytest.mark.parametrize("seed", range(3))
def test_what_gravity_turns_is_named(tmp_path, seed):
    head(tmp_path, seed)
    file = described(tmp_path, '["q1", "q2"]')
    (one,) = (each for each in check_dataset(file).findings if each.kind == "cyclic")
    assert (one.level, one.channel) == ("warning", "tilt")
    assert "`cyclic` names q2, `tilt`" in one.text
    with pytest.warns(DataWarning, match="accelerations depend on it"):
        read_dataset(file)
    read_dataset(described(tmp_path, '["q1"]'))  # Warnings are errors.
