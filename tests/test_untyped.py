"""What a user is told where no types are checked: the suite checks them all, a user's Python does not."""

import subprocess
import sys

import pytest

PROGRAM = """
import jax, numpy as np, polars
import symoden, symoden.control, symoden.data, symoden.systems
from symoden import Dataset, Space, Trajectory

ts = np.linspace(0.0, 1.0, 20)
q, none = np.cos(3 * ts)[:, None], np.zeros((20, 0))
swing = Trajectory(name="swing", ts=ts, q=q, rates=q, us=none)
data = Dataset(name="arm", space="T1", train=(swing,))
arm = symoden.Pendulum()
naive = symoden.build(symoden.ModelConfig(kind="naive"), Space.parse("T1"), 1, key=jax.random.key(0))
nothing = dict.fromkeys(("posterior", "hold", "solver", "noise", "tail", "factor", "calibrated_on", "horizon"))
bands = symoden.evaluation.Bands(**nothing)
said = {{"space": "T1", "dt": 0.05, "positions": ["q"], "train": {{"files": ["a"]}}}}
symoden.data.estimate_velocities(ts.tolist(), q.tolist(), name="lists")
for text in {calls}:
    try:
        eval(text)
    except Exception as error:
        print(type(error).__name__, "|", error)
    else:
        print("nothing | of", text)
"""
REFUSED = {
    "Space('T1')": "ValueError | A space must be told which coordinates are angles; got 'T1'. `Space.parse`",
    "Dataset(name='arm', space=Space.parse('T1'), train=(swing,))": "DataError | `arm`: `space` must be its name",
    "symoden.data.estimate_velocities(ts[1:], q, name='a')": "DataError | `a`: `ts` (T,) and `q` (T, n)",
    "symoden.data.estimate_velocities(ts, q[:, 0], name='a')": "DataError | `a`: `q` must be an array of real numbers",
    "symoden.data.estimate_velocities(ts[::-1], q, name='a')": "DataError | `a`: `ts`, row 1: times must increase",
    "symoden.data.estimate_velocities(ts, q * np.nan, name='a')": "DataError | `a`: `q`, row 0: must be",
    "symoden.read_dataset(5)": "DataError | A description must be the path of a TOML file, or a mapping of its",
    "symoden.read_dataset(said, tables=[q])": "DataError | `tables` must be a mapping of names to tables",
    "symoden.read_dataset(said, tables={'a': 'a.csv'})": "DataError | `a`: a table must be a mapping of",
    "symoden.read_dataset(said, tables={'a': polars.LazyFrame({'q': ts})})": "DataError | `a`: a table must be a",
    "symoden.fit([swing])": "TypeError | Training must be given a `Dataset`; got list.",
    "symoden.fit(data, model='dissipative')": "TypeError | Training must be given a `ModelConfig`; got str.",
    "symoden.TrainingConfig(left_out=[('a',)])": "ValueError | `left_out` must have spans as (name of a",
    "symoden.TrainingConfig(batch_size=16.5)": "ValueError | `batch_size` must be a whole number of at least 1; got 16",
    "symoden.TrainingConfig(adam_steps=1e2)": "ValueError | `adam_steps` must be a whole number of at least 0; got 100",
    "symoden.TrainingConfig(horizon=2.5)": "ValueError | `horizon` must be a whole number of at least 1, or None to",
    "symoden.rescale(naive, 2.0)": "TypeError | A model must have an inertia for its scale to be changed; Naive",
    "symoden.fit(data, config={'seed': 1})": "TypeError | Training must be given a `TrainingConfig`; got dict.",
    "symoden.fit(data, resume=True)": "ValueError | Training can be resumed only in a `folder`; got none.",
    "symoden.control.design(symoden.systems.Pendulum(), [0.0], method='pid')": "ValueError | `method` must be one",
    "symoden.predict(arm, swing)": "TypeError | `trajectories` must be a list of recordings; got Trajectory. Write [",
    "symoden.predict(arm, data)": "TypeError | `trajectories` must be a list of recordings; got Dataset. Write `da",
    "symoden.predict(arm, {'a': swing})": "TypeError | `trajectories` must be a list of recordings; got dict. Write ",
    "symoden.predict(arm, 'arm.csv')": "TypeError | `trajectories` must be a list of recordings; got str. `read_d",
    "symoden.predict(arm, [q])": "TypeError | `trajectories` must be a list of recordings; got list with ndarray in",
    "symoden.predict('arm.safetensors', [swing])": "TypeError | `model` must be a system or a learned model; got str.",
    "symoden.design('arm.safetensors', [0.0])": "TypeError | `model` must be a system or a learned model; got str.",
    "symoden.design(arm, 3.14)": "ValueError | `target` must be a list of one number for each",
    "symoden.infer_bands(arm, data)": "TypeError | Bands are made of what `fit` found and of its data set; got P",
    "symoden.control.Loop(lag=0.1)": "ValueError | Lags must be a tuple of seconds, such as (0.1,); got 0.1.",
    "bands.predict(swing)": "TypeError | `trajectories` must be a list of recordings; got Trajectory. Write [",
    "symoden.load('.')": "StorageError | `.` must be a file that symoden wrote; it is a folder. Name the file in it",
    "symoden.KnownParts(potential_energy='q1', cyclic='q2')": "ValueError | `cyclic` must be a list of names; got the",
}


@pytest.fixture(scope="module")
def told() -> dict[str, str]:
    """What Python says of each."""
    program = [sys.executable, "-W", "ignore", "-c", PROGRAM.format(calls=list(REFUSED))]
    answer = subprocess.run(program, capture_output=True, check=False, text=True)
    assert answer.returncode == 0, answer.stderr
    return dict(zip(REFUSED, answer.stdout.splitlines(), strict=True))


@pytest.mark.parametrize("call", REFUSED)
def test_what_cannot_be_meant_is_refused_in_words(told, call):
    assert told[call].startswith(REFUSED[call])
