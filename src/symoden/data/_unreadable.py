"""Files of a description that cannot be read, set apart from those that can."""

import dataclasses
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ._description import Description, Part
from ._errors import DataError
from ._files import find_files
from ._findings import Finding, refusal
from ._readers import suffix_of
from ._survey import read_on_clocks


class Unreadable(NamedTuple):
    """A file that cannot be read, lacks a column or has no rows.

    Attributes:
        part: "train", "test" or "validation".
        path: The file.
        finding: Why training refuses it.
    """

    part: str
    path: Path
    finding: Finding

    @property
    def name(self) -> str:
        """The file's stem, as recordings are named."""
        return self.path.name[: -len(suffix_of(self.path)) or None]


def without_unreadable(
    path: Path, description: Description, is_angle: np.ndarray
) -> tuple[Description, tuple[Unreadable, ...]]:
    """Try the files of a description one by one.

    Args:
        path: The description's file.
        description: What it says.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The same description of those that can be read, without parts that have none; and the others.

    Raises:
        DataError: If a pattern matches no file.
    """
    nothing = dict.fromkeys(description.parts)
    found: list[Unreadable] = []
    kept: dict[str, Part | None] = {}
    for name, part in description.parts.items():
        files = []
        for file in find_files(part.files, path):
            one = dataclasses.replace(part, files=(str(file.resolve()),), recordings=())
            try:
                read_on_clocks(path, dataclasses.replace(description, **(nothing | {name: one})), is_angle)
            except DataError as error:
                found.append(Unreadable(name, file, refusal(error)))
            else:
                files.append(str(file.resolve()))
        kept[name] = dataclasses.replace(part, files=tuple(files)) if files else None
    return dataclasses.replace(description, **kept), tuple(found)
