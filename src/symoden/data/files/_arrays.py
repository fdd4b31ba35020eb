"""Reading files of named arrays: NPZ, HDF5 and MAT. None of them runs code, follows links or trusts a claimed size."""

import math
import re
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from symoden.data._errors import COPY, AbsentError, DataError

from ._limits import refuse_large
from ._mat import read_mat5

if TYPE_CHECKING:
    import h5py

_HEADER = 128  # bytes of a MAT file that say its version
_REAL = "biuf"

STAR: Final = "*"  # In a variable's name it stands for the name of a recording.


def read_npz(path: Path, names: Collection[str]) -> Mapping[str, np.ndarray]:
    """Read variables of NumPy's archive without unpickling anything.

    Args:
        path: File.
        names: The variables; a star stands for any text without slashes.

    Returns:
        The variables by name.

    Raises:
        AbsentError: If a variable is absent.
        DataError: If the file is broken, or a variable is not numeric.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            names = spelt_out(names, members)
            for name in names:
                if name not in members:
                    raise AbsentError(path, name, members, kind="variable")
                refuse_large(path, members[name].file_size, f"variable `{name}`")
            return {name: _read_npy(path, archive, members[name]) for name in names}
    except DataError:
        raise
    except Exception as error:  # A broken archive can fail anywhere in the parsers.
        raise DataError(_broken(path, "NPZ", error)) from error


def read_hdf5(path: Path, names: Collection[str]) -> Mapping[str, np.ndarray]:
    """Read data sets of an HDF5 file, by their path in it (`group/name`).

    Args:
        path: File.
        names: The data sets; a star stands for any text without slashes.

    Returns:
        The data sets by name.

    Raises:
        DataError: If h5py is not installed, the file is broken, or a data set is absent, not numeric or elsewhere.
    """
    try:
        import h5py  # optional
    except ImportError as error:
        raise DataError(
            f"`{path}`: HDF5 files (.h5, .hdf5 and .mat of version 7.3) need h5py. Install symoden[data]."
        ) from error
    try:
        with h5py.File(path, "r") as file:
            names = spelt_out(names, [each for name in names if STAR in name for each in _spelt_out_in(file, name)])
            return {name: _read_hdf5_dataset(path, file, name) for name in names}
    except DataError:
        raise
    except Exception as error:  # A broken file can fail anywhere in the library.
        raise DataError(_broken(path, "HDF5", error)) from error


def read_mat(path: Path, names: Collection[str]) -> Mapping[str, np.ndarray]:
    """Read variables of a MATLAB file, version 5 to 7.3.

    Args:
        path: File.
        names: The variables; fields of structs behind points. A star stands for any text in one of version 7.3.

    Returns:
        The variables by name, with MATLAB's axes.

    Raises:
        DataError: If the file is broken, or a variable is absent or not numeric.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER)
    if header.startswith(b"MATLAB 7.3"):
        places = {name: name.replace(".", "/") for name in names}  # A struct is a group of HDF5.
        arrays = read_hdf5(path, list(places.values()))
        written = {place: name for name, place in places.items()}  # Those of a star are not among them.
        return {written.get(at, at.replace("/", ".")): _time_first(array.T) for at, array in arrays.items()}
    try:
        return {name: _time_first(array) for name, array in read_mat5(path, names).items()}
    except DataError:
        raise
    except Exception as error:  # A broken file can fail anywhere in the parser.
        raise DataError(_broken(path, "MAT", error)) from error


def chosen(path: Path, names: Collection[str], found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Choose variables of those in memory.

    Args:
        path: What messages call what holds them.
        names: The variables; a star stands for any text without slashes.
        found: Those that there are.

    Returns:
        The variables by name.

    Raises:
        AbsentError: If a variable is absent.
        DataError: If one is not numeric.
    """
    names = spelt_out(names, found)
    for name in names:
        if name not in found:
            raise AbsentError(path, name, found, kind="variable")
    return {name: _numeric(path, name, found[name]) for name in names}


def spelt_out(names: Collection[str], found: Collection[str]) -> list[str]:
    """Replace names that have a star by those that they stand for.

    Args:
        names: Names of variables, some with a star.
        found: Those that there are.

    Returns:
        The names; one that stands for none, or that a variable has with its star, as it is.
    """
    every: list[str] = []
    for name in names:
        plain = STAR not in name or name in found
        every.extend([name] if plain else [each for each in found if starred(name, each) is not None] or [name])
    return list(dict.fromkeys(every))


def starred(pattern: str, name: str) -> str | None:
    """What the stars of a pattern stand for in a name.

    Args:
        pattern: Name of variables, with a star or several for the same text.
        name: Name of one.

    Returns:
        The text, without slashes; None where the name is not of the pattern.
    """
    first, *rest = (re.escape(part) for part in pattern.split(STAR))
    again = r"(?P=recording)"
    found = re.fullmatch(f"{first}(?P<recording>[^/]+){again.join(rest)}", name)
    return None if found is None else found["recording"]


def _time_first(array: np.ndarray) -> np.ndarray:
    """Columns n × 1 × T, as Simulink logs vectors, as T × n; another array as it is."""
    return array[:, 0, :].T if array.ndim == 3 and array.shape[1] == 1 < array.shape[2] else array


def _read_npy(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    """One array of an archive, once its header agrees with its size."""
    name = info.filename.removesuffix(".npy")
    with archive.open(info) as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
    if dtype.kind not in _REAL:
        raise DataError(f"`{path}`: variable `{name}` must hold real numbers; got {dtype}. Objects are never loaded.")
    claimed = math.prod(shape) * dtype.itemsize
    if claimed > info.file_size:
        raise DataError(
            f"`{path}`: variable `{name}` must have the {claimed} bytes that its header claims; got {info.file_size}. "
            f"{COPY}"
        )
    with archive.open(info) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _read_hdf5_dataset(path: Path, file: "h5py.File", name: str) -> np.ndarray:
    """One data set, if its numbers are in this file."""
    import h5py  # optional

    link = file.get(name, getlink=True) if name in file else None
    if isinstance(link, h5py.ExternalLink):
        raise DataError(f"`{path}`: variable `{name}` must be in this file; got a link to `{link.filename}`.")
    dataset = file[name] if link is not None else None
    if not isinstance(dataset, h5py.Dataset):
        raise AbsentError(path, name, _datasets(file), kind="variable")
    if dataset.is_virtual or dataset.external or Path(dataset.file.filename) != Path(file.filename):
        raise DataError(f"`{path}`: variable `{name}` must be in this file; got one that is stored in another.")
    refuse_large(path, 8 * math.prod(dataset.shape or ()), f"variable `{name}`")
    return _numeric(path, name, dataset[()])


def _spelt_out_in(group: "h5py.Group", name: str) -> list[str]:
    """Paths of the data sets that a name with stars may stand for, behind links within the file too.

    A group that has two names is one recording; a clock that all have is everyone's.

    Returns:
        The paths from the group on.
    """
    import h5py  # optional

    first, slash, rest = name.partition("/")
    if not first and slash:  # From the file's root, as all are.
        return [slash + each for each in _spelt_out_in(group, rest)]
    keys = [key for key in map(str, group) if starred(first, key) is not None] if STAR in first else [first]
    inside = [key for key in keys if not isinstance(group.get(key, getlink=True), h5py.ExternalLink)]
    items = {key: group.get(key) for key in inside}
    if not slash:
        return [key for key, item in items.items() if isinstance(item, h5py.Dataset)]
    groups: dict[h5py.Group, str] = {}
    for key, at in items.items():
        if isinstance(at, h5py.Group):
            groups.setdefault(at, key)
    return [f"{key}/{each}" for at, key in groups.items() for each in _spelt_out_in(at, rest)]


def _datasets(file: "h5py.File") -> list[str]:
    """Paths of all data sets of a file, but for those behind links."""
    import h5py  # optional

    found: list[str] = []
    file.visititems(lambda key, item: found.append(key) if isinstance(item, h5py.Dataset) else None)
    return found


def _numeric(path: Path, name: str, values: object) -> np.ndarray:
    """The values, if they are an array of real numbers."""
    if not isinstance(values, np.ndarray | np.generic) or values.dtype.kind not in _REAL:
        kind = values.dtype if isinstance(values, np.ndarray | np.generic) else type(values).__name__
        raise DataError(f"`{path}`: variable `{name}` must hold real numbers; got {kind}.")
    return np.asarray(values)


def _broken(path: Path, kind: str, error: Exception) -> str:
    """Message for a file that its parser could not read."""
    reason = (str(error) or type(error).__name__).splitlines()[0]
    return f"`{path}`: must be a complete {kind} file; reading stopped at: {reason.removesuffix('.')}. {COPY}"
