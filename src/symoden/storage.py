"""Files that are whole or absent: written beside their target, flushed, then renamed; read without running code."""

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

try:
    import fcntl
except ImportError:  # Not on Windows.
    fcntl = None

_KEY = "symoden"
_LARGEST_FILE = 2**31


class StorageError(ValueError):
    """A file could not be written or is not what it must be; nothing saved before is lost."""


def write_atomically(path: Path | str, data: bytes) -> None:
    """Write a file so that, whatever happens, either the old one or the whole new one is there.

    Args:
        path: The target; its folder is made if absent.
        data: Its contents.

    Raises:
        StorageError: If it cannot be written, for example because the disk is full.
    """
    path = Path(path)
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            temporary = Path(file.name)
            temporary.chmod(_permissions(path))  # By its path: `os.fchmod` is not on Windows before Python 3.13.
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()
        raise StorageError(
            f"`{path}` must be writable; the system says: {error.strerror or error}. "
            "What was there before is unchanged; free some space or choose another folder."
        ) from error


def _permissions(path: Path) -> int:
    """Those of the file that is replaced, or those that the user gives to new files."""
    with contextlib.suppress(FileNotFoundError):
        return path.stat().st_mode & 0o777
    mask = os.umask(0o077)  # It cannot be read without being set.
    os.umask(mask)
    return 0o666 & ~mask


@contextlib.contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Keep other processes that ask for the same from writing into a folder, as long as the context lasts.

    The folder itself is locked: nothing is left behind, whatever happens. Systems without such locks have none.

    Args:
        folder: The folder; it is made if absent.

    Raises:
        StorageError: If another process has it, or it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = None if fcntl is None else os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise StorageError(f"`{folder}` must be a folder that can be written; the system says: {error}.") from error
    if fcntl is None or handle is None:
        yield
        return
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StorageError(
                f"`{folder}` must be written by one command at a time; another one is at work there. Wait for it, or "
                "choose another folder."
            ) from None
        except OSError:  # Some network file systems have no locks.
            pass
        yield
    finally:
        os.close(handle)


def save_arrays(path: Path | str, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any]) -> None:
    """Write arrays with metadata as one safetensors file, with a digest of both.

    Args:
        path: The target.
        arrays: Arrays by name.
        metadata: What JSON can express.

    Raises:
        StorageError: If the file cannot be written.
    """
    contents = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    text = json.dumps(dict(metadata), sort_keys=True)
    # One entry, since safetensors does not keep the order of several: the same contents give the same bytes.
    header = json.dumps({"contents": text, "sha256": _digest(contents, text)}, sort_keys=True)
    write_atomically(path, safetensors.numpy.save(contents, metadata={_KEY: header}))


def load_arrays(path: Path | str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read what `save_arrays` wrote.

    Args:
        path: The file.

    Returns:
        Arrays by name, and the metadata.

    Raises:
        StorageError: If the file is absent, truncated, changed since it was written, or not one of ours.
    """
    path = Path(path)
    if not path.is_file():
        there = "there is none. Check the path."
        if path.is_dir():
            there = "it is a folder. Name the file in it, such as `model.safetensors`."
        raise StorageError(f"`{path}` must be a file that symoden wrote; {there}")
    if path.stat().st_size > _LARGEST_FILE:
        raise StorageError(f"`{path}` must be smaller than 2 GiB; got {path.stat().st_size} bytes.")
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            header = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    except (safetensors.SafetensorError, OSError, ValueError, TypeError) as error:
        raise StorageError(
            f"`{path}` must be a whole safetensors file; it is truncated or damaged ({error}). Restore or retrain it."
        ) from error
    try:
        signed = json.loads(header[_KEY])
        text, digest = signed["contents"], signed["sha256"]
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(
            f"`{path}` must have been written by symoden; its metadata have no valid entry `{_KEY}`."
        ) from error
    if digest != _digest(arrays, text):
        raise StorageError(f"`{path}` was changed after it was written: its digest differs. Restore or retrain it.")
    return arrays, json.loads(text)


def _digest(arrays: Mapping[str, np.ndarray], text: str) -> str:
    """SHA-256 of the metadata and of every array's name, type, shape and contents."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
