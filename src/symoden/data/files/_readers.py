"""Reading the named columns of a recording, whatever the format of its file."""

import dataclasses
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import polars as pl

from symoden.data._errors import AbsentError, DataError, listing
from symoden.data._shapes import Signals

from ._arrays import STAR, read_hdf5, read_mat, read_npz, starred
from ._cells import holds_lists, label, lists, numbers, texts
from ._limits import refuse_large
from ._memory import Table, in_memory
from ._tables import TEXTS, read_csv, read_parquet
from ._unread_clock import UnreadClock, unread_clocks
from ._unread_inputs import unread_inputs

Selector: TypeAlias = str | tuple[str, ...]  # a 2-D variable (in a table: a column), or a column each

TABLES: Final[dict[str, Callable[[Path], pl.DataFrame]]] = {
    **{ending + packed: read_csv for packed in ("", ".gz") for ending in TEXTS},
    ".parquet": read_parquet,
}
"""What reads tables, by the endings of their names."""
_ARRAYS: Final[dict[str, Callable[[Path, Collection[str]], Mapping[str, np.ndarray]]]] = {
    ".npz": read_npz,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mat": read_mat,
}
_ITEM = re.compile(r"(?P<variable>.+)\[(?P<column>\d+)\]")


class OddNumbers(NamedTuple):
    """Numbers of a column that no machine has.

    Attributes:
        name: Name of the column.
        columns: Columns of the rows that lack them: itself, or those that formulas make of it.
        values: These numbers; NaN for all others (T,).
    """

    name: str
    columns: tuple[str, ...]
    values: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Rows that were read from a file.

    Attributes:
        path: The file.
        index: Rows of the file that were read, counted from 0.
        signals: What was asked for, by role ("positions", …): one column per signal.
        names: Names of these columns, by role.
        labels: Which recording each row belongs to, where a column or an axis tells.
        label: The one that they all belong to, where they were taken apart by these.
        interval: Number of the interval of rows that they are, from 1 on, where the description names several.
        odd: Numbers that no machine has, of columns that formulas are made of.
        clocks: Columns of a table that count time, where none was asked for.
        drives: Columns of a table that are called as inputs are, where none was asked for.
        files: Files that were joined, by what they are called in front of the names of their columns.
    """

    path: Path
    index: np.ndarray
    signals: dict[str, Signals]
    names: dict[str, tuple[str, ...]]
    labels: np.ndarray | None = None
    label: str | None = None
    interval: int | None = None
    odd: tuple[OddNumbers, ...] = ()
    clocks: tuple[UnreadClock, ...] = ()
    drives: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.index)

    def take(self, rows: np.ndarray, label: str | None) -> "Rows":
        """Some of them, those of one recording.

        Args:
            rows: Which of these rows.
            label: What their column says, or the number of the recording, if there are several.

        Returns:
            The rows.
        """
        signals = {role: signal[rows] for role, signal in self.signals.items()}
        odd = tuple(each._replace(values=each.values[rows]) for each in self.odd)
        return dataclasses.replace(self, index=self.index[rows], signals=signals, labels=None, label=label, odd=odd)


def suffix_of(path: Path) -> str:
    """Ending of a file's name that says its format, in lower case; `.csv.gz` is one."""
    endings = [ending for ending in (*TABLES, *_ARRAYS) if path.name.lower().endswith(ending)]
    return max(endings, key=len, default="")


def stem_of(path: Path) -> str:
    """A file's name without the ending that says its format."""
    return path.name[: len(path.name) - len(suffix_of(path))]


def read_rows(
    path: Path,
    selectors: Mapping[str, Selector],
    rows: slice,
    recording: str | None = None,
    *,
    table: Table | None = None,
) -> Rows:
    """Read the columns or variables that selectors name.

    Args:
        path: File of a known format; of a table in memory, what messages call it.
        selectors: What to read, by role.
        rows: Rows to keep; nothing else of the file is looked at.
        recording: Column or variable that tells which recording each row belongs to, if there is one.
        table: The table, where it is in memory.

    Returns:
        The numbers that were asked for; NaN where one is missing.

    Raises:
        AbsentError: If it lacks something.
        DataError: If the file cannot be read, or has anything but numbers there.
    """
    variables = sorted(_variables(selectors, recording))
    if table is None:
        held = held_in(path, variables)
    else:
        held = in_memory(path, table, variables, {*variables, *names_in(selectors)})
    try:
        if isinstance(held, pl.DataFrame):
            found = _from_table(path, held, selectors, rows, recording)
        else:
            found = _from_arrays(path, held, selectors, rows, recording)
    except AbsentError as error:
        if table is None or isinstance(table, Mapping | np.ndarray | pl.DataFrame):
            raise
        hint = " A frame's index is no column: `reset_index()` makes it one."
        raise AbsentError(path, error.name, error.found, kind=error.kind, hint=error.hint + hint) from None
    for signals in found.signals.values():
        signals[~np.isfinite(signals)] = np.nan  # An infinity is no measurement either.
    return found


def _variables(selectors: Mapping[str, Selector], recording: str | None) -> set[str]:
    """Names of the variables that are wanted."""
    return {variable_of(name) for name in [*names_in(selectors), *([recording] if recording else [])]}


def held_in(path: Path, variables: Sequence[str]) -> pl.DataFrame | Mapping[str, np.ndarray]:
    """What a file holds.

    Args:
        path: The file.
        variables: Names of arrays that are wanted, if it holds arrays.

    Returns:
        A table, or these arrays.

    Raises:
        DataError: If it cannot be read.
    """
    suffix = suffix_of(path)
    if not suffix:
        raise DataError(f"`{path}`: the name must end in one of {listing([*TABLES, *_ARRAYS])}. Convert the file.")
    try:
        if path.stat().st_size == 0:
            raise DataError(f"`{path}`: is empty; it must have columns or variables of numbers.")
        return TABLES[suffix](path) if suffix in TABLES else _ARRAYS[suffix](path, variables)
    except OSError as error:
        raise DataError(f"`{path}`: cannot be read: {error.strerror or error}.") from error


def _from_table(
    path: Path, frame: pl.DataFrame, selectors: Mapping[str, Selector], rows: slice, recording: str | None
) -> Rows:
    """Take columns of a table; where a cell holds a list, it is a variable with a column for each item."""
    index = np.arange(frame.height)[rows]
    frame, first = frame[rows], int(index[0]) if len(index) else 0
    wanted = names_in(selectors)
    named = dict.fromkeys(variable_of(name) for name in wanted)
    nested = [name for name in named if name in frame.columns and holds_lists(frame[name])]
    columns = {name: lists(path, frame, name) for name in nested}
    plain = [name for name in wanted if variable_of(name) not in columns]
    columns |= {name: each[:, None] for name, each in numbers(path, frame, plain, first_row=first).items()}
    labels = None if recording is None else texts(path, frame, recording)
    found = _rows_of(path, selectors, columns, index, labels)
    read = {*named, recording or ""}
    if "time" not in selectors:
        found = dataclasses.replace(found, clocks=unread_clocks(path, frame, read))
    return found if selectors.get("inputs") else dataclasses.replace(found, drives=unread_inputs(path, frame, read))


def _from_arrays(
    path: Path, arrays: Mapping[str, np.ndarray], selectors: Mapping[str, Selector], rows: slice, recording: str | None
) -> Rows:
    """Take variables of a file of arrays."""
    if not _variables(selectors, recording) <= arrays.keys():  # They have stars.
        return _from_groups(path, selectors, arrays, rows, recording)
    if any(array.ndim == 3 for array in arrays.values()):
        return _from_blocks(path, selectors, arrays, rows, recording)
    columns = {name: _columns(path, name, array) for name, array in arrays.items()}
    _refuse_mixed_lengths(path, columns)
    index = np.arange(len(next(iter(columns.values()))))[rows]
    columns = {name: array[rows] for name, array in columns.items()}
    labels = None
    if recording is not None:
        labels = np.array(
            [label(x) for x in _single(path, recording, _picked(path, recording, columns))[:, 0].tolist()]
        )
    return _rows_of(path, selectors, columns, index, labels)


def _from_groups(
    path: Path, selectors: Mapping[str, Selector], arrays: Mapping[str, np.ndarray], rows: slice, recording: str | None
) -> Rows:
    """Arrays of a recording each, named by what a star stands for; those whose name has none belong to them all."""
    _refuse_recording(path, "the star in the names of its variables tells recordings apart", recording)
    variables = list(dict.fromkeys(variable_of(name) for name in names_in(selectors)))
    level = "." if suffix_of(path) == ".mat" else "/"  # No star stands for one.
    groups: dict[str, dict[str, np.ndarray]] = {}
    for variable in variables:
        for name, array in arrays.items():
            pattern, path_in = (each.replace(level, "/") for each in (variable, name))
            if variable not in arrays and (group := starred(pattern, path_in)) is not None:
                groups.setdefault(group, {})[variable] = array
    order = sorted(groups, key=_as_counted)
    common = {variable: arrays[variable] for variable in variables if variable in arrays}
    parts: list[Mapping[str, np.ndarray]] = []
    indices: list[np.ndarray] = []
    first = 0
    for group in order:
        found = common | groups[group]
        if absent := [variable for variable in variables if variable not in found]:
            raise AbsentError(path, absent[0].replace(STAR, group), arrays, kind="variable")
        columns = {name: _columns(path, name.replace(STAR, group), array) for name, array in found.items()}
        _refuse_mixed_lengths(path, columns)
        samples = len(next(iter(columns.values())))
        indices.append(first + np.arange(samples)[rows])
        parts.append({name: column[rows] for name, column in columns.items()})
        first += samples
    _refuse_mixed_widths(path, parts)
    merged = {name: np.concatenate([part[name] for part in parts]) for name in variables}
    labels = np.repeat(order, [len(index) for index in indices])
    return _rows_of(path, selectors, merged, np.concatenate(indices), labels)


def _refuse_recording(path: Path, told: str, recording: str | None) -> None:
    """Refuse a column that tells recordings apart where something else does."""
    if recording is not None:
        raise DataError(f"`{path}`: {told}; got `recording` = {recording!r} as well. Leave it out.")


def _as_counted(name: str) -> list[tuple[str, int]]:
    """Key that sorts `demo_2` before `demo_10`."""
    return [(text, int(number or 0)) for text, number in re.findall(r"(\D*)(\d*)", name)]


def _from_blocks(
    path: Path, selectors: Mapping[str, Selector], arrays: Mapping[str, np.ndarray], rows: slice, recording: str | None
) -> Rows:
    """Arrays of several recordings, which their first axis counts; times may be the same for all."""
    _refuse_recording(path, "the first axis of its variables tells recordings apart, numbered from 0", recording)
    empty = [f"`{name}` {array.shape}" for name, array in arrays.items() if 0 in array.shape]
    if empty:
        raise DataError(f"`{path}`: no variable may be empty; got {', '.join(empty)}. Name others.")
    count, samples = next(array.shape[:2] for array in arrays.values() if array.ndim == 3)
    refuse_large(path, 8 * count * samples, "a column of all its recordings")
    blocks: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        if array.ndim in (2, 3) and array.shape[:2] == (count, samples):
            blocks[name] = array.reshape(count, samples, -1)
        elif array.ndim in (1, 2) and array.size == samples:
            blocks[name] = np.broadcast_to(array.reshape(1, samples, 1), (count, samples, 1))
        else:
            raise DataError(
                f"`{path}`: beside variables of {count} recordings of {samples} samples, `{name}` must be ({count}, "
                f"{samples}) or ({count}, {samples}, columns), or ({samples},) for all; got shape {array.shape}. The "
                "first axis counts recordings: transpose or cut it."
            )
    columns = {name: block[:, rows].reshape(-1, block.shape[2]).astype(np.float64) for name, block in blocks.items()}
    index = np.arange(count * samples).reshape(count, samples)[:, rows]
    labels = np.repeat([str(i) for i in range(count)], index.shape[1])
    return _rows_of(path, selectors, columns, index.ravel(), labels)


def _rows_of(
    path: Path,
    selectors: Mapping[str, Selector],
    columns: Mapping[str, np.ndarray],
    index: np.ndarray,
    labels: np.ndarray | None,
) -> Rows:
    """What was read, by role."""
    signals: dict[str, np.ndarray] = {}
    names: dict[str, tuple[str, ...]] = {}
    for role, selector in selectors.items():
        if isinstance(selector, str):
            signals[role] = _picked(path, selector, columns)
            count = signals[role].shape[1]
            names[role] = tuple(f"{selector}[{i}]" for i in range(count)) if count > 1 else (selector,)
        else:
            parts = [_single(path, name, _picked(path, name, columns)) for name in selector]
            signals[role], names[role] = np.concatenate([np.zeros((len(index), 0)), *parts], axis=1), selector
    return Rows(path=path, index=index, signals=signals, names=names, labels=labels)


def names_in(selectors: Mapping[str, Selector]) -> list[str]:
    """Names of all columns and variables that are read, each once.

    Args:
        selectors: What is read, by role.

    Returns:
        The names, in the order of the roles.
    """
    every = (name for each in selectors.values() for name in ([each] if isinstance(each, str) else each))
    return list(dict.fromkeys(every))


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
            f"`{path}`: variable `{name}` must be (samples,), (samples, columns) or (recordings, samples, columns); "
            f"got shape {array.shape}. Store it as one of these."
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


def _refuse_mixed_widths(path: Path, recordings: Sequence[Mapping[str, np.ndarray]]) -> None:
    """Refuse a variable with more columns in one recording than in another."""
    for name in recordings[0]:
        widths = sorted({columns[name].shape[1] for columns in recordings})
        if len(widths) > 1:
            raise DataError(
                f"`{path}`: variable `{name}` must have as many columns in each recording; got {widths[0]} and "
                f"{widths[-1]}. Put those with other columns into a file of their own."
            )


def _picked(path: Path, name: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The columns of `variable`, or the one of `variable[column]`."""
    item = _ITEM.fullmatch(name)
    if item is None or name in columns:
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
            f"`{path}`: variable `{name}` in a list or a formula must be one column; got {signal.shape[1]}. Write "
            f"`{name}[0]`, `{name}[1]`, … for some; for all of them the name without a list's brackets around it."
        )
    return signal
