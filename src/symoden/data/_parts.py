"""Rows of the files of each part, taken apart into recordings where a column or an axis tells them apart."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ._description import Description, Part
from ._errors import DataError, listing, nearest
from ._files import find_files
from ._formulas import read_columns
from ._readers import Rows
from ._tables import place
from ._units import in_si


def read_parts(path: Path, description: Description) -> dict[str, tuple[Rows, ...]]:
    """Read the files of a description.

    Args:
        path: The description's file.
        description: What it says.

    Returns:
        Rows in SI and rad of each recording, by part, in the order of the files.

    Raises:
        DataError: If a file cannot be read, lacks a column, or no file has a recording that is named.
    """
    every = {name: _read_part(path, description, name) for name in description.parts}
    chosen = {
        name: _chosen(path, name, part.recordings, every[name])
        for name, part in description.parts.items()
        if part.recordings
    }
    taken = {(rows.path.resolve(), rows.label) for part in chosen.values() for rows in part}
    rest = {
        name: tuple(rows for rows in part if (rows.path.resolve(), rows.label) not in taken)
        for name, part in every.items()
    }
    for name, part in rest.items():
        if name not in chosen and not part:
            raise DataError(
                f"`{path}`: [{name}] must have recordings that no other part names; got none. Name fewer in the others."
            )
    return rest | chosen


def _read_part(path: Path, description: Description, name: str) -> tuple[Rows, ...]:
    """Rows of all files of one part."""
    part, found = description.parts[name], []
    files = find_files(part.files, path)
    _refuse_unknown(path, part, name, files)
    for file in files:
        intervals = part.rows_of(file)
        read = [_read(file, description, slice(*each)) for each in intervals]
        _refuse_absent(path, description, name, read)
        _refuse_repeated(path, name, read)
        for k, each in enumerate(read, start=1):
            rows = in_si(each, description.units, description.zeros)
            numbered = dataclasses.replace(rows, interval=k if len(read) > 1 else None)
            found.extend(_apart(numbered, description.recording))
    return tuple(found)


def _read(file: Path, description: Description, rows: slice) -> Rows:
    """What the description names of a file."""
    return read_columns(
        file, description.selectors, rows, recording=description.recording, formulas=description.formulas
    )


def _refuse_unknown(path: Path, part: Part, name: str, files: Sequence[Path]) -> None:
    """Refuse rows of files that the part does not have."""
    for pattern in part.rows:
        if not any(file.match(pattern) for file in files):
            known = dict.fromkeys(file.name for file in files)
            raise DataError(
                f"`{path}`: [{name}] `rows` must be of files that the part has; got `{pattern}`."
                f"{nearest(pattern, known)} It has {listing(known)}."
            )


def _refuse_absent(path: Path, description: Description, name: str, intervals: Sequence[Rows]) -> None:
    """Refuse intervals that a file has no rows in, unless the part names recordings, which other files may have."""
    part = description.parts[name]
    for (start, stop), rows in zip(part.rows_of(intervals[0].path), intervals, strict=True):
        if not len(rows) and (start, stop) != (0, None) and not part.recordings:
            whole = _read(rows.path, description, slice(None))
            raise DataError(
                f"`{path}`: [{name}] `rows` must be rows of each of its files; `{rows.path}` has {len(whole)}, and "
                f"none of them is in {[start] if stop is None else [start, stop]}. Name others."
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


def _chosen(path: Path, name: str, wanted: Sequence[str], every: Sequence[Rows]) -> tuple[Rows, ...]:
    """The recordings that a part names."""
    found: Mapping[str, None] = dict.fromkeys(rows.label for rows in every if rows.label is not None)
    if not found and any(len(rows) for rows in every):
        raise DataError(
            f"`{path}`: [{name}] `recordings` are told apart by a column, a star in names of variables, or the first "
            'of three axes of arrays; got none of them. Name the column: `recording = "trial"` before the tables.'
        )
    for label in wanted:
        if label not in found:
            raise DataError(
                f"`{path}`: [{name}] `recordings` must name those of its files; got `{label}`.{nearest(label, found)} "
                f"They have {listing(found)}."
            )
    return tuple(rows for rows in every if rows.label in wanted)
