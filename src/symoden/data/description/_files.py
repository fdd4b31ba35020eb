"""Finding the files that a description names."""

import logging
import os
import re
from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from symoden.data._errors import DataError, listing, nearest

_LOGGER = logging.getLogger(__name__)
_VARIABLE = "SYMODEN_DATA"
_WILD: Final = re.compile(r"\*\*/|\*|\?|\[[^]]+\]")
_REGEX: Final = {"**/": ".*", "*": "[^/]*", "?": "[^/]"}  # Others are the same, but for `!`.


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


def find_joined(patterns: Mapping[str, str], description: Path) -> tuple[dict[str, Path], ...]:
    """Find files that are joined: those in whose names stars, and what else is not said, stand for the same texts.

    Args:
        patterns: Names or patterns, by what files are called.
        description: File that gives them.

    Returns:
        The files of each recording, by what they are called, sorted by name.

    Raises:
        DataError: If a pattern matches no file, two of them have another number of stars, or a file lacks another's.
    """
    wild = {name: len(_WILD.findall(pattern)) for name, pattern in patterns.items()}
    if len(set(wild.values())) > 1:
        stars = ", ".join(f"`{pattern}`" for pattern in patterns.values())
        raise DataError(
            f"`{description}`: patterns of files that are joined must have as many stars each, for the same texts; got "
            f'{stars}. Write for example `{{q = "run*/q.csv", tau = "run*/tau.csv"}}`.'
        )
    found = {
        name: {_stood_for(pattern, file): file for file in find_files(pattern, description)}
        for name, pattern in patterns.items()
    }
    first, *others = found.values()
    for name, files in found.items():
        for key in {key: file for each in others for key, file in each.items()} | first:
            if key not in files:
                other = next(each[key] for each in found.values() if key in each)
                raise DataError(
                    f"`{description}`: each of the files that are joined must have its others; `{other}` has none that "
                    f"`{patterns[name]}` matches. Put it beside it, or name fewer files."
                )
    return tuple({name: files[key] for name, files in found.items()} for key in first)


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


def _stood_for(pattern: str, file: Path) -> tuple[str, ...]:
    """What the stars of a pattern stand for in the name of a file that it matches."""
    parts = _WILD.split(pattern)
    stars = [_REGEX.get(star, star.replace("[!", "[^", 1)) for star in _WILD.findall(pattern)]
    regex = re.escape(parts[0]) + "".join(
        f"({star}){re.escape(part)}" for star, part in zip(stars, parts[1:], strict=True)
    )
    match = re.search(f"(?:^|/){regex}$", file.as_posix())
    return () if match is None else match.groups()


def _globbed(folder: Path, pattern: str, description: Path) -> list[Path]:
    """Files in a folder that a pattern matches, sorted."""
    try:
        return sorted(path for path in folder.glob(pattern) if path.is_file())
    except (ValueError, IndexError, AttributeError) as error:  # The latter two where nothing but folders is named.
        reason = f": {error}" if isinstance(error, ValueError) else ', which is a folder. Write for example "*.csv"'
        raise DataError(f"`{description}`: `files` must be names or patterns; got {pattern!r}{reason}.") from error
