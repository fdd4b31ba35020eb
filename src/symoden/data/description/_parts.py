"""Rows of the files of each part, taken apart into recordings where a column or an axis tells them apart."""

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from symoden.data._errors import DataError, listing, nearest
from symoden.data.files import Rows, Table, join_tables, name_joined, names_in, place, stem_of, variable_of

from ._description import Description, Part, stands_for
from ._files import find_files, find_joined, find_tables
from ._formulas import read_columns
from ._units import in_si
from ._unreadable import Unreadable


class Parts(NamedTuple):
    """What the files of a description hold, part by part.

    Attributes:
        rows: Rows in SI and rad of each recording of a part, in the order of the files; or why there are none.
        refusals: What the description says of the parts that is not so.
    """

    rows: dict[str, tuple[Rows | Unreadable, ...]]
    refusals: tuple[DataError, ...]


def read_parts(description: Description) -> Parts:
    """Read the files of a description.

    Args:
        description: What it says.

    Returns:
        The rows; that a file cannot be read, or that no file has a recording that is named, is for the caller to raise
        or to report.
    """
    path = description.path
    files = {name: _files(description, name, part) for name, part in description.parts.items()}
    every = {
        name: tuple(each for file in files[name] for each in _recordings_of(description, name, file))
        for name in description.parts
    }
    chosen = {
        name: tuple(one for one in every[name] if isinstance(one, Unreadable) or one.label in part.recordings)
        for name, part in description.parts.items()
        if part.recordings
    }
    where = description.whereabouts
    taken = {(where(one.path), one.label) for part in chosen.values() for one in part if isinstance(one, Rows)}
    rest = {
        name: tuple(one for one in part if isinstance(one, Unreadable) or (where(one.path), one.label) not in taken)
        for name, part in every.items()
    }
    refusals = [
        *(error for name, part in description.parts.items() for error in _unknown(path, part, name, files[name])),
        *(error for name in chosen for error in _absent(path, name, description.parts[name].recordings, every[name])),
        *(
            DataError(
                f"`{path}`: [{name}] must have recordings that no other part names; got none. Name fewer in the others."
            )
            for name, part in rest.items()
            if name not in chosen and not part
        ),
    ]
    return Parts(rest | chosen, tuple(refusals))


class _File(NamedTuple):
    """A file, or a table in memory in its place.

    Attributes:
        path: What messages call it.
        joined: Files that are joined, by what the description calls each, where it stands for these.
    """

    path: Path
    joined: Mapping[str, Path] | None = None


def _files(description: Description, name: str, part: Part) -> tuple[_File | Unreadable, ...]:
    """The files of a part, each once, and its patterns that match none."""
    found: dict[Path, _File | Unreadable] = {}
    for pattern in part.files:
        try:
            for file in _matches(pattern, description):
                if found.setdefault(description.whereabouts(file.path), file) != file and file.joined is not None:
                    raise DataError(
                        f"`{description.path}`: files that are joined must differ by more than their endings; got "
                        f"{listing(map(str, file.joined.values()))} beside others of these names. Rename them."
                    )
        except DataError as error:
            named = Path(pattern if isinstance(pattern, str) else next(iter(pattern.values())))
            found[named] = Unreadable(part=name, name=stem_of(named) or str(named), path=named, error=error)
    return tuple(found.values())


def _matches(pattern: str | Mapping[str, str], description: Description) -> Iterator[_File]:
    """Files, or tables in memory in their place, by name or by pattern."""
    if isinstance(pattern, Mapping) and description.tables is not None:
        raise DataError(
            f"`{description.path}`: files are joined, tables in memory are not; got {listing(pattern)}. Give one table "
            "for each recording, such as of `pandas.merge`."
        )
    if isinstance(pattern, Mapping):
        yield from (_File(name_joined(files), files) for files in find_joined(pattern, description.path))
    elif description.tables is None:
        yield from map(_File, find_files(pattern, description.path))
    else:
        yield from map(_File, find_tables(pattern, description.path, description.tables))


def _recordings_of(description: Description, name: str, file: _File | Unreadable) -> Sequence[Rows | Unreadable]:
    """Rows of each recording of a file, or why it has none."""
    if isinstance(file, Unreadable):
        return [file]
    intervals = description.parts[name].rows_of(file.path)
    try:
        table = _table_of(file, description)
        read = [_read(file, table, description, slice(*each)) for each in intervals]
        if not description.parts[name].recordings:  # Else other files may have them.
            _refuse_absent(description, name, read, lambda: len(_read(file, table, description, slice(None))))
        _refuse_repeated(description.path, name, read)
        scaled = [in_si(each, description.units, description.zeros) for each in read]
        numbered = [
            dataclasses.replace(rows, interval=k if len(read) > 1 else None) for k, rows in enumerate(scaled, start=1)
        ]
        return [one for rows in numbered for one in _apart(rows, description.recording)]
    except DataError as error:
        return [Unreadable(part=name, name=stem_of(file.path), path=file.path, error=error)]


def _table_of(file: _File, description: Description) -> Table | None:
    """What is in memory of a file, if something is."""
    if file.joined is not None:
        names = names_in(description.selectors)
        parts = [each for formula in description.formulas.values() for each in formula.names]
        whole = {variable_of(each) for each in (*names, *parts)} & set(file.joined)
        wanted = {*names, *whole}
        return join_tables(file.joined, time=description.time, recording=description.recording, wanted=wanted)
    return None if description.tables is None else description.tables[str(file.path)]


def _read(file: _File, table: Table | None, description: Description, rows: slice) -> Rows:
    """What the description names of a file."""
    found = read_columns(
        file.path,
        description.selectors,
        rows,
        recording=description.recording,
        formulas=description.formulas,
        table=table,
    )
    return dataclasses.replace(found, files=file.joined or {})


def _unknown(path: Path, part: Part, name: str, files: Sequence[_File | Unreadable]) -> Iterator[DataError]:
    """Rows of files that the part does not have."""
    named = [file.path for file in files]
    for pattern in part.rows:
        if not any(stands_for(pattern, file) for file in named):
            known = dict.fromkeys(file.name for file in named)
            yield DataError(
                f"`{path}`: [{name}] `rows` must be of files that the part has; got `{pattern}`."
                f"{nearest(pattern, known)} It has {listing(known)}."
            )


def _refuse_absent(
    description: Description, name: str, intervals: Sequence[Rows], count_all: Callable[[], int]
) -> None:
    """Refuse intervals that a file has no rows in."""
    for (start, stop), rows in zip(description.parts[name].rows_of(intervals[0].path), intervals, strict=True):
        if not len(rows) and (start, stop) != (0, None):
            raise DataError(
                f"`{description.path}`: [{name}] `rows` must be rows of each of its files; `{rows.path}` has "
                f"{count_all()}, and none of them is in {[start] if stop is None else [start, stop]}. Name others, or "
                "copy the file again if it was cut off."
            )


def _refuse_repeated(path: Path, name: str, intervals: Sequence[Rows]) -> None:
    """Refuse rows of a file that are in two of the intervals that a part names."""
    for one, other in itertools.combinations(intervals, 2):
        twice = np.intersect1d(one.index, other.index)
        if len(twice):
            raise DataError(
                f"`{path}`: [{name}] `rows` must be intervals without rows in common; rows {twice[0]} to {twice[-1]} "
                f"of `{one.path}` are in two of them."
            )


def _apart(rows: Rows, recording: str | None) -> list[Rows]:
    """Rows of each recording, in the order in which they begin."""
    if rows.labels is None or not len(rows):
        return [rows]
    labels, first, inverse = np.unique(_filled(rows, recording), return_index=True, return_inverse=True)
    ends = np.cumsum(np.bincount(inverse))[:-1]
    members = np.split(np.argsort(inverse, kind="stable"), ends)
    return [rows.take(members[i], str(labels[i])) for i in np.argsort(first)]


def _filled(rows: Rows, recording: str | None) -> np.ndarray:
    """Labels of rows; one that lacks it, and a number too, belongs to the recording of the row before it."""
    labels = np.asarray(rows.labels)
    empty = labels == ""
    whole = np.isfinite(np.concatenate(list(rows.signals.values()), axis=1)).all(axis=1)
    bad = np.flatnonzero(empty & whole)
    if len(bad) or empty.all():
        where = place(rows.path, int(rows.index[bad[0] if len(bad) else 0]))
        raise DataError(
            f"`{rows.path}`: column `{recording}`, {where}: must say which recording the row belongs to; got nothing. "
            "Fill it in, or leave the row out by `rows`."
        )
    last = np.maximum.accumulate(np.where(empty, 0, np.arange(len(labels))))
    last[last == 0] = np.flatnonzero(~empty)[0] if empty[0] else 0
    return labels[last]


def _absent(path: Path, name: str, wanted: Sequence[str], every: Sequence[Rows | Unreadable]) -> Iterator[DataError]:
    """Recordings that a part names and none of its files has, where all of these can be read."""
    if any(isinstance(one, Unreadable) for one in every):
        return  # It may have them.
    rows = [one for one in every if isinstance(one, Rows)]
    found: Mapping[str, None] = dict.fromkeys(one.label for one in rows if one.label is not None)
    if not found and any(len(one) for one in rows):
        yield DataError(
            f"`{path}`: [{name}] `recordings` are told apart by a column, a star in names of variables, or the first "
            'of three axes of arrays; got none of them. Name the column: `recording = "trial"` before the tables.'
        )
        return
    for label in wanted:
        if label not in found:
            yield DataError(
                f"`{path}`: [{name}] `recordings` must name those of its files; got `{label}`.{nearest(label, found)} "
                f"They have {listing(found)}."
            )
