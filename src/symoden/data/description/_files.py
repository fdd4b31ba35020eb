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
_REGEX: Final = {"**/": "(?:.*/)?", "*": "[^/]*", "?": "[^/]"}
_SPECIAL: Final = re.compile(r"[\\^\[\]&~|]")  # In brackets, to regular expressions alone.


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
    return tuple(path for path, _ in _found(pattern, description))


def _found(pattern: str, description: Path) -> list[tuple[Path, tuple[str, ...]]]:
    """Files that a name or a pattern means, sorted by name, and what its stars stand for; of a name nothing does."""
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
            return [(path, () if path == exact else _stood_for(relative, path, folder)) for path in paths]
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
    found = {name: {key: path for path, key in _found(patterns[name], description)} for name in patterns}
    if len({len(key) for files in found.values() for key in files}) > 1:
        stars = ", ".join(f"`{pattern}`" for pattern in patterns.values())
        raise DataError(
            f"`{description}`: patterns of files that are joined must have as many stars each, for the same texts; got "
            f'{stars}. Write for example `{{q = "run*/q.csv", tau = "run*/tau.csv"}}`.'
        )
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


def _stood_for(pattern: str, path: Path, folder: Path) -> tuple[str, ...]:
    """What the stars of a pattern stand for in a path that it matches below a folder, and what else is left open."""
    plain = Path(pattern).as_posix()
    parts, stars = _WILD.split(plain), map(_as_regex, _WILD.findall(plain))
    regex = re.escape(parts[0]) + "".join(
        f"({star}){re.escape(part)}" for star, part in zip(stars, parts[1:], strict=True)
    )
    match = re.fullmatch(regex, path.relative_to(folder).as_posix())
    return (path.as_posix(),) if match is None else match.groups()  # Nothing else has the same text.


def _as_regex(star: str) -> str:
    """What matches the same as a star, or another part of a pattern that leaves something open."""
    if star in _REGEX:
        return _REGEX[star]
    opposite, listed = ("^", star[2:-1]) if star.startswith("[!") else ("", star[1:-1])
    return "[" + opposite + _SPECIAL.sub(r"\\\g<0>", listed) + "]"


def _globbed(folder: Path, pattern: str, description: Path) -> list[Path]:
    """Files in a folder that a pattern matches, sorted."""
    try:
        return sorted(path for path in folder.glob(pattern) if path.is_file())
    except (ValueError, IndexError, AttributeError) as error:  # The latter two where nothing but folders is named.
        reason = f": {error}" if isinstance(error, ValueError) else ', which is a folder. Write for example "*.csv"'
        raise DataError(f"`{description}`: `files` must be names or patterns; got {pattern!r}{reason}.") from error
