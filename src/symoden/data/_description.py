"""The description of a data set: a TOML file that says which numbers of which files mean what."""

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, NoReturn, TypeAlias

from symoden.known import KnownParts

from ._cells import label
from ._errors import DataError, listing, nearest
from ._known import read_known
from ._readers import Selector, names_in
from ._units import factor_of, is_named, si_of, units_of

Check: TypeAlias = Callable[[object], object]

_ENDS: Final = 2  # Of an interval.
_FITTING: Final = {"time": ("s",), "positions": ("rad", "m"), "rates": ("rad/s", "m/s")}  # Of inputs any is.


@dataclass(frozen=True, kw_only=True)
class Part:
    """Files of one part of a data set.

    Attributes:
        files: Names or patterns, relative to the description.
        rows: Rows [start, stop) to read of each file, counted from 0; negative ones count from the end.
        recordings: Those that the column `recording` names so; without any, those that no other part names.
        split_every: Duration of the segments to split each recording into [s].
    """

    files: tuple[str, ...]
    rows: tuple[int, int | None] = (0, None)
    recordings: tuple[str, ...] = ()
    split_every: float | None = None


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a description says; see the documentation of the format for the keys.

    Attributes:
        space: Configuration space, one factor per position column.
        positions: Columns of positions; angles in rad, unless `units` says otherwise.
        time: Column of time stamps [s], unless `units` says otherwise.
        dt: Step of files without time stamps [s].
        recording: Column that tells which recording a row belongs to, where files hold several.
        velocities: Columns of velocities.
        trust_velocities: Take velocities as they were logged, even where they come late and positions tell them better.
        momenta: Columns of momenta; neither these nor velocities: velocities are estimated from the positions.
        inputs: Columns of inputs; none: free motion.
        units: Factors that bring columns to SI and rad as they are read, by the name of a column, or of a variable for
            all its columns. In the file: a factor, or a unit's name: `units = {q = "deg", "tau[1]" = -0.062}`.
        si_units: SI units that columns are brought to, where `units` name a unit.
        zeros: What columns show where what they measure is zero, in the unit that they are in.
        blind: Positions at which a sensor does not follow the motion: intervals in SI or rad by the name of a column.
            An empty list says that it has no such spot, where one would be found.
        hold: What an input is between samples.
        input_delay: Constant transport delay of the inputs [s], one for all or one each: the input that acts at t is
            the one that was logged at t − delay. The first samples, whose inputs were not logged, are left out.
        resample: Step of the uniform grid to bring recordings to [s].
        input_matrix: Known g, row by row.
        initial_samples: Samples of a recording, after resampling, that may be used to find its first state.
        known: Parts of the mechanism that are given.
        train: Part to learn from.
        test: Part for the final score.
        validation: Part for choices during training.
    """

    space: str
    positions: Selector
    time: str | None = None
    dt: float | None = None
    recording: str | None = None
    velocities: Selector | None = None
    trust_velocities: bool = False
    momenta: Selector | None = None
    inputs: Selector = ()
    units: Mapping[str, float] = field(default_factory=dict)
    si_units: Mapping[str, str] = field(default_factory=dict)
    zeros: Mapping[str, float] = field(default_factory=dict)
    blind: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    hold: Literal["zero", "linear"] = "zero"
    input_delay: tuple[float, ...] = (0.0,)
    resample: float | None = None
    input_matrix: tuple[tuple[float, ...], ...] | None = None
    initial_samples: int = 1
    known: KnownParts | None = None
    train: Part | None = None
    test: Part | None = None
    validation: Part | None = None

    @property
    def selectors(self) -> dict[str, Selector]:
        """What is read of every file, by role: "time", "positions", "rates", "inputs"."""
        every = {
            "time": self.time,
            "positions": self.positions,
            "rates": self.velocities or self.momenta,
            "inputs": self.inputs,
        }
        return {role: selector for role, selector in every.items() if selector is not None}

    @property
    def parts(self) -> dict[str, Part]:
        """The parts that are described, by name."""
        every = {"train": self.train, "test": self.test, "validation": self.validation}
        return {name: part for name, part in every.items() if part is not None}


def read_description(path: Path, *, space: str | None = None) -> Description:
    """Read a description, taking nothing for granted.

    Args:
        path: TOML file.
        space: Space to take instead of the one in the file.

    Returns:
        What it says.

    Raises:
        DataError: If the file cannot be read, has an unknown key, lacks one, or has a wrong value.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"`{path}`: cannot be read: {error.strerror or error}. Give a description's path.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise DataError(f"`{path}`: must be a TOML file; reading stopped at: {error}.") from error
    parts: dict[str, Any] = {
        name: Part(**_checked(path, f"[{name}] ", table.pop(name), _PART_KEYS, required=("files",)))
        for name in _PARTS
        if name in table
    }
    if "known" in table:
        parts["known"] = read_known(path, table.pop("known"))
    if space is not None:
        table["space"] = space
    values = _checked(path, "", table, _KEYS, required=("space", "positions"))
    named = {column: si_of(unit) for column, unit in table.get("units", {}).items()}
    parts["si_units"] = {column: unit for column, unit in named.items() if unit is not None}
    description = Description(**values, **parts)
    _refuse_contradictions(path, description)
    return description


def _checked(
    path: Path, where: str, table: object, keys: Mapping[str, Check], *, required: tuple[str, ...]
) -> dict[str, Any]:
    """Values of a table whose keys are all known and whose values are all fit."""
    if not isinstance(table, dict):
        raise DataError(f"`{path}`: {where}must be a table; got {table!r}.")
    for key in table:
        if key not in keys:
            known = (*keys, "known", *_PARTS) if not where else tuple(keys)
            raise DataError(
                f"`{path}`: {where or 'a description '}has no key `{key}`.{nearest(key, known)} "
                f"The keys are {listing(known)}."
            )
    for key in required:
        if key not in table:
            raise DataError(f"`{path}`: {where}`{key}` must be given; found {listing(table)}.{nearest(key, table)}")
    values: dict[str, Any] = {}
    for key, value in table.items():
        try:
            values[key] = keys[key](value)
        except ValueError as error:
            raise DataError(f"`{path}`: {where}`{key}` {error}; got {value!r}.") from error
    return values


def _refuse_contradictions(path: Path, description: Description) -> None:
    """Refuse values that are fit one by one but not together."""
    if (description.time is None) == (description.dt is None):
        raise DataError(
            f"`{path}`: exactly one of `time` (a column) and `dt` (the step in seconds) must be given; got "
            f"{'neither' if description.time is None else 'both'}."
        )
    if description.velocities is not None and description.momenta is not None:
        raise DataError(f"`{path}`: only one of `velocities` and `momenta` may be given; got both.")
    if description.trust_velocities and description.velocities is None:
        raise DataError(f"`{path}`: `trust_velocities` is about `velocities`, which are not given. Leave it out.")
    if description.train is None and description.test is None:
        raise DataError(f"`{path}`: [train] or [test] must name `files`; got neither.")
    if isinstance(description.positions, tuple):
        _refuse_other_size(path, description)
    for name, part in description.parts.items():
        if part.recordings and description.recording is None:
            raise DataError(
                f"`{path}`: [{name}] `recordings` are told apart by a column; got none. Name it: "
                '`recording = "trial"` before the tables.'
            )
    delays = len(description.input_delay)
    if isinstance(description.inputs, tuple) and delays not in (1, len(description.inputs)):
        raise DataError(
            f"`{path}`: `input_delay` must be one number or one per input, {len(description.inputs)}; got {delays}."
        )
    for key, named in (("units", description.units), ("zeros", description.zeros)):
        _refuse_unread(path, key, named, description.selectors)
    _refuse_unread(path, "blind", description.blind, {"positions": description.positions})
    _refuse_unfit_units(path, description)


def _refuse_unread(path: Path, key: str, named: Iterable[str], selectors: Mapping[str, Selector]) -> None:
    """Refuse to say something of columns that are not read."""
    read = names_in(selectors)
    for column in named:
        if not is_named(column, selectors):
            raise DataError(
                f"`{path}`: `{key}` must name columns that are read, which are {listing(read)}; got `{column}`. Spell "
                "both as the files do."
            )


def _refuse_unfit_units(path: Path, description: Description) -> None:
    """Refuse units of another kind than a column is of."""
    for role, fitting in _FITTING.items():
        if role == "rates" and description.momenta is not None:
            continue
        read = {role: description.selectors.get(role, ())}
        for column, unit in description.si_units.items():
            if unit not in fitting and is_named(column, read):
                what = "velocities" if role == "rates" else role
                raise DataError(
                    f"`{path}`: `units` must say of `{column}`, which is of `{what}`, how its numbers become "
                    f"{' or '.join(fitting)}; got a unit of {unit}. Write {listing(units_of(fitting))}, or a factor."
                )


def _refuse_other_size(path: Path, description: Description) -> None:
    """Refuse numbers of columns that do not agree with the number of positions."""
    size = len(description.positions)
    for key in ("velocities", "momenta"):
        columns = getattr(description, key)
        if isinstance(columns, tuple) and len(columns) != size:
            raise DataError(f"`{path}`: `{key}` must name {size} columns, one per position; got {len(columns)}.")


def _fail(what: str) -> NoReturn:
    """Say what a value must be."""
    raise ValueError(f"must be {what}")


def _text(value: object) -> str:
    """A name."""
    return value if isinstance(value, str) and value else _fail("a text")


def _texts(value: object) -> tuple[str, ...]:
    """A list of names, at least one."""
    if not isinstance(value, list) or not value or not all(isinstance(item, str) and item for item in value):
        _fail('a list of texts in brackets, such as ["a", "b"]')
    return tuple(value)


def _labels(value: object) -> tuple[str, ...]:
    """A list of numbers or texts, at least one, as texts."""
    if not isinstance(value, list) or not value or not all(isinstance(x, str) or _is_number(x) for x in value):
        _fail('a list of numbers or texts, such as [3, 7] or ["monday"]')
    return tuple(str(item) if isinstance(item, int) else label(item) for item in value)


def _selector(value: object) -> Selector:
    """A list of names, or the name of a 2-D variable."""
    names = value if isinstance(value, str) and value else _texts(value)
    if isinstance(names, tuple) and len(set(names)) < len(names):
        _fail("names that differ from each other")
    return names


def _inputs(value: object) -> Selector:
    """A list of names, which may be empty, or the name of a 2-D variable."""
    return () if value == [] else _selector(value)


def _is_number(value: object) -> bool:
    """Whether a value is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _flag(value: object) -> bool:
    """True or false."""
    return value if isinstance(value, bool) else _fail("true or false")


def _positive(value: object) -> float:
    """A positive number of seconds."""
    if not isinstance(value, int | float) or not _is_number(value) or value <= 0:
        _fail("a positive number of seconds")
    return float(value)


def _count(value: object) -> int:
    """A whole number from 1 on."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        _fail("a whole number, at least 1")
    return value


def _hold(value: object) -> object:
    """A kind of hold."""
    return value if value in ("zero", "linear") else _fail('"zero" or "linear"')


def _units(value: object) -> dict[str, float]:
    """Factors by column."""
    if not isinstance(value, dict):
        _fail('a table of columns, such as {q = "deg", tau = 0.062}')
    factors = {}
    for column, unit in value.items():
        if isinstance(unit, dict):
            _fail(f'a table of columns; a name with dots stands in quotes, such as "{column}.{next(iter(unit), "x")}"')
        try:
            factors[column] = factor_of(unit)
        except ValueError as error:
            raise ValueError(f"of `{column}` {error}") from error
    return factors


def _zeros(value: object) -> dict[str, float]:
    """Numbers by column."""
    if not isinstance(value, dict) or not all(map(_is_number, value.values())):
        _fail("a table of columns and finite numbers, such as {q = 180.0, tau = 0.02}")
    return {column: float(number) for column, number in value.items()}


def _blind(value: object) -> dict[str, tuple[tuple[float, float], ...]]:
    """Intervals by column."""
    if not isinstance(value, dict) or not all(map(_are_intervals, value.values())):
        _fail("a table of columns and lists of intervals, from less to more, such as {q = [[0.9, 1.4]]}, or {q = []}")
    return {column: tuple((float(a), float(b)) for a, b in intervals) for column, intervals in value.items()}


def _are_intervals(value: object) -> bool:
    """Whether a value is a list of pairs of numbers, the second one the larger."""
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == _ENDS and all(map(_is_number, pair)) and pair[0] < pair[1]
        for pair in value
    )


def _delays(value: object) -> tuple[float, ...]:
    """Seconds from 0 on, one or several."""
    seconds = [
        float(item)
        for item in (value if isinstance(value, list) else [value])
        if isinstance(item, int | float) and _is_number(item) and item >= 0
    ]
    if not seconds or len(seconds) != (len(value) if isinstance(value, list) else 1):
        _fail("a number of seconds, at least 0, or a list of one per input")
    return tuple(seconds)


def _matrix(value: object) -> tuple[tuple[float, ...], ...]:
    """Rows of numbers, all of one length."""
    rows = value if isinstance(value, list) else []
    if not rows or not all(isinstance(row, list) and row and all(map(_is_number, row)) for row in rows):
        _fail("a list of rows of numbers, such as [[1, 0], [0, 1]]; formulas stand under [known]")
    if len({len(row) for row in rows}) > 1:
        _fail("rows of equal length")
    return tuple(tuple(float(item) for item in row) for row in rows)


def _rows(value: object) -> tuple[int, int | None]:
    """First row, and the row after the last one or nothing."""
    numbers = value if isinstance(value, list) else []
    if len(numbers) not in (1, 2) or not all(isinstance(item, int) and not isinstance(item, bool) for item in numbers):
        _fail("[start, stop), two whole numbers, or [start] for all rows from there on")
    return numbers[0], numbers[1] if len(numbers) > 1 else None


_PARTS: Final = ("train", "test", "validation")
_PART_KEYS: Final[dict[str, Check]] = {
    "files": _texts,
    "rows": _rows,
    "recordings": _labels,
    "split_every": _positive,
}
_KEYS: Final[dict[str, Check]] = {
    "space": _text,
    "time": _text,
    "dt": _positive,
    "recording": _text,
    "positions": _selector,
    "velocities": _selector,
    "trust_velocities": _flag,
    "momenta": _selector,
    "inputs": _inputs,
    "units": _units,
    "zeros": _zeros,
    "blind": _blind,
    "hold": _hold,
    "input_delay": _delays,
    "resample": _positive,
    "input_matrix": _matrix,
    "initial_samples": _count,
}
