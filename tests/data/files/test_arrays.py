"""Files of arrays: NPZ, HDF5 and MAT agree with each other, and none of them does anything but hold numbers."""

import io
import pickle
import sys
import zipfile

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

from symoden.data import DataError
from symoden.data.files._readers import read_rows

ALL = slice(0, None)
T = np.linspace(0.0, 1.0, 7)
Q = np.arange(14.0).reshape(7, 2)


def save_mat73(path, **arrays):
    """As MATLAB writes version 7.3: HDF5 behind a header of 512 bytes, the axes reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            file[name] = np.atleast_2d(array.T)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def save_hdf5(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name] = array


FORMATS = {
    "run.npz": np.savez,
    "packed.npz": np.savez_compressed,
    "run.h5": save_hdf5,
    "run.hdf5": save_hdf5,
    "run.mat": lambda path, **arrays: scipy.io.savemat(path, arrays),
    "packed.mat": lambda path, **arrays: scipy.io.savemat(path, arrays, do_compression=True),
    "v73.mat": save_mat73,
}
every_format = pytest.mark.parametrize("name", FORMATS)


def saved(folder, name, **arrays):
    FORMATS[name](folder / name, **arrays)
    return folder / name


@every_format
def test_variables_and_their_columns_are_read_by_name(tmp_path, name):
    path = saved(tmp_path, name, t=T, q=Q, n=np.arange(7))
    selectors = {"time": "t", "positions": "q", "rates": ("q[1]", "n"), "inputs": ()}
    found = read_rows(path, selectors, slice(2, None))
    np.testing.assert_array_equal(found.signals["time"][:, 0], T[2:])
    np.testing.assert_array_equal(found.signals["positions"], Q[2:])
    np.testing.assert_array_equal(found.signals["rates"], np.stack([Q[2:, 1], np.arange(2, 7)], axis=1))
    assert found.signals["inputs"].shape == (5, 0)
    assert found.names["positions"] == ("q[0]", "q[1]")
    assert found.names["rates"] == ("q[1]", "n")
    np.testing.assert_array_equal(found.index, range(2, 7))


BAD = [
    ({"t": T, "Q": Q}, "q", r"no variable `q`; found `Q, t`\. Did you mean `Q`\?"),
    ({"t": T, "q": Q[:5]}, "q", r"all variables must have the same number of samples.*`q` 5 × 2"),
    ({"t": T, "q": Q}, ("q",), r"variable `q` in a list or a formula must be one column; got 2\. .*`q\[0\]`"),
    ({"t": T, "q": Q}, "q[2]", r"variable `q` must have a column 2 \(counted from 0\); got 2 columns"),
]


@every_format
@pytest.mark.parametrize(("arrays", "selector", "message"), BAD, ids=[message for *_, message in BAD])
def test_a_bad_variable_is_refused_in_every_format(tmp_path, name, arrays, selector, message):
    path = saved(tmp_path, name, **arrays)
    with pytest.raises(DataError, match=message):
        read_rows(path, {"time": "t", "positions": selector}, ALL)


@every_format
def test_what_is_not_finite_is_no_number(tmp_path, name):
    path = saved(tmp_path, name, t=T, q=np.where(Q == 3, np.inf, Q))
    found = read_rows(path, {"time": "t", "positions": "q"}, ALL).signals["positions"]
    np.testing.assert_array_equal(found, np.where(Q == 3, np.nan, Q))


@every_format
@pytest.mark.parametrize("t", [T, np.stack([T, T + 1, 2 * T])])
def test_a_block_of_three_axes_is_a_recording_after_another(tmp_path, name, t):
    q = np.arange(42.0).reshape(3, 7, 2)
    path = saved(tmp_path, name, t=t, q=q, u=-q[:, :, 0])
    selectors = {"time": "t", "positions": "q", "rates": ("q[1]", "u"), "inputs": ()}
    found = read_rows(path, selectors, slice(2, None))
    np.testing.assert_array_equal(found.signals["positions"], q[:, 2:].reshape(-1, 2))
    np.testing.assert_array_equal(found.signals["rates"][:, 1], -q[:, 2:, 0].ravel())
    np.testing.assert_array_equal(found.signals["time"][:, 0], np.broadcast_to(t, (3, 7))[:, 2:].ravel())
    np.testing.assert_array_equal(found.index, [*range(2, 7), *range(9, 14), *range(16, 21)])
    assert found.labels is not None
    assert found.labels.tolist() == 5 * ["0"] + 5 * ["1"] + 5 * ["2"]


@every_format
def test_blocks_that_differ_or_have_four_axes_and_complex_numbers_are_refused(tmp_path, name):
    path = saved(tmp_path, name, q=np.zeros((3, 7, 2)), r=np.zeros((3, 6, 1)), w=np.zeros((7, 2, 2, 2)), z=T + 1j)
    for variable, said in (
        ("r", r"`r` must be \(3, 7\) or \(3, 7, columns\), or \(7,\) for all; got shape \(3, 6(, 1)?\)"),
        ("w", r"or \(recordings, samples, columns\); got shape \(7, 2, 2, 2\)"),
        ("z", "variable `z` must hold real numbers; got complex"),
    ):
        selectors = {"positions": "q", "rates": variable} if variable == "r" else {"positions": variable}
        with pytest.raises(DataError, match=said):
            read_rows(path, selectors, ALL)
    for shape in ((0, 7, 2), (3, 0, 2), (3, 7, 0)):
        path = saved(tmp_path, name, q=np.zeros(shape))
        with pytest.raises(DataError):
            read_rows(path, {"positions": "q"}, ALL)
    path = saved(tmp_path, name, q=np.zeros((3, 7, 2)))
    with pytest.raises(DataError, match=r"tells recordings apart, numbered from 0; got `recording` = 'q'"):
        read_rows(path, {"positions": "q"}, ALL, "q")


@every_format
def test_every_truncation_is_refused(tmp_path, name):
    path = saved(tmp_path, name, t=T, q=np.random.default_rng(0).normal(size=(7, 2)))
    whole = path.read_bytes()
    for cut in range(1, len(whole) - 1, max(1, len(whole) // 40)):
        path.write_bytes(whole[:cut])
        try:
            found = read_rows(path, {"time": "t", "positions": "q"}, ALL)
        except DataError as error:
            assert str(path) in str(error)  # noqa: PT017 - a cut through padding loses nothing
        else:
            np.testing.assert_array_equal(found.signals["time"][:, 0], T)


@every_format
def test_damaged_bytes_never_end_in_another_error(tmp_path, name):
    path = saved(tmp_path, name, t=T, q=Q)
    whole = np.frombuffer(path.read_bytes(), np.uint8)
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = whole.copy()
        damaged[rng.integers(0, len(whole), 5)] = rng.integers(0, 256, 5)
        path.write_bytes(damaged.tobytes())
        try:
            read_rows(path, {"time": "t", "positions": "q"}, ALL)
        except DataError as error:
            assert str(path) in str(error)  # noqa: PT017 - damage to padding does no harm


class Trap:
    """Unpickling this ends the test."""

    def __reduce__(self):
        return sys.exit, ("unpickled",)


def test_no_object_is_ever_unpickled(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, q=np.array([Trap()], dtype=object))
    with pytest.raises(DataError, match=r"variable `q` must hold real numbers; got object\. Objects are never loaded"):
        read_rows(path, {"positions": "q"}, ALL)
    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(DataError, match=r"must be a complete NPZ file.*[^.]\. Perhaps it was cut off: copy it again"):
        read_rows(path, {"positions": "q"}, ALL)


def test_a_header_that_claims_more_than_there_is_is_refused(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("q.npy", header.getvalue() + bytes(64))
    with pytest.raises(DataError, match="variable `q` must have the 8000000000000 bytes that its header claims"):
        read_rows(path, {"positions": "q"}, ALL)


def test_a_variable_beyond_the_limit_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("q", shape=(10**11, 2), dtype="f8", chunks=(1000, 2))
    with pytest.raises(DataError, match="variable `q` must have at most 2048 MiB"):
        read_rows(path, {"positions": "q"}, ALL)


def test_hdf5_data_in_another_file_are_not_followed(tmp_path):
    secret, path = tmp_path / "secret.h5", tmp_path / "run.h5"
    save_hdf5(secret, q=Q)
    layout = h5py.VirtualLayout((7, 2), "f8")
    layout[:] = h5py.VirtualSource(str(secret), "q", (7, 2))
    with h5py.File(path, "w") as file:
        file["link"] = h5py.ExternalLink(str(secret), "q")
        file["group"] = h5py.ExternalLink(str(secret), "/")
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("raw", (7,), "f8", external=[(str(secret), 0, 56)])
    for name in ("link", "group/q", "virtual", "raw"):
        with pytest.raises(DataError, match=f"variable `{name}` must be in this file"):
            read_rows(path, {"positions": name}, ALL)


def test_hdf5_groups_are_part_of_the_name(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["log/q"] = Q
    np.testing.assert_array_equal(read_rows(path, {"positions": "log/q"}, ALL).signals["positions"], Q)
    for name in ("log", "q"):
        with pytest.raises(DataError, match=f"no variable `{name}`; found `log/q`"):
            read_rows(path, {"positions": name}, ALL)


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    path = saved(tmp_path, "run.h5", q=Q)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(DataError, match=r"need h5py. Install symoden\[data\]"):
        read_rows(path, {"positions": "q"}, ALL)


@pytest.mark.parametrize(
    ("value", "kind"),
    [("abc", "text"), ({"a": 1.0}, "a struct"), (scipy.sparse.eye_array(3).tocsc(), "a sparse matrix")],
)
def test_a_mat_variable_without_numbers_is_refused(tmp_path, value, kind):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"q": value})
    with pytest.raises(DataError, match=f"variable `q` must hold real numbers; got {kind}"):
        read_rows(path, {"positions": "q"}, ALL)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"])
@pytest.mark.parametrize("packed", [False, True])
def test_mat_numbers_of_every_kind_are_those_that_scipy_reads(tmp_path, dtype, packed):
    path = tmp_path / "run.mat"
    values = (np.arange(12).reshape(6, 2) % 5).astype(dtype)
    scipy.io.savemat(path, {"before": "text", "q": values, "a_name_that_is_long": values[:, :1]}, do_compression=packed)
    for name in ("q", "a_name_that_is_long"):
        expected = scipy.io.loadmat(path)[name]
        np.testing.assert_array_equal(read_rows(path, {"positions": name}, ALL).signals["positions"], expected)


def test_a_mat_file_of_version_4_is_refused(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"q": Q}, format="4")
    with pytest.raises(DataError, match=r"must be a complete MAT file; .*: the header is none of version 5 or 7\.3"):
        read_rows(path, {"positions": "q"}, ALL)
