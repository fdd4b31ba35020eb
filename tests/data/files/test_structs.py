"""Fields of MATLAB's structs, as Simulink writes its logs."""

import contextlib

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings, strategies as st

from symoden.data import DataError
from symoden.data.files._readers import read_rows

ALL = slice(0, None)
T = np.linspace(0, 1, 7)
WITH_TIME = ("out.time", "out.signals(2).values")


@pytest.fixture
def log(tmp_path):
    """A log of two scopes with the time, as Simulink writes it, and the same in one struct."""
    signals = np.zeros((1, 2), dtype=[("values", "O"), ("label", "O")])
    for i in range(2):
        signals[0, i]["values"], signals[0, i]["label"] = (i + 1) * T[:, None], "speed"
    plain = {"t": T, "deep": {"er": {"q": np.stack([T, -T], axis=1)}}}
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"before": 1.0, "out": {"time": T[:, None], "signals": signals}, "plain": plain, "z": T})
    return path


def test_fields_are_named_as_matlab_names_them(log):
    names = (*WITH_TIME, "plain.t", "plain.deep.er.q[1]", "z")
    read = read_rows(log, {"x": names}, ALL).signals["x"]
    np.testing.assert_array_equal(read.T, [T, 2 * T, T, -T, T])


@pytest.mark.parametrize("packed", [False, True])
def test_a_struct_is_read_packed_too(log, packed):
    scipy.io.savemat(log, {"s": {"q": T}}, do_compression=packed)
    np.testing.assert_array_equal(read_rows(log, {"x": ("s.q",)}, ALL).signals["x"][:, 0], T)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("out.signals.values", r"is an array of 2 structs\. It holds `out\.signals\(1\)\.values, .*out\.signals\(2\)"),
        ("out.signals(3).values", r"`out\.signals` is an array of 2 structs"),
        ("out.signals(0).values", r"`out\.signals` is an array of 2 structs"),
        ("out.signal(1).values", r"no variable .* Did you mean `out\.signals\(1\)\.values`"),
        ("out.tine", r"no variable .* Did you mean `out\.time`"),
        ("z.q", r"`z` is no struct that has fields"),
        ("plain", r"got a struct that holds `plain\.t, plain\.deep\.er\.q`\. Name one"),
        ("plain.deep", r"must hold real numbers; got a struct that holds `plain\.deep\.er\.q`\. Name one"),
        ("out.signals(1)", r"got a struct that holds `out\.signals\(1\)\.values, out\.signals\(1\)\.label`"),
        ("out..time", r"no variable `out\.\.time`; found `"),
        ("absent.q", r"no variable `absent\.q`; found `before, out, plain, z`"),
    ],
)
def test_what_leads_nowhere_is_named_with_what_is_there(log, name, said):
    with pytest.raises(DataError, match=said):
        read_rows(log, {"x": (name,)}, ALL)


@given(place=st.integers(128, 4000), value=st.integers(0, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
def test_a_damaged_struct_is_read_or_refused(log, place, value):
    contents = bytearray(log.read_bytes())
    contents[place % len(contents)] = value
    damaged = log.with_name("damaged.mat")
    damaged.write_bytes(contents)
    with contextlib.suppress(DataError):  # Nothing else.
        assert read_rows(damaged, {"x": WITH_TIME}, ALL).signals["x"].shape[1] == 2


def test_every_truncation_of_a_struct_is_refused(log):
    contents = log.read_bytes()
    for size in range(0, len(contents) - len(T) * 8 - 100, 97):
        log.write_bytes(contents[:size])
        with pytest.raises(DataError):
            read_rows(log, {"x": WITH_TIME}, ALL)


def test_a_struct_of_very_many_fields_is_refused_before_it_takes_memory(log):
    many = np.zeros((1, 60_000), dtype=[("a", "O"), ("b", "O")])
    many["a"], many["b"] = 1.0, 2.0
    scipy.io.savemat(log, {"s": many, "q": T}, do_compression=True)
    np.testing.assert_array_equal(read_rows(log, {"x": ("q",)}, ALL).signals["x"][:, 0], T)
    with pytest.raises(DataError, match="more than 100000"):
        read_rows(log, {"x": ("s(3).a",)}, ALL)


def test_vectors_as_simulink_logs_them_are_columns(log):
    scipy.io.savemat(log, {"out": {"time": T[:, None], "values": np.stack([T, -T])[:, None, :]}})
    read = read_rows(log, {"time": "out.time", "x": "out.values"}, ALL).signals["x"]
    np.testing.assert_array_equal(read, np.stack([T, -T], axis=1))


def test_structs_of_version_7_3_are_groups(tmp_path):
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["log/q"] = T[None]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    for name in ("log.q", "log/q"):
        np.testing.assert_array_equal(read_rows(path, {"x": (name,)}, ALL).signals["x"][:, 0], T)
