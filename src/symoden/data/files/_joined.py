"""Tables of one recording that are in a file each, such as positions, velocities and torques: joined into one."""

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from symoden.data._errors import DataError, listing

from ._cells import holds_lists, numbers
from ._readers import TABLES, held_in, stem_of, suffix_of
from ._unread_clock import unread_clocks

_SAME: Final = 1e-3  # Of a step between rows: times that differ by no more are the same.


def name_joined(files: Mapping[str, Path]) -> Path:
    """What messages call files that are joined, and recordings are named after: no file is called so.

    Args:
        files: The files, by the name that the description gives each.

    Returns:
        Names of them all, without endings, in the first one's folder; with folders where these differ.

    Example:
        >>> str(name_joined({"q": Path("run1/q.csv"), "u": Path("run1/tau.csv")}))
        'run1/q+tau'
        >>> str(name_joined({"q": Path("q/run1.csv"), "u": Path("tau/run1.csv")}))
        'q/run1+tau-run1'
    """
    first = next(iter(files.values()))

    def named(file: Path) -> str:
        above = Path(os.path.relpath(file.parent, first.parent)).parts
        return "-".join([*(folder for folder in above if folder not in (".", "..")), stem_of(file)])

    return first.with_name("+".join(map(named, files.values())).replace(".", "_"))  # Nor one of a known format.


def join_tables(
    files: Mapping[str, Path], *, time: str | None, recording: str | None, wanted: Collection[str]
) -> pl.DataFrame:
    """Join tables of one recording, row by row; or by time, where rows have other times than those of another table.

    Column `x` of the table that is called `q` becomes `q.x`, and `q` is all its columns but those of times and of
    recordings, and those that are wanted by their own names, as a list. Times stay what they are called. Where tables
    have times of their own, rows of the one have nothing in the columns of the other, as in a table of several senders.

    Args:
        files: The files, by the name that the description gives each.
        time: Column of time stamps, which each of them has; or as in `q.t` one of them has for all; None if none has.
        recording: Column that tells which recording a row belongs to, if there is one.
        wanted: Names of what else is read.

    Returns:
        The table.

    Raises:
        DataError: If a file is no table or cannot be read, only some have times, rows that have none differ in number,
            or times by which rows are to be sorted are out of order.
    """
    if time in files:
        raise DataError(f"A file that is joined must not be called as the column of times is, `{time}`. Rename it.")
    tables = {name: _read(file) for name, file in files.items()}
    apart = {*wanted, recording or ""}
    timed = [name for name, table in tables.items() if time in table.columns]
    if not timed or time is None:
        return _beside(files, [_labelled(name, files[name], tables[name], time, apart) for name in files])
    for name, table in tables.items():
        if name not in timed:
            raise DataError(
                f"`{files[name]}`: must have the column of times `{time}`, as `{files[timed[0]]}` has; found "
                f"{listing(table.columns)}. Rename one; or where rows of all files belong together one by one, write "
                f"`{timed[0]}.{time}`."
            )
    stamps = {name: numbers(files[name], table, [time], first_row=0)[time] for name, table in tables.items()}
    bare = {name: table.drop(time) for name, table in tables.items()}
    common = _common(list(stamps.values()))
    if common is not None:
        labelled = [_labelled(name, files[name], table, time, apart) for name, table in bare.items()]
        return _beside(files, [pl.DataFrame({time: common}), *labelled])
    for name, each in stamps.items():
        _refuse_backwards(files[name], time, each)
    merged = pl.concat(
        [
            _labelled(name, files[name], _checked(name, files[name], table, wanted), time, apart).with_columns(
                pl.Series(time, stamps[name])
            )
            for name, table in bare.items()
        ],
        how="diagonal_relaxed",
    )
    return merged.sort(time, nulls_last=True, maintain_order=True)


def _common(stamps: Sequence[np.ndarray]) -> np.ndarray | None:
    """Times of rows that belong together, where all files have as many and the same, as far as these are known."""
    if len({len(each) for each in stamps}) > 1:
        return None
    every = np.stack(stamps)
    known = np.isfinite(every)
    common = every[np.argmax(known, axis=0), np.arange(every.shape[1])]
    steps = np.abs(np.diff(common[np.isfinite(common)]))
    near = _SAME * float(np.median(steps)) if len(steps) else 0.0
    return common if (np.abs(every - common)[known] <= near).all() else None


def _read(file: Path) -> pl.DataFrame:
    """A file that is a table."""
    table = held_in(file, ()) if suffix_of(file) in TABLES else None
    if not isinstance(table, pl.DataFrame):
        raise DataError(
            f"`{file}`: files that are joined must be tables, whose names end in one of {listing(TABLES)}. Convert it, "
            "or write all arrays into one file."
        )
    return table


def _checked(name: str, file: Path, table: pl.DataFrame, wanted: Collection[str]) -> pl.DataFrame:
    """A table whose columns that are read are numbers: once it is merged, no message could say where they are not."""
    named = [column for column in table.columns if f"{name}.{column}" in wanted and not holds_lists(table[column])]
    return table.with_columns(pl.Series(key, each) for key, each in numbers(file, table, named, first_row=0).items())


def _labelled(name: str, file: Path, table: pl.DataFrame, time: str | None, wanted: Collection[str]) -> pl.DataFrame:
    """A table with its name before those of its columns; and with all of them as one, if that is wanted."""
    labelled = table.rename({column: f"{name}.{column}" for column in table.columns})
    if name not in wanted:
        return labelled
    clocks = {each.name for each in unread_clocks(file, table, ())} if time is None else {str(time).partition(".")[2]}
    columns = [column for column in table.columns if column not in clocks and f"{name}.{column}" not in wanted]
    each = numbers(file, table, columns, first_row=0)
    together = np.stack([each[column] for column in columns], axis=1) if columns else np.zeros((table.height, 0))
    return labelled.with_columns(pl.Series(name, together.tolist(), dtype=pl.List(pl.Float64)))


def _beside(files: Mapping[str, Path], tables: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Tables whose rows belong together one by one, those of the files last."""
    heights = [table.height for table in tables[-len(files) :]]
    if len(set(heights)) > 1:
        rows = ", ".join(f"`{file}` {height}" for file, height in zip(files.values(), heights, strict=True))
        raise DataError(
            f"Files that are joined without times of their own must have as many rows; got {rows}. Cut them to the "
            "same ones, or name as `time` a column that each of them has."
        )
    return pl.concat(tables, how="horizontal")


def _refuse_backwards(file: Path, time: str, stamps: np.ndarray) -> None:
    """Refuse time stamps that decrease: sorted, their fault would no longer be seen."""
    known = stamps[np.isfinite(stamps)]
    back = np.flatnonzero(np.diff(known) < 0)
    if len(back):
        raise DataError(
            f"`{file}`: column `{time}` must not decrease, for it is joined to other files by it; got "
            f"{known[back[0] + 1]:.10g} after {known[back[0]]:.10g}. Sort its rows, or make a file of each recording."
        )
