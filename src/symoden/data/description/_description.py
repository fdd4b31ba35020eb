"""The description of a data set: a TOML file that says which numbers of which files mean what."""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from symoden.data._errors import DataError, cut, listing, nearest, on_escapes
from symoden.data.files import Selector, Table, names_in, variable_of
from symoden.known import Expression, KnownParts

from ._known import KEYS as KNOWN_KEYS, read_known
from ._memory import IN_MEMORY, as_toml, named_tables
from ._toml import read_toml
from ._units import is_named, si_of, units_of
from ._values import KEYS, PART_KEYS, PARTS, Check, VelocityEstimates, misplaced

_FITTING: Final[Mapping[str, tuple[str, ...]]] = {"time": ("s",), "inputs": ("N", "N m", "A", "V")}
"""What columns may become that are neither of lengths nor of angles."""

Interval: TypeAlias = tuple[int, int | None]
ALL_ROWS: Final = ((0, None),)


@dataclass(frozen=True, kw_only=True)
class Part:
    """Files of one part of a data set.

    Attributes:
        files: Names or patterns, relative to the description; or tables of them by what they are called, where a
            recording has several files, which are joined.
        rows: Rows [start, stop) to read, counted from 0, by names or patterns of files; negative ones count from the
            end. Of several intervals each is a recording of its own. Of a file that no name stands for: all.
        recordings: Those that the column `recording` names so, or that arrays of three axes number from 0; without any,
            those that no other part names.
        split_every: Duration of the segments to split each recording into [s].
    """

    files: tuple[str | Mapping[str, str], ...]
    rows: Mapping[str, tuple[Interval, ...]] = field(default_factory=dict)
    recordings: tuple[str, ...] = ()
    split_every: float | None = None

    def rows_of(self, file: Path) -> tuple[Interval, ...]:
        """Intervals of rows to read of a file.

        Args:
            file: The file.

        Returns:
            First row of each, and the row after its last one or nothing.
        """
        return next((rows for name, rows in self.rows.items() if stands_for(name, file)), ALL_ROWS)


def stands_for(pattern: str, file: Path) -> bool:
    """Tell whether a name or pattern means a file.

    Args:
        pattern: The name, which may have brackets of its own, or the pattern.
        file: The file, or the name of a table in memory.

    Returns:
        Whether it does.
    """
    return str(file) == pattern or file.match(pattern)


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a description says; see the documentation of the format for the keys.

    Attributes:
        path: Its file; of one in memory what messages call it.
        space: Configuration space, one factor per position column.
        positions: Columns of positions; angles in rad, unless `units` says otherwise.
        time: Column of time stamps [s], unless `units` says otherwise.
        dt: Step of files without time stamps [s]; beside `time`, of the even clock that rows were taken by, the stamps
            telling when they arrived.
        recording: Column that tells which recording a row belongs to, where files hold several.
        velocities: Columns of velocities.
        trust_velocities: Take velocities as they were logged, even where they come late and positions tell them better.
        estimated_velocities: That velocities are estimates from these positions, and how good they are.
        momenta: Columns of momenta; neither these nor velocities: velocities are estimated from the positions.
        inputs: Columns of inputs; none: free motion.
        formulas: Columns that are made of those of the files, by the name that other keys call them.
        units: Factors that bring columns to SI and rad as they are read, by the name of a column, or of a variable for
            all its columns. In the file: a factor, or a unit's name: `units = {q = "deg", "tau[1]" = -0.062}`.
        si_units: SI units that columns are brought to, where `units` name a unit.
        zeros: What columns show where what they measure is zero, in the unit that they are in.
        blind: Positions at which a sensor does not follow the motion: intervals in SI or rad by the name of a column.
            An empty list says that it has no such spot, where one would be found.
        hold: What an input is between samples.
        input_delay: Constant transport delay of the inputs [s], one for all or one each: the input that acts at t is
            the one that was logged at t − delay. The first samples, whose inputs were not logged, are left out; where
            inputs were logged late the delay is below zero, and the last ones are.
        input_lag: Time constant of the first-order lag by which what acts follows an input [s], one for all or one
            each. The first samples, in which what acted before still matters, are left out.
        position_delay: Constant delay of the positions [s], one for all or one each: what was logged at t was so at
            t − delay. The last samples, whose positions were not logged any more, are left out.
        resample: Step of the uniform grid to bring recordings to [s].
        input_matrix: Known g, row by row.
        initial_samples: Samples of a recording, after resampling, that may be used to find its first state.
        known: Parts of the mechanism that are given.
        train: Part to learn from.
        test: Part for the final score.
        validation: Part for choices during training.
        tables: Tables in memory, by name, that parts name in place of files; None where these are read.
    """

    path: Path
    space: str
    positions: Selector
    time: str | None = None
    dt: float | None = None
    recording: str | None = None
    velocities: Selector | None = None
    trust_velocities: bool = False
    estimated_velocities: VelocityEstimates | None = None
    momenta: Selector | None = None
    inputs: Selector = ()
    formulas: Mapping[str, Expression] = field(default_factory=dict)
    units: Mapping[str, float] = field(default_factory=dict)
    si_units: Mapping[str, str] = field(default_factory=dict)
    zeros: Mapping[str, float] = field(default_factory=dict)
    blind: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    hold: Literal["zero", "linear"] = "zero"
    input_delay: tuple[float, ...] = (0.0,)
    input_lag: tuple[float, ...] = (0.0,)
    position_delay: tuple[float, ...] = (0.0,)
    resample: float | None = None
    input_matrix: tuple[tuple[float, ...], ...] | None = None
    initial_samples: int = 1
    known: KnownParts | None = None
    train: Part | None = None
    test: Part | None = None
    validation: Part | None = None
    tables: Mapping[str, Table] | None = None

    @property
    def check(self) -> str:
        """What tells more of the data, for messages."""
        in_memory = self.tables is not None or self.path == IN_MEMORY
        return "`symoden.check_dataset`" if in_memory else f"`symoden data check {self.path}`"

    def whereabouts(self, file: Path) -> Path:
        """Tell a file from others, whatever they are called.

        Args:
            file: The file, or the name of a table in memory.

        Returns:
            Where it is; of a table its name.
        """
        return file.resolve() if self.tables is None else file

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


def read_description(
    given: Path | str | Mapping[str, object],
    *,
    space: str | None = None,
    tables: Mapping[str, Table] | None = None,
) -> Description:
    """Read a description, taking nothing for granted.

    Args:
        given: TOML file, or what one would say: a mapping of its keys.
        space: Space to take instead of the one that is given.
        tables: Tables in memory, by name, in place of files.

    Returns:
        What it says.

    Raises:
        DataError: If the file cannot be read, has an unknown key, lacks one, or has a wrong value; or tables have unfit
            names.
    """
    if not isinstance(given, Path | str | Mapping):
        raise DataError(
            f"A description must be the path of a TOML file, or a mapping of its keys; got {type(given).__name__}. "
            "Tables in memory are given beside it, as `tables`."
        )
    path = IN_MEMORY if isinstance(given, Mapping) else Path(given)
    table = as_toml(given) if isinstance(given, Mapping) else read_toml(path)
    parts: dict[str, Any] = {
        name: Part(**_checked(path, f"[{name}] ", table.pop(name), PART_KEYS, required=("files",)))
        for name in PARTS
        if name in table
    }
    if isinstance(table.get("known"), KnownParts):
        parts["known"] = table.pop("known")
    elif "known" in table:
        parts["known"] = read_known(path, table.pop("known"), above=table)
    if space is not None:
        table["space"] = space
    values = _checked(path, "", table, KEYS, required=("space", "positions"))
    named = {column: si_of(unit) for column, unit in table.get("units", {}).items()}
    parts["si_units"] = {column: unit for column, unit in named.items() if unit is not None}
    parts["tables"] = None if tables is None else named_tables(tables)
    description = Description(path=path, **values, **parts)
    _refuse_contradictions(path, description)
    _refuse_unfit_units(path, description)
    return description


def angles_of(path: Path, space: str) -> tuple[bool, ...]:
    """Find out which coordinates of a space are angles.

    Args:
        path: The description's file, for messages.
        space: The space.

    Returns:
        Whether each coordinate is an angle.

    Raises:
        DataError: If the space is misspelt.
    """
    from symoden.spaces import Space  # imports JAX

    try:
        return tuple(Space.parse(space).is_angle)
    except ValueError as error:
        raise DataError(f"`{path}`: {error}") from error


def _checked(
    path: Path, where: str, table: object, keys: Mapping[str, Check], *, required: tuple[str, ...]
) -> dict[str, Any]:
    """Values of a table whose keys are all known and whose values are all fit."""
    if not isinstance(table, dict):
        raise DataError(f"`{path}`: {where}must be a table of keys, such as `files`; got {_shown(table)}.")
    for key in table:
        if key not in keys:
            known = (*keys, "known", *PARTS) if not where else tuple(keys)
            if not where and key in KNOWN_KEYS:
                raise DataError(
                    f"`{path}`: `{key}` must stand under [known]; it stands above all tables. Move it there."
                )
            raise DataError(
                f"`{path}`: {where or 'a description '}has no key `{key}`.{misplaced(key) or nearest(key, known)} "
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
            what, got, advice = error.args if len(error.args) > 1 else (error, value, "")
            raise DataError(f"`{path}`: {where}`{key}` {what}; got {_shown(got)}.{advice}") from error
    return values


def _shown(value: object) -> str:
    """A value in a message, without what is too long of it, such as a data frame."""
    return repr(value) if isinstance(value, str) else cut(" ".join(repr(value).split()))


def _refuse_contradictions(path: Path, description: Description) -> None:
    """Refuse values that are fit one by one but not together."""
    if description.time is None and description.dt is None:
        raise DataError(f"`{path}`: `time` (a column) or `dt` (the step in seconds) must be given; got neither.")
    if description.velocities is not None and description.momenta is not None:
        raise DataError(f"`{path}`: only one of `velocities` and `momenta` may be given; got both.")
    if description.trust_velocities and description.velocities is None:
        raise DataError(f"`{path}`: `trust_velocities` is about `velocities`, which are not given. Leave it out.")
    if description.estimated_velocities is not None and description.velocities is None:
        raise DataError(f"`{path}`: `estimated_velocities` is about `velocities`, which are not given. Leave it out.")
    if description.train is None and description.test is None:
        raise DataError(f"`{path}`: [train] or [test] must name `files`; got neither.")
    if isinstance(description.positions, tuple):
        _refuse_other_size(path, description)
    for key, delays, what, columns in (
        ("input_delay", len(description.input_delay), "input", description.inputs),
        ("input_lag", len(description.input_lag), "input", description.inputs),
        ("position_delay", len(description.position_delay), "position", description.positions),
    ):
        if isinstance(columns, tuple) and delays not in (1, len(columns)):
            raise DataError(f"`{path}`: `{key}` must be one number or one per {what}, {len(columns)}; got {delays}.")
    _refuse_two_meanings(path, description)
    for key, named in (("units", description.units), ("zeros", description.zeros)):
        _refuse_unread(path, key, named, description.selectors)
    _refuse_unread(path, "blind", description.blind, {"positions": description.positions})
    _refuse_unused(path, description)


def _refuse_unused(path: Path, description: Description) -> None:
    """Refuse formulas of columns that nothing reads."""
    read = names_in(description.selectors)
    for name in description.formulas:
        if name not in read:
            raise DataError(
                f"`{path}`: `formulas` must make columns that other keys name, which are {listing(read)}; got "
                f"`{name}`. Name it in one of these, such as `inputs`."
            )


def _refuse_two_meanings(path: Path, description: Description) -> None:
    """Refuse a column that is named in two places."""
    of_recordings = {} if description.recording is None else {"recording": (description.recording,)}
    read = description.selectors | of_recordings
    for (role, selector), (other, others) in itertools.combinations(read.items(), 2):
        for name, again in itertools.product(names_in({role: selector}), names_in({other: others})):
            whole = selector == variable_of(again) or others == variable_of(name)  # The variable, and one column of it.
            if name == again or whole:
                keys = [_key(each, description) for each in (role, other)]
                raise DataError(
                    f"`{path}`: a column must have one meaning; got `{again}` in `{keys[1]}`, and `{name}` in "
                    f"`{keys[0]}`. Name each column once."
                )


def _key(role: str, description: Description) -> str:
    """Key of a description that names the columns of a role."""
    return role if role != "rates" else "velocities" if description.momenta is None else "momenta"


def _refuse_unread(path: Path, key: str, named: Iterable[str], selectors: Mapping[str, Selector]) -> None:
    """Refuse to say something of columns that are not read."""
    read = names_in(selectors)
    for column in named:
        if not is_named(column, selectors):
            raise DataError(
                f"`{path}`: `{key}` must name columns that are read, which are {listing(read)}; got `{column}`. Spell "
                f"it there, or in the key that reads it, as the files do.{on_escapes(column)}"
            )


def _refuse_unfit_units(path: Path, description: Description) -> None:
    """Refuse units of another kind than a column is of; what is no angle of the space may be one that never repeats."""
    if not description.si_units:
        return
    joints = [("rad",) if angle else ("m", "rad") for angle in angles_of(path, description.space)]
    for role, selector in description.selectors.items():
        for column, unit in description.si_units.items():
            if not is_named(column, {role: selector}) or (role == "rates" and description.momenta is not None):
                continue
            if role in _FITTING:
                if unit not in _FITTING[role]:
                    raise DataError(_unfit(path, column, role, _FITTING[role], unit))
                continue
            per = "/s" if role == "rates" else ""
            for i in _columns_of(column, selector, len(joints), description.units):
                fitting = tuple(f"{kind}{per}" for kind in joints[i])
                if unit not in fitting:
                    raise DataError(_unfit(path, column, role, fitting, unit))
                joints[i] = (unit.removesuffix("/s"),)  # So must its velocity be.


def _columns_of(name: str, selector: Selector, size: int, units: Mapping[str, float]) -> list[int]:
    """Which columns a key of `units` is about: those that it names, or all of a variable that have no key of theirs."""
    names = [f"{selector}[{i}]" for i in range(size)] if isinstance(selector, str) else list(selector)[:size]
    return [i for i, each in enumerate(names) if name == each or (name == variable_of(each) and each not in units)]


def _unfit(path: Path, column: str, role: str, fitting: tuple[str, ...], unit: str) -> str:
    """Message on a unit of another kind than a column is of."""
    what = "velocities" if role == "rates" else role  # Momenta have no units.
    return (
        f"`{path}`: `units` must say of `{column}`, which is of `{what}`, how its numbers become "
        f"{' or '.join(fitting)}; got a unit of {unit}. Write {listing(units_of(fitting))}, or a factor"
        + (
            "; angles have the letter T in `space`, or R where they do not repeat after a turn, lengths R."
            if role in ("positions", "rates")
            else "."
        )
    )


def _refuse_other_size(path: Path, description: Description) -> None:
    """Refuse numbers of columns that do not agree with the number of positions."""
    size = len(description.positions)
    for key in ("velocities", "momenta"):
        columns = getattr(description, key)
        if isinstance(columns, tuple) and len(columns) != size:
            raise DataError(f"`{path}`: `{key}` must name {size} columns, one per position; got {len(columns)}.")
