"""The table [known] of a description: parts of the mechanism that are given."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from symoden.data._errors import DataError, listing, nearest
from symoden.known import GRAVITY, PARTS, KnownParts, Robot, read_urdf

from ._values import misplaced

KEYS: Final = (*PARTS, "robot", "constants", "parameters", "correct", "cyclic")
_OF_NAMES: Final = {"correct": "parts", "cyclic": "coordinates"}
_ROBOT: Final = ("urdf", "joints", "at", "gravity")


def read_known(path: Path, table: object, *, above: Mapping[str, object]) -> KnownParts:
    """Read the table [known].

    Args:
        path: The description, for messages.
        table: What TOML made of the table.
        above: What stands above all tables: its `positions` and `inputs` tell the sizes of matrices.

    Returns:
        The given parts.

    Raises:
        DataError: If a key is unknown or a value is unfit.
    """
    if not isinstance(table, dict):
        raise DataError(f"`{path}`: [known] must be a table; got {table!r}.")
    for key in table:
        if key not in KEYS:
            hint = misplaced(key) or nearest(key, KEYS)
            raise DataError(f"`{path}`: [known] has no key `{key}`.{hint} The keys are {listing(KEYS)}.")
    for key in ("constants", "parameters"):
        if not isinstance(table.get(key, {}), dict):
            raise DataError(f"`{path}`: [known.{key}] must be a table of names and numbers; got {table[key]!r}.")
    lists = {key: table[key] for key in _OF_NAMES if key in table}
    for key, names in lists.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise DataError(f"`{path}`: [known] `{key}` must be a list of names of {_OF_NAMES[key]}; got {names!r}.")
    if "cyclic" in lists:
        lists["cyclic"] = _by_number(path, lists["cyclic"], above.get("positions"))
    try:
        robot = {"robot": _read_robot(path, table["robot"])} if "robot" in table else {}
        return KnownParts(**{**table, **robot, **{key: tuple(names) for key, names in lists.items()}})
    except ValueError as error:
        raise DataError(f"`{path}`: [known] {_of_shapes(table, above) or error}") from None


def _by_number(path: Path, names: Sequence[str], positions: object) -> list[str]:
    """Coordinates as formulas call them, q1, q2, …, where their columns are named."""
    columns = positions if isinstance(positions, list) else []
    numbered = {name: f"q{i}" for i, name in enumerate(columns, start=1)}
    for name in names:
        if name in numbered and name != numbered[name] and name in numbered.values():
            raise DataError(
                f"`{path}`: [known] `cyclic` must say which coordinate it means; `{name}` is a column, and what "
                f"formulas call another one. Write `{numbered[name]}` for the column, "
                f"`{columns[int(name[1:]) - 1]}` for the other."
            )
    return [numbered.get(name, name) for name in names]


def _of_shapes(table: Mapping[str, object], above: Mapping[str, object]) -> str:
    """What is wrong with the size of a matrix: that a name stands in no formula may be the consequence."""
    n, m = (len(given) if isinstance(given := above.get(key), list) else None for key in ("positions", "inputs"))
    for name, columns in (("mass_matrix", n), ("dissipation_matrix", n), ("input_matrix", m)):
        rows = table.get(name)
        if n is None or not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
            continue  # What is no list of rows is refused in other words.
        widths = {len(row) for row in rows}
        if len(rows) != n or (len(widths) == 1 and columns is not None and widths != {columns}):
            size = f"have {n} row{'s' * (n > 1)}" if columns is None else f"be {n} × {columns}"
            got = f"{len(rows)} × {' or '.join(map(str, sorted(widths)))}"
            return f"`{name}` must {size}; got {got}. Give one row per coordinate."
    return ""


def _read_robot(path: Path, table: object) -> Robot:
    """The robot of a URDF file beside the description, by its path or by a table with more."""
    given = {"urdf": table} if isinstance(table, str) else table
    if not isinstance(given, dict) or not isinstance(given.get("urdf"), str):
        raise ValueError(
            f'`robot` must be the path of a URDF file, or a table with `urdf = "arm.urdf"`; got {table!r}.'
        )
    for key in given:
        if key not in _ROBOT:
            raise ValueError(f"`robot` has no key `{key}`.{nearest(key, _ROBOT)} The keys are {listing(_ROBOT)}.")
    joints, gravity, file = given.get("joints"), given.get("gravity", GRAVITY), path.parent / given["urdf"]
    if joints is not None and not (isinstance(joints, list) and all(isinstance(name, str) for name in joints)):
        raise ValueError(f"`robot`: `joints` must be a list of names; got {joints!r}.")
    if not (isinstance(gravity, list | tuple) and all(type(number) in (int, float) for number in gravity)):
        raise ValueError(f"`robot`: `gravity` must be a list of three numbers [m/s²]; got {gravity!r}.")
    at = given.get("at", {})
    if not (isinstance(at, dict) and all(type(number) in (int, float) for number in at.values())):
        raise ValueError(f"`robot`: `at` must be a table of joints and where they stand [rad or m]; got {at!r}.")
    try:
        return read_urdf(file, joints=joints, at=at, gravity=gravity)
    except OSError as error:
        raise ValueError(f"`robot`: `{file}` cannot be read: {error.strerror or error}. Correct the path.") from None
    except ValueError as error:
        raise ValueError(f"`robot`: `{file}`: {error}") from None
