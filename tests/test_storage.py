"""Files are whole or absent, and what is not one of ours is refused."""

import errno
import json
import os
import signal
import stat
import subprocess
import sys
import time

import numpy as np
import pytest
import safetensors.numpy

from symoden.storage import StorageError, exclusive, load_arrays, save_arrays, write_atomically

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2], np.int32), "c": np.zeros((0, 3), np.float32)}

ENDLESS = """
import sys
import numpy as np
from symoden.storage import save_arrays
k = 0
while True:
    k += 1
    save_arrays(sys.argv[1], {"a": np.full(200_000, float(k))}, {"k": k})
"""


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "folder" / "arrays.safetensors"
    save_arrays(path, ARRAYS, {"name": "é", "list": [1, None, 2.5]})
    return path


def test_what_is_saved_comes_back(saved):
    arrays, metadata = load_arrays(saved)
    assert metadata == {"name": "é", "list": [1, None, 2.5]}
    assert arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        assert np.array_equal(arrays[name], array)
    assert [path.name for path in saved.parent.iterdir()] == ["arrays.safetensors"]


def test_the_same_contents_give_the_same_bytes(saved, tmp_path):
    save_arrays(tmp_path / "again", dict(reversed(ARRAYS.items())), {"list": [1, None, 2.5], "name": "é"})
    assert (tmp_path / "again").read_bytes() == saved.read_bytes()


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.99])
def test_a_truncated_file_is_refused(saved, share):
    data = saved.read_bytes()
    saved.write_bytes(data[: int(share * len(data))])
    with pytest.raises(StorageError, match="truncated or damaged"):
        load_arrays(saved)


def test_no_byte_can_be_changed_unnoticed(saved):
    data = saved.read_bytes()
    for position in range(0, len(data), max(1, len(data) // 60)):
        saved.write_bytes(data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :])
        with pytest.raises(StorageError):
            load_arrays(saved)


def test_a_tampered_array_is_named_as_such(saved):
    data = saved.read_bytes()
    saved.write_bytes(data.replace(np.array(5.0).tobytes(), np.array(7.0).tobytes()))
    with pytest.raises(StorageError, match="its digest differs"):
        load_arrays(saved)


def test_foreign_safetensors_are_refused(tmp_path):
    path = tmp_path / "foreign.safetensors"
    path.write_bytes(safetensors.numpy.save(ARRAYS, metadata={"format": "pt"}))
    with pytest.raises(StorageError, match="written by symoden"):
        load_arrays(path)
    path.write_bytes(safetensors.numpy.save(ARRAYS, metadata={"symoden": json.dumps({})}))
    with pytest.raises(StorageError, match=r"written by symoden|digest"):
        load_arrays(path)


def test_an_absent_file_and_a_folder_are_refused(tmp_path):
    for path, message in ((tmp_path / "absent", "there is none"), (tmp_path, "it is a folder")):
        with pytest.raises(StorageError, match=message):
            load_arrays(path)


def test_a_file_too_large_for_memory_is_refused(tmp_path):
    path = tmp_path / "huge"
    with path.open("wb") as file:
        file.truncate(2**31 + 1)  # sparse
    with pytest.raises(StorageError, match="smaller than 2 GiB"):
        load_arrays(path)


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_full_disk_leaves_the_old_file_and_no_other(saved, monkeypatch, code):
    before = saved.read_bytes()

    def full(descriptor):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=f"{os.strerror(code)}.*unchanged"):
        save_arrays(saved, {"a": np.ones(3)}, {})
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_a_target_that_cannot_be_a_folder_is_refused(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StorageError, match="must be writable"):
        write_atomically(tmp_path / "file" / "below", b"x")


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kill -9 is of POSIX")
def test_a_kill_while_saving_leaves_a_whole_file(tmp_path):
    path = tmp_path / "arrays.safetensors"
    for delay in (0.0, 0.013, 0.031):
        with subprocess.Popen([sys.executable, "-c", ENDLESS, str(path)]) as running:
            start = path.stat().st_mtime_ns if path.exists() else 0
            while running.poll() is None and (not path.exists() or path.stat().st_mtime_ns == start):
                time.sleep(0.005)
            time.sleep(delay)
            running.kill()
        assert running.returncode == -signal.SIGKILL
        arrays, metadata = load_arrays(path)
        assert np.array_equal(arrays["a"], np.full(200_000, float(metadata["k"])))


def test_a_new_file_has_the_permissions_that_the_user_gives_and_a_replaced_one_keeps_its_own(tmp_path):
    path = tmp_path / "file"
    before = os.umask(0o027)
    try:
        write_atomically(path, b"one")
        assert stat.S_IMODE(path.stat().st_mode) == 0o640
        path.chmod(0o600)
        write_atomically(path, b"two")
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert os.umask(0o027) == 0o027  # as it was
    finally:
        os.umask(before)


def test_files_are_written_where_the_system_sets_no_permissions_of_open_files(tmp_path, monkeypatch):
    """As on Windows, where `os.fchmod` came with Python 3.13."""
    monkeypatch.delattr(os, "fchmod")
    write_atomically(tmp_path / "file", b"one")
    assert (tmp_path / "file").read_bytes() == b"one"


HOLDER = """
import sys, time
from pathlib import Path
from symoden.storage import exclusive
with exclusive(Path(sys.argv[1])):
    print("locked", flush=True)
    time.sleep(60)
"""


def test_a_folder_is_written_by_one_process_at_a_time_and_free_when_that_dies(tmp_path):
    folder = tmp_path / "new" / "run"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(folder)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        with pytest.raises(StorageError, match="one command at a time"), exclusive(folder):
            pytest.fail("the folder was taken twice")
        holder.send_signal(signal.SIGKILL)
    for _ in range(2):
        with exclusive(folder):
            assert list(folder.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="must be a folder"), exclusive(tmp_path / "file"):
        pytest.fail("a file is no folder")
