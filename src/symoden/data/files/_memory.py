"""Tables in memory: what a file of columns or arrays would hold."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
import polars as pl

from symoden.data._errors import DataError

from ._arrays import STAR, chosen, spelt_out
from ._cells import numbers


@runtime_checkable
class _Frame(Protocol):
    """A data frame, of pandas or Polars."""

    @property
    def columns(self) -> Iterable[object]:
        """Names of its columns."""
        ...

    def __getitem__(self, name: str, /) -> object:
        """A column."""
        ...


Table: TypeAlias = Mapping[str, object] | _Frame | np.ndarray
"""Columns by name: a mapping of arrays, a data frame, or a structured array."""


def in_memory(
    path: Path, table: Table, variables: Collection[str], wanted: Collection[str]
) -> pl.DataFrame | dict[str, np.ndarray]:
    """Take columns of a table in memory.

    Args:
        path: What messages call it.
        table: The table.
        variables: Names of the variables that are wanted.
        wanted: The same, and what single columns of variables are called.

    Returns:
        A data frame, where what is wanted are columns of as many rows each, of numbers, words or times: these and all
        others of as many. Else the variables by name.

    Raises:
        DataError: If it is no table, or lacks a variable.
    """
    if isinstance(table, pl.DataFrame) and not _has_stars(wanted, table.columns):
        return table
    columns = _arrays(path, _columns(path, table, wanted), wanted)
    shapes = {array.shape for name, array in columns.items() if name in wanted}
    if len(shapes) == 1 and len(shape := shapes.pop()) == 1 and not _has_stars(wanted, columns):
        return pl.DataFrame([_series(name, array) for name, array in columns.items() if array.shape == shape])
    for name in spelt_out(variables, columns):
        if name in columns:
            columns[name] = _numbers(path, name, columns[name])
    return chosen(path, variables, columns)


def _has_stars(wanted: Collection[str], found: Collection[str]) -> bool:
    """Whether a name stands for several."""
    return any(STAR in name and name not in found for name in wanted)


def _arrays(path: Path, columns: Mapping[str, object], wanted: Collection[str]) -> dict[str, np.ndarray]:
    """The columns as arrays; what is not wanted may be none."""
    arrays: dict[str, np.ndarray] = {}
    for name, values in columns.items():
        try:
            arrays[name] = _array(values)
        except (ValueError, TypeError, RuntimeError) as error:  # Such as of a tensor that is elsewhere.
            if name in wanted:
                raise DataError(f"`{path}`: column `{name}` must be an array of numbers: {error}") from error
    return arrays


def _numbers(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    """An array of numbers, where it is a column of dates, durations or texts, as a data frame's would be."""
    if array.ndim != 1 or array.dtype.kind in "biuf":
        return array
    try:
        return numbers(path, pl.DataFrame([_series(name, array)]), [name], first_row=0)[name]
    except (DataError, pl.exceptions.PolarsError):
        return array  # What it holds will be named.


def _columns(path: Path, table: Any, wanted: Collection[str]) -> dict[str, object]:  # noqa: ANN401 - whatever a user gives
    """The columns by name, whatever holds them; a frame's names may be numbers."""
    if isinstance(table, np.ndarray):
        names = table.dtype.names
    elif isinstance(table, pl.LazyFrame):
        names = None
    else:
        names = table.keys() if isinstance(table, Mapping) else getattr(table, "columns", None)
    if names is None:
        what = f"an array of {table.dtype}" if isinstance(table, np.ndarray) else type(table).__name__
        raise DataError(
            f"`{path}`: a table must be a mapping of names to arrays, or a data frame; got {what}. Give its columns "
            'names, such as {"t": ts, "q": q}; collect what is lazy.'
        )
    every = list(map(str, names))
    if twice := [name for name in every if name in wanted and every.count(name) > 1]:
        raise DataError(f"`{path}`: column `{twice[0]}` must be there once; got it twice. Rename one of them.")
    return dict(zip(every, (table[name] for name in names), strict=True))


def _array(values: object) -> np.ndarray:
    """The values of a column; nothing where a masked array hides one."""
    if isinstance(values, np.ma.MaskedArray):
        if values.dtype.kind in "mM":
            stamps = np.array(values.data)
            stamps[np.ma.getmaskarray(values)] = "NaT"
            return stamps
        numeric = values.dtype.kind in "biuf"
        return np.ma.filled(values.astype(np.float64 if numeric else object), np.nan if numeric else None)
    return np.asarray(values)


def _series(name: str, array: np.ndarray) -> pl.Series:
    """A column of a data frame."""
    if array.dtype.kind == "M":
        array = array.astype("datetime64[ns]")
    elif array.dtype.kind == "m":
        array = array.astype("timedelta64[ns]")
    elif array.dtype.kind == "O":
        cells = [None if _is_absent(value) else value for value in array.tolist()]
        if all(cell is None or isinstance(cell, int | float | np.number | np.bool_) for cell in cells):
            return pl.Series(name, np.array([np.nan if cell is None else cell for cell in cells], np.float64))
        return pl.Series(name, cells, strict=False)
    return pl.Series(name, array)


def _is_absent(value: object) -> bool:
    """Whether an object of a column says that nothing is there, as those of pandas do."""
    return value is None or type(value).__name__ in {"NAType", "NaTType"}
