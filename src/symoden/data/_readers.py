"""Reading the named columns of a recording, whatever the format of its file."""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
import polars as pl

from ._arrays import read_hdf5, read_mat, read_npz
from ._errors import DataError, listing
from ._shapes import Signals
from ._tables import TEXTS, numbers, read_csv, read_parquet

Selector: TypeAlias = str | tuple[str, ...]  # a 2-D variable (in a table: a column), or a column each

_TABLES: Final[dict[str, Callable[[Path], pl.DataFrame]]] = {
    **{ending + packed: read_csv for packed in ("", ".gz") for ending in TEXTS},
    ".parquet": read_parquet,
}
_ARRAYS: Final[dict[str, Callable[[Path, Collection[str]], Mapping[str, np.ndarray]]]] = {
    ".npz": read_npz,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mat": read_mat,
}
_ITEM = re.compile(r"(?P<variable>.+)\[(?P<column>\d+)\]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Rows that were read from a file.

    Attributes:
        path: The file.
        start: Its first row that was read, counted from 0.
        stop: The row after the last one that was read.
        signals: What was asked for, by role ("positions", …): one column per signal.
        names: Names of these columns, by role.
    """

    path: Path
    start: int
    stop: int
    signals: dict[str, Signals]
    names: dict[str, tuple[str, ...]]

    def __len__(self) -> int:
        """Number of rows."""
        return self.stop - self.start


def suffix_of(path: Path) -> str:
    """Ending of a file's name that says its format, in lower case; `.csv.gz` is one."""
    endings = [ending for ending in (*_TABLES, *_ARRAYS) if path.name.lower().endswith(ending)]
    return max(endings, key=len, default="")


def read_rows(path: Path, selectors: Mapping[str, Selector], rows: slice) -> Rows:
    """Read the columns or variables that selectors name.

    Args:
        path: File of a known format.
        selectors: What to read, by role.
        rows: Rows to keep; nothing else of the file is looked at.

    Returns:
        The numbers that were asked for; NaN where one is missing.

    Raises:
        DataError: If the file cannot be read, lacks something, or has anything but numbers there.
    """
    suffix = suffix_of(path)
    if not suffix:
        raise DataError(f"`{path}`: the name must end in one of {listing([*_TABLES, *_ARRAYS])}. Convert the file.")
    try:
        if path.stat().st_size == 0:
            raise DataError(f"`{path}`: is empty; it must have columns or variables of numbers.")
        found = _from_table(path, selectors, rows) if suffix in _TABLES else _from_arrays(path, selectors, rows)
    except OSError as error:
        raise DataError(f"`{path}`: cannot be read: {error.strerror or error}.") from error
    for signals in found.signals.values():
        signals[~np.isfinite(signals)] = np.nan  # An infinity is no measurement either.
    return found


def _from_table(path: Path, selectors: Mapping[str, Selector], rows: slice) -> Rows:
    """Read columns of a table."""
    frame = _TABLES[suffix_of(path)](path)
    start, stop, _ = rows.indices(frame.height)
    stop = max(start, stop)
    frame = frame.slice(start, stop - start)
    names = {role: (selector,) if isinstance(selector, str) else selector for role, selector in selectors.items()}
    columns = {name: numbers(path, frame, name, first_row=start) for each in names.values() for name in each}
    signals = {
        role: np.stack([columns[name] for name in each], axis=1) if each else np.zeros((stop - start, 0))
        for role, each in names.items()
    }
    return Rows(path=path, start=start, stop=stop, signals=signals, names=names)


def _from_arrays(path: Path, selectors: Mapping[str, Selector], rows: slice) -> Rows:
    """Read variables of a file of arrays."""
    wanted = {role: (selector,) if isinstance(selector, str) else selector for role, selector in selectors.items()}
    variables = {variable_of(name) for names in wanted.values() for name in names}
    arrays = _ARRAYS[suffix_of(path)](path, sorted(variables))
    columns = {name: _columns(path, name, array) for name, array in arrays.items()}
    _refuse_mixed_lengths(path, columns)
    length = len(next(iter(columns.values())))
    signals: dict[str, np.ndarray] = {}
    names: dict[str, tuple[str, ...]] = {}
    for role, selector in selectors.items():
        if isinstance(selector, str):
            signals[role] = _picked(path, selector, columns)
            count = signals[role].shape[1]
            names[role] = tuple(f"{selector}[{i}]" for i in range(count)) if count > 1 else (selector,)
        else:
            parts = [_single(path, name, _picked(path, name, columns)) for name in selector]
            signals[role], names[role] = np.concatenate([np.zeros((length, 0)), *parts], axis=1), selector
    start, stop, _ = rows.indices(length)
    stop = max(start, stop)
    signals = {role: signal[start:stop] for role, signal in signals.items()}
    return Rows(path=path, start=start, stop=stop, signals=signals, names=names)


def variable_of(name: str) -> str:
    """Name of the variable of `variable[column]`, or the plain name itself."""
    item = _ITEM.fullmatch(name)
    return item["variable"] if item else name


def _columns(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    """A variable as one column per signal; a single row is a column."""
    if array.ndim == 1 or (array.ndim == 2 and array.shape[0] == 1):  # a vector, a table
        return array.reshape(-1, 1).astype(np.float64)
    if array.ndim != 2:
        raise DataError(
            f"`{path}`: variable `{name}` must be (samples,) or (samples, columns); got shape {array.shape}. "
            "Store one recording per file, or one after the other."
        )
    return array.astype(np.float64)


def _refuse_mixed_lengths(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Refuse variables that differ in their number of samples."""
    if len({len(array) for array in columns.values()}) > 1:
        lengths = ", ".join(f"`{name}` {' × '.join(map(str, array.shape))}" for name, array in columns.items())
        raise DataError(
            f"`{path}`: all variables must have the same number of samples, along their first axis; got {lengths}. "
            "Transpose or cut them."
        )


def _picked(path: Path, name: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The columns of `variable`, or the one of `variable[column]`."""
    item = _ITEM.fullmatch(name)
    if item is None:
        return columns[name]
    array, index = columns[item["variable"]], int(item["column"])
    if index >= array.shape[1]:
        raise DataError(
            f"`{path}`: variable `{item['variable']}` must have a column {index} (counted from 0); "
            f"got {array.shape[1]} column{'s' if array.shape[1] > 1 else ''}."
        )
    return array[:, index : index + 1]


def _single(path: Path, name: str, signal: np.ndarray) -> np.ndarray:
    """A variable of a list, which must be one column."""
    if signal.shape[1] != 1:
        raise DataError(
            f"`{path}`: variable `{name}` in a list must be one column; got {signal.shape[1]}. Write the name without "
            f"brackets around it for all of them, or `{name}[0]`, `{name}[1]`, … for some."
        )
    return signal
