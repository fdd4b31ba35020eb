"""What is written is read as it was."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import DataError, Dataset, Trajectory, check_dataset, read_dataset, write_dataset
from symoden.known import KnownParts


def recording(name, seed=0, *, n=2, m=1, samples=30, initial_samples=1):
    generator = np.random.default_rng(seed)
    ts = np.cumsum(generator.uniform(0.04, 0.06, samples))
    q = np.cumsum(generator.uniform(-1, 1, (samples, n)), axis=0)
    rates, us = generator.standard_normal((samples, n)), generator.standard_normal((samples, m))
    return Trajectory(name=name, ts=ts, q=q, rates=rates, us=us, initial_samples=initial_samples)


@given(
    n=st.integers(1, 3),
    m=st.integers(0, 2),
    momenta=st.booleans(),
    hold=st.sampled_from(["zero", "linear"]),
    initial=st.integers(1, 3),
    known=st.booleans(),
)
@settings(max_examples=15)
def test_a_data_set_survives_being_written_and_read(tmp_path_factory, n, m, momenta, hold, initial, known):
    path = tmp_path_factory.mktemp("written") / "über arm.toml"
    first, second, third = (recording(f"swing #{k}", k, n=n, m=m, initial_samples=initial) for k in range(3))
    matrix = np.random.default_rng(1).standard_normal((n, m)) if known and m else None
    written = Dataset(
        name="über arm",
        space=f"T{n}",
        train=(first, second),
        test=(third,),
        momenta=momenta,
        hold=hold if m else "zero",
        input_matrix=matrix,
    )
    write_dataset(path, written)
    read = read_dataset(path)
    for field in ("name", "space", "momenta", "hold"):
        assert getattr(read, field) == getattr(written, field)
    assert (read.input_matrix is None) == (matrix is None)
    assert matrix is None or np.array_equal(np.asarray(read.input_matrix), matrix)
    for part in ("train", "test", "validation"):
        assert len(getattr(read, part)) == len(getattr(written, part))
        for ours, theirs in zip(getattr(read, part), getattr(written, part), strict=True):
            assert (ours.name, ours.initial_samples) == (theirs.name, theirs.initial_samples)
            for array in ("ts", "q", "rates", "us"):
                np.testing.assert_allclose(getattr(ours, array), getattr(theirs, array), atol=1e-12)


@pytest.mark.parametrize("unit", ["rad", "m", ""])
def test_the_unit_of_a_single_coordinate_is_written(tmp_path, unit):
    data = Dataset(name="d", space="R1", train=(recording("a", n=1),), position_units=(unit,))
    write_dataset(tmp_path / "d.toml", data)
    assert read_dataset(tmp_path / "d.toml").position_units == (unit,)


def test_what_the_space_does_not_tell_of_units_is_written(tmp_path):
    units = ("rad", "m", "", "rad")
    data = Dataset(name="d", space="R3 T1", train=(recording("a", n=4),), position_units=units)
    write_dataset(tmp_path / "d.toml", data)
    assert 'units = { "q[0]" = "rad", "q[1]" = "m", "q[3]" = "rad" }' in (tmp_path / "d.toml").read_text()
    read = read_dataset(tmp_path / "d.toml")
    assert read.position_units == units
    np.testing.assert_array_equal(read.train[0].q, data.train[0].q)


def test_late_velocities_come_back_as_they_were(tmp_path):
    ts = 0.005 * np.arange(400)
    late = Trajectory(
        name="late", ts=ts, q=np.sin(4 * ts)[:, None], rates=4 * np.cos(4 * ts - 0.1)[:, None], us=np.zeros((400, 0))
    )
    write_dataset(tmp_path / "d.toml", Dataset(name="d", space="T1", train=(late,)))
    np.testing.assert_array_equal(read_dataset(tmp_path / "d.toml").train[0].rates, late.rates)


def test_estimated_velocities_are_still_estimates(tmp_path):
    one = dataclasses.replace(recording("one", 1), noise_gain=np.array([17.5, 3.0]), one_sided=0.25)
    other = dataclasses.replace(recording("other", 2), noise_gain=np.array([17.5, 3.0]), one_sided=0.25)
    data = Dataset(name="arm", space="T2", train=(one, other), test=(recording("measured", 3),))
    write_dataset(tmp_path / "mixed.toml", data)
    assert read_dataset(tmp_path / "mixed.toml").train[0].noise_gain is None
    write_dataset(tmp_path / "arm.toml", dataclasses.replace(data, test=()))
    for read in read_dataset(tmp_path / "arm.toml").train:
        assert read.noise_gain is not None
        assert np.array_equal(read.noise_gain, [17.5, 3.0])
        assert read.one_sided == 0.25
    path = tmp_path / "arm.toml"
    path.write_text(path.read_text().replace("[17.5, 3.0]", "[17.5]"))
    with pytest.raises(DataError, match="must have a noise_gain per position, 2; got 1"):
        read_dataset(path)


def test_angles_of_many_turns_are_no_degrees(tmp_path):
    ts = 0.01 * np.arange(2000)
    q, v = 40.0 * np.sin(ts)[:, None], 40.0 * np.cos(ts)[:, None]
    wound = Trajectory(name="wound", ts=ts, q=q, rates=v, us=np.zeros((2000, 0)))
    write_dataset(tmp_path / "arm.toml", Dataset(name="arm", space="T1", train=(wound,)))
    (check,) = check_dataset(tmp_path / "arm.toml").recordings
    assert [one for one in check.findings if one.kind == "unit"] == []


def test_recordings_of_before_are_no_part_of_it_but_not_removed(tmp_path):
    for names in ("abc", "cd"):
        data = Dataset(name="arm", space="T2", train=tuple(recording(name, ord(name)) for name in names))
        write_dataset(tmp_path / "arm.toml", data)
    assert [each.name for each in read_dataset(tmp_path / "arm.toml").train] == ["c", "d"]
    assert sorted(path.stem for path in (tmp_path / "arm" / "train").iterdir()) == ["a", "b", "c", "d"]


DATA = Dataset(name="arm", space="T2", train=(recording("a", 1), recording("b", 2)))


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("arm.npz", {}, "a description must be a file `<name>.toml`"),
        ("a*m.toml", {}, r"names of files; got 'a\*m'"),
        ("arm.toml", {"train": (recording("a/b"),)}, "names of files; got 'a/b'"),
        ("arm.toml", {"train": (recording("a", 1), recording("a", 2))}, "got 'a' twice"),
        ("arm.toml", {"test": (recording("c", 3, initial_samples=2),)}, "same `initial_samples`"),
        ("arm.toml", {"known": KnownParts()}, "known parts are not written"),
    ],
)
def test_what_files_cannot_say_is_refused_before_anything_is_written(tmp_path, name, changes, message):
    with pytest.raises(DataError, match=message):
        write_dataset(tmp_path / name, dataclasses.replace(DATA, **changes))
    assert list(tmp_path.iterdir()) == []
