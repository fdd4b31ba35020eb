"""A data set's recordings belong together, and its parts have nothing in common."""

import dataclasses
import functools
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Dataset, Trajectory
from symoden.known import KnownParts


def recording(name, seed, n=1, m=1):
    values = np.random.default_rng(seed).uniform(-1, 1, size=(20, 2 * n + m))
    q, rates, us = np.split(values, [n, 2 * n], axis=1)
    return Trajectory(name=name, ts=np.arange(20.0), q=q, rates=rates, us=us)


def test_sizes_and_names_come_from_the_recordings():
    dataset = Dataset(name="arm", space="R1 T1", train=(recording("a", 0, 2, 3),), input_names=("x", "y", "z"))
    assert (dataset.size, dataset.inputs) == (2, 3)
    assert dataset.position_names == ("q1", "q2")
    assert dataset.input_names == ("x", "y", "z")


def test_a_notebook_shows_its_parts_and_columns_in_a_line():
    free = dataclasses.replace(recording("a", 0), us=np.zeros((len(recording("a", 0)), 0)))
    assert repr(Dataset(name="arm", space="T1", train=(free,))) == "Dataset('arm', T1: 1 train; positions q1)"
    both = Dataset(name="arm", space="T1", train=(recording("a", 0),), test=(recording("b", 1),), input_names=("tau",))
    assert repr(both) == "Dataset('arm', T1: 1 train, 1 test; positions q1; inputs tau)"


def test_recordings_are_those_of_all_parts():
    a, b, c = (recording(name, seed) for seed, name in enumerate("abc"))
    assert Dataset(name="arm", space="T1", train=(a,), test=(b,), validation=(c,)).recordings == (a, b, c)


@given(speed=st.floats(-2.5, 2.5), start=st.floats(-9.0, 9.0), low=st.sampled_from([-np.pi, 0.0]))
def test_wrapped_angles_are_unwrapped_and_lengths_are_not(speed, start, low):
    ts = np.arange(20.0)
    true = np.stack([start + speed * ts, 4 * (-1) ** ts], axis=1)
    wrapped = true.copy()
    wrapped[:, 0] = (true[:, 0] - low) % (2 * np.pi) + low
    log = Trajectory(name="a", ts=ts, q=wrapped, rates=np.zeros((20, 2)), us=np.zeros((20, 0)))
    (found,) = Dataset(name="arm", space="T1 R1", train=(), validation=(log,)).validation
    np.testing.assert_allclose(np.diff(found.q, axis=0), np.diff(true, axis=0), atol=1e-12)
    np.testing.assert_array_equal(found.q[:, 1], true[:, 1])


@given(speed=st.floats(-3.1, 3.1))
def test_angles_without_jumps_stay_as_they_are_however_far_they_turn(speed):
    log = Trajectory(
        name="a", ts=np.arange(20.0), q=speed * np.arange(20.0)[:, None], rates=np.zeros((20, 1)), us=np.zeros((20, 0))
    )
    assert Dataset(name="arm", space="T1", train=(log,)).train == (log,)


def test_an_input_matrix_of_whole_numbers_is_kept_in_double_precision():
    dataset = Dataset(name="arm", space="T1", train=(recording("a", 0),), input_matrix=np.array([[2]]))
    np.testing.assert_array_equal(dataset.input_matrix, [[2.0]], strict=True)


def test_importing_the_data_layer_imports_no_jax():
    code = "import sys, symoden.data; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def untyped(train, test, rates="q"):
    """What Python says of a data set where no types are checked, as a user's does."""
    code = f"""
import numpy as np
from symoden.data import DataError, Dataset, Trajectory
Trajectory.__repr__ = lambda self: self.name
ts = np.arange(9.0)
q = np.cos(ts)[:, None]
try:
    a, b = (Trajectory(name=name, ts=ts, q=k * q, rates={rates}, us=q) for k, name in enumerate("ab"))
    data = Dataset(name="arm", space="T1", train={train}, test={test})
    print(data.train, data.test, data.validation)
except DataError as error:
    print(error)
"""
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def test_a_part_may_be_any_sequence_or_a_single_recording():
    assert untyped("[a]", "b") == "(a,) (b,) ()"


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (("'arm.toml'", "()"), "`arm`: `train` must be recordings, each a `Trajectory`; got str. `read_dataset` reads"),
        (("a", "(ts,)"), "`arm`: `test` must be recordings, each a `Trajectory`; got ndarray."),
        (("a", "b", "None"), "`a`: `rates` must be velocities or momenta; got None. `estimate_velocities(ts, q, name="),
    ],
    ids=["path", "array", "no velocities"],
)
def test_what_is_no_recording_is_refused_with_what_to_do(parts, message):
    assert untyped(*parts).startswith(message)


BAD = [
    ({"train": ()}, "at least one recording"),
    ({"test": (recording("b", 1, m=2),)}, "`a` has 1 and 1, `b` has 1 and 2"),
    ({"space": "T2"}, "the space `T2` has 2 coordinates, the recordings have 1"),
    ({"space": "S1"}, r"`arm`: `space` must be factors R<n> and T<m>"),
    ({"input_matrix": np.ones((1, 2))}, "`input_matrix` must be 1 × 1 .*; got 1 × 2"),
    ({"input_matrix": np.array([[np.nan]])}, "`input_matrix`, row 0: must be finite"),
    ({"position_names": ("a", "b")}, "`position_names` must be 1 names; got 2"),
    ({"position_units": ("m",)}, r"`arm`: `position_units` must be .* on T; got \('m',\)\."),
    ({"position_units": ("rad", "m")}, r"for each of 1 coordinates, .*; got \('rad', 'm'\)\."),
    ({"space": "R1", "position_units": ("deg",)}, r"got \('deg',\)\."),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_what_does_not_belong_together_is_refused(changes, message):
    with pytest.raises(DataError, match=message):
        Dataset(**{"name": "arm", "space": "T1", "train": (recording("a", 0),), **changes})


@pytest.mark.parametrize("part", ["test", "validation"])
def test_a_training_recording_under_another_name_is_refused_elsewhere(part):
    parts: dict[str, Any] = {part: (recording("b", 0),)}
    with pytest.raises(DataError, match=f"`b` of `{part}` must not be a recording of `train`; it equals `a`"):
        Dataset(name="arm", space="T1", train=(recording("a", 0),), **parts)


@pytest.mark.parametrize(
    ("space", "told", "units"),
    [
        ("T1 R1", (), ("rad", "")),
        ("T1 R1", ("", ""), ("rad", "")),
        ("T1 R1", ("rad", "m"), ("rad", "m")),
        ("R2", ("rad", ""), ("rad", "")),  # An angle that does not come back after a turn.
    ],
)
def test_what_coordinates_are_measured_in_comes_from_the_space_and_what_is_told(space, told, units):
    dataset = Dataset(name="arm", space=space, train=(recording("a", 0, 2),), position_units=told)
    assert dataset.position_units == units


def test_an_angle_that_is_told_to_be_a_number_stays_in_radians():
    dataset = Dataset(name="arm", space="T1 R1", train=(recording("a", 0, 2),))
    assert dataclasses.replace(dataset, space="R1 T1").position_units == ("rad", "rad")


def test_units_do_not_tell_data_apart():
    plain = Dataset(name="arm", space="R1", train=(recording("a", 0),))
    assert dataclasses.replace(plain, position_units=("rad",)).digest == plain.digest


FUNCTION = """
import numpy as np
from symoden import Dataset, KnownParts, Trajectory

ts = np.arange(9.0)
swing = Trajectory(name="swing", ts=ts, q=ts[:, None], rates=np.ones((9, 1)), us=np.zeros((9, 0)))
print(Dataset(name="arm", space="R1", train=(swing,), known=KnownParts(potential_energy=lambda q: q @ q)).digest)
"""


def test_a_function_is_the_same_in_every_process():
    first, second = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout
        for code in (FUNCTION, f"filler = [object() for _ in range(100_000)]\n{FUNCTION}")
    )
    assert first == second


def test_functions_that_do_something_else_tell_data_apart():
    plain = Dataset(name="arm", space="R1", train=(recording("a", 0),))

    def held(stiffness):
        return lambda q: stiffness * (q @ q)

    def with_itself(q):
        return q @ q if len(q) else with_itself(q)

    parts = [lambda q: q @ q, lambda q: 2 * (q @ q), held(2.0), held(3.0), held(np.ones(1)), held(np.zeros(1))]
    parts += [functools.partial(np.dot, np.ones(1)), functools.partial(np.dot, np.zeros(1)), with_itself, "q1**2"]
    parts += [MechanismOf(1.0).potential_energy, MechanismOf(2.0).potential_energy]
    digests = [dataclasses.replace(plain, known=KnownParts(potential_energy=part)).digest for part in parts]
    assert len({*digests, plain.digest}) == len(parts) + 1
    again = KnownParts(potential_energy=held(2.0))
    assert dataclasses.replace(plain, known=again).digest == digests[2]


def test_the_digest_of_formulas_is_that_of_before():
    known = KnownParts(potential_energy="-w*cos(q1)", parameters={"w": 1.0})
    assert known.fingerprint == repr(known)


@dataclasses.dataclass(frozen=True)
class MechanismOf:
    stiffness: float

    def potential_energy(self, q):
        return self.stiffness * (q @ q)


@pytest.mark.parametrize("words", [{"delay": -0.1}, {"delay": np.inf}, {"lag": (-0.1,)}, {"lag": (0.1, 0.2)}])
def test_delays_and_lags_that_are_none_are_refused(words):
    with pytest.raises(DataError, match=r"`swing`: `delay` and `lag` must be at least 0 s, .* per input \(1\); got"):
        Dataset(name="swing", space="R1", train=(recording("a", 0),), **words)
