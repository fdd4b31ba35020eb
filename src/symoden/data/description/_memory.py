"""Descriptions and tables in memory."""

from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np

from symoden.data._errors import DataError
from symoden.data.files import Table, suffix_of
from symoden.known import KnownParts

IN_MEMORY: Final = Path("description")
"""What messages call a description in memory. Files that it names are looked for in the working directory."""


def as_toml(value: Any) -> Any:  # noqa: ANN401 - a TOML value, to be checked
    """A value as a TOML file would give it: lists for tuples and arrays, texts for paths.

    Args:
        value: Anything; what TOML does not know stays as it is, and will be refused.

    Returns:
        The value.

    Example:
        >>> as_toml({"positions": ("q",), "input_matrix": np.eye(1), "dt": np.float64(0.01)})
        {'positions': ['q'], 'input_matrix': [[1.0]], 'dt': 0.01}
    """
    match value:
        case KnownParts() | str() | bytes():
            return value
        case Mapping():
            return {str(key): as_toml(inner) for key, inner in value.items()}
        case PurePath():
            return str(value)
        case np.ndarray() | np.generic():
            return value.tolist()
        case Iterable():
            return [as_toml(inner) for inner in value]
    return value


def named_tables(tables: Mapping[str, Table]) -> dict[str, Table]:
    """Tables by what parts call them.

    Args:
        tables: Tables by name.

    Returns:
        The same.

    Raises:
        DataError: If they have no names, or names that only files have.
    """
    if not isinstance(tables, Mapping):
        raise DataError(
            f'`tables` must be a mapping of names to tables, such as {{"run1": frame}}; got {type(tables).__name__}.'
        )
    named = {str(name): table for name, table in tables.items()}
    for name, table in named.items():
        if table is None:
            raise DataError(f"`{name}`: a table must be a mapping of names to arrays, or a data frame; got None.")
        if name in {"", "."} or str(PurePath(name)) != name or ".." in PurePath(name).parts or "\0" in name:
            raise DataError(f"`tables` must have names, such as `run1` or `monday/run1`; got {name!r}. Rename it.")
        if ending := suffix_of(Path(name)):
            raise DataError(
                f"`tables` must have names without the ending of a file's; got `{name}`: leave out `{ending}`."
            )
    return named
