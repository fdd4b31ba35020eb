"""Rows of the files of each part, taken apart into recordings where a column tells them apart."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ._description import Description, Part
from ._errors import DataError, listing, nearest
from ._files import find_files
from ._readers import Rows, read_rows
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
    every = {name: _read_part(path, description, part) for name, part in description.parts.items()}
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


def _read_part(path: Path, description: Description, part: Part) -> tuple[Rows, ...]:
    """Rows of all files of one part."""
    return tuple(
        recording
        for file in find_files(part.files, path)
        for recording in _apart(
            in_si(
                read_rows(file, description.selectors, slice(*part.rows), description.recording),
                description.units,
                description.zeros,
            )
        )
    )


def _apart(rows: Rows) -> list[Rows]:
    """Rows of each recording, in the order in which they begin."""
    if rows.labels is None or not len(rows):
        return [rows]
    labels, first, inverse = np.unique(rows.labels, return_index=True, return_inverse=True)
    return [rows.take(np.flatnonzero(inverse == i), str(labels[i])) for i in np.argsort(first)]


def _chosen(path: Path, name: str, wanted: Sequence[str], every: Sequence[Rows]) -> tuple[Rows, ...]:
    """The recordings that a part names."""
    found: Mapping[str, None] = dict.fromkeys(rows.label for rows in every if rows.label is not None)
    for label in wanted:
        if label not in found:
            raise DataError(
                f"`{path}`: [{name}] `recordings` must name those of its files; got `{label}`.{nearest(label, found)} "
                f"They have {listing(found)}."
            )
    return tuple(rows for rows in every if rows.label in wanted)
