"""Tables of one recording that are in a file each, such as positions, velocities and torques: joined into one."""

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import polars as pl

from symoden.data._errors import DataError, listing

from ._cells import numbers
from ._readers import TABLES, held_in, stem_of, suffix_of


def name_joined(files: Mapping[str, Path]) -> Path:
    """What messages call files that are joined, and recordings are named after: no file is called so.

    Args:
        files: The files, by the name that the description gives each.

    Returns:
        Names of them all, without endings, in the first one's folder.

    Example:
        >>> str(name_joined({"q": Path("run1/q.csv"), "u": Path("run1/tau.csv")}))
        'run1/q+tau'
    """
    first = next(iter(files.values()))
    return first.with_name("+".join(stem_of(file) for file in files.values()))


def join_tables(files: Mapping[str, Path], *, time: str | None, wanted: Collection[str]) -> pl.DataFrame:
    """Join tables of one recording, row by row; or by time, where rows have other times than those of another table.

    Column `x` of the table that is called `q` becomes `q.x`, and `q` is all its columns but that of times, as a list.
    Times stay what they are called. Where tables have times of their own, rows of the one have nothing in the columns
    of the other, as in a table of several senders.

    Args:
        files: The files, by the name that the description gives each.
        time: Column of time stamps, which each of them has; or as in `q.t` one of them has for all; None if none has.
        wanted: Names of what is read.

    Returns:
        The table.

    Raises:
        DataError: If a file is no table or cannot be read, only some have times, rows that have none differ in number,
            or times by which rows are to be sorted are out of order.
    """
    tables = {name: _read(file) for name, file in files.items()}
    timed = [name for name, table in tables.items() if time in table.columns]
    if not timed or time is None:
        return _beside(files, {name: _labelled(name, files[name], table, wanted) for name, table in tables.items()})
    for name, table in tables.items():
        if name not in timed:
            raise DataError(
                f"`{files[name]}`: must have the column of times `{time}`, as `{files[timed[0]]}` has; found "
                f"{listing(table.columns)}. Rename one; or where rows of all files belong together one by one, write "
                f"`{timed[0]}.{time}`."
            )
    stamps = {name: numbers(files[name], table, [time], first_row=0)[time] for name, table in tables.items()}
    first, *others = stamps.values()
    bare = {name: _labelled(name, files[name], table.drop(time), wanted) for name, table in tables.items()}
    if all(np.array_equal(first, each, equal_nan=True) for each in others):
        return _beside(files, {time: tables[timed[0]].select(time), **bare})
    for name, each in stamps.items():
        _refuse_backwards(files[name], time, each)
    merged = pl.concat(
        [table.with_columns(pl.Series(time, stamps[name])) for name, table in bare.items()], how="diagonal"
    )
    return merged.sort(time, nulls_last=True, maintain_order=True)


def _read(file: Path) -> pl.DataFrame:
    """A file that is a table."""
    table = held_in(file, ()) if suffix_of(file) in TABLES else None
    if not isinstance(table, pl.DataFrame):
        raise DataError(
            f"`{file}`: files that are joined must be tables, whose names end in one of {listing(TABLES)}. Convert it, "
            "or write all arrays into one file."
        )
    return table


def _labelled(name: str, file: Path, table: pl.DataFrame, wanted: Collection[str]) -> pl.DataFrame:
    """A table with its name before those of its columns; and with all of them as one, if that is wanted."""
    labelled = table.rename({column: f"{name}.{column}" for column in table.columns})
    if name not in wanted:
        return labelled
    columns = [column for column in table.columns if f"{name}.{column}" not in wanted]
    each = numbers(file, table, columns, first_row=0)
    together = np.stack([each[column] for column in columns], axis=1) if columns else np.zeros((table.height, 0))
    return labelled.with_columns(pl.Series(name, together.tolist(), dtype=pl.List(pl.Float64)))


def _beside(files: Mapping[str, Path], tables: Mapping[str, pl.DataFrame]) -> pl.DataFrame:
    """Tables whose rows belong together one by one."""
    heights = {name: table.height for name, table in tables.items() if name in files}
    if len(set(heights.values())) > 1:
        rows = ", ".join(f"`{files[name]}` {height}" for name, height in heights.items())
        raise DataError(
            f"Files that are joined without times of their own must have as many rows; got {rows}. Cut them to the "
            "same ones, or name as `time` a column that each of them has."
        )
    return pl.concat(list(tables.values()), how="horizontal")


def _refuse_backwards(file: Path, time: str, stamps: np.ndarray) -> None:
    """Refuse time stamps that decrease: sorted, their fault would no longer be seen."""
    known = stamps[np.isfinite(stamps)]
    back = np.flatnonzero(np.diff(known) < 0)
    if len(back):
        raise DataError(
            f"`{file}`: column `{time}` must not decrease, for it is joined to other files by it; got "
            f"{known[back[0] + 1]:.10g} after {known[back[0]]:.10g}. Sort its rows, or make a file of each recording."
        )
