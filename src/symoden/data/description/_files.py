"""Finding the files that a description names."""

import logging
import os
from collections.abc import Collection
from fnmatch import fnmatchcase
from pathlib import Path

from symoden.data._errors import DataError, listing, nearest

_LOGGER = logging.getLogger(__name__)
_VARIABLE = "SYMODEN_DATA"


def find_files(pattern: str, description: Path) -> tuple[Path, ...]:
    """Find files by name or by pattern (`*`, `?`, `[…]`, `**`).

    A relative pattern is looked for beside the description; where nothing matches there, in the data directories,
    and the first that has a match is taken.

    Args:
        pattern: Name or pattern.
        description: File that gives it.

    Returns:
        The files, sorted by name.

    Raises:
        DataError: If it matches no file.
    """
    expanded = Path(pattern).expanduser()
    if expanded.is_absolute():
        folders = [Path(expanded.anchor)]
        relative = str(expanded.relative_to(expanded.anchor))
    else:
        folders = [description.parent, *data_directories(description)]
        relative = pattern
    for folder in folders:
        exact = folder / relative
        paths = [exact] if exact.is_file() else _globbed(folder, relative, description)
        if paths:
            _LOGGER.info("%s: `%s` is %d file(s) in %s", description, pattern, len(paths), folder)
            return tuple(paths)
    raise DataError(
        f"`{description}`: no file matches `{pattern}`; looked in {', '.join(f'`{folder}`' for folder in folders)}. "
        f"Correct `files`, or name the folder of the data by the environment variable {_VARIABLE}."
    )


def find_tables(pattern: str, description: Path, tables: Collection[str]) -> tuple[Path, ...]:
    """Find tables in memory by name or by pattern (`*`, `?`, `[…]`), in place of files.

    Args:
        pattern: Name or pattern.
        description: What messages call the description.
        tables: Names of the tables.

    Returns:
        Their names, in the order in which they are given.

    Raises:
        DataError: If it matches none.
    """
    found = [pattern] if pattern in tables else [name for name in tables if fnmatchcase(name, pattern)]
    if not found:
        raise DataError(
            f"`{description}`: no table matches `{pattern}`; got {listing(tables)}.{nearest(pattern, tables)} Correct "
            "`files`, or the names of the tables."
        )
    return tuple(map(Path, found))


def data_directories(description: Path) -> tuple[Path, ...]:
    """Folders that hold data which are not beside their description.

    They are: the one that the environment variable SYMODEN_DATA names; `data` and `shared/data` in the description's
    folder and in each one above it; `symoden/data` in the user's cache.

    Args:
        description: File that names data.

    Returns:
        The folders, in the order in which they are searched, whether they exist or not.
    """
    named = os.environ.get(_VARIABLE)
    above = [folder / name for folder in description.resolve().parents for name in ("data", "shared/data")]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return (*([Path(named).expanduser()] if named else []), *above, cache / "symoden" / "data")


def _globbed(folder: Path, pattern: str, description: Path) -> list[Path]:
    """Files in a folder that a pattern matches, sorted."""
    try:
        return sorted(path for path in folder.glob(pattern) if path.is_file())
    except (ValueError, IndexError, AttributeError) as error:  # The latter two where nothing but folders is named.
        reason = f": {error}" if isinstance(error, ValueError) else ', which is a folder. Write for example "*.csv"'
        raise DataError(f"`{description}`: `files` must be names or patterns; got {pattern!r}{reason}.") from error
