"""The table [known] of a description: parts of the mechanism that are given."""

from pathlib import Path
from typing import Final

from symoden.known import PARTS, KnownParts

from ._errors import DataError, listing, nearest

_KEYS: Final = (*PARTS, "constants", "parameters", "correct")


def read_known(path: Path, table: object) -> KnownParts:
    """Read the table [known].

    Args:
        path: The description, for messages.
        table: What TOML made of the table.

    Returns:
        The given parts.

    Raises:
        DataError: If a key is unknown or a value is unfit.
    """
    if not isinstance(table, dict):
        raise DataError(f"`{path}`: [known] must be a table; got {table!r}.")
    for key in table:
        if key not in _KEYS:
            raise DataError(
                f"`{path}`: [known] has no key `{key}`.{nearest(key, _KEYS)} The keys are {listing(_KEYS)}."
            )
    for key in ("constants", "parameters"):
        if not isinstance(table.get(key, {}), dict):
            raise DataError(f"`{path}`: [known.{key}] must be a table of names and numbers; got {table[key]!r}.")
    correct = table.get("correct", [])
    if not isinstance(correct, list) or not all(isinstance(name, str) for name in correct):
        raise DataError(f"`{path}`: [known] `correct` must be a list of names of parts; got {correct!r}.")
    try:
        return KnownParts(**{**table, "correct": tuple(correct)})
    except ValueError as error:
        raise DataError(f"`{path}`: [known] {error}") from None
