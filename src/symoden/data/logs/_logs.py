"""What the files of a description hold, in SI and rad: everything as it was logged, good or bad."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from symoden.data._errors import DataError
from symoden.data.description import (
    ALL_ROWS,
    Description,
    Impossible,
    Unreadable,
    angles_of,
    of_column,
    read_parts,
    split_unit,
    without_impossible,
)
from symoden.data.files import Rows, UnreadClock, place, stem_of, units_below_names

from ._clock_notes import Arrivals, Merged, Polled, Wraps


@dataclass(frozen=True, kw_only=True, eq=False)
class Bridge:
    """Single numbers of an input that were missing or wrong, and in whose place others were put.

    Attributes:
        channel: Name of its column.
        rows: Their rows of the log.
        how: What was put in their place, in words.
        wrong: Whether they were there, and wrong.
    """

    channel: str
    rows: np.ndarray
    how: str
    wrong: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """One file's rows of one part, before anything is repaired but inputs; NaN where a number is missing or impossible.

    Attributes:
        part: "train", "test" or "validation".
        name: The file's stem, and what tells the recording apart from others in it: `swings-3`; with as many of the
            folders above in front as tell it apart from others of its part: `monday-swings-3`.
        path: The file.
        rows: Row of the file that each row of the log is, counted from 0.
        ts: Time stamps [s] (T,), in the order of the rows.
        q: Positions (T, n), angles with their jumps.
        rates: Velocities or momenta (T, n); None if there are none.
        us: Inputs (T, m).
        names: Names of the columns by role: "time", "positions", "rates", "inputs".
        units: SI units of these columns, by role, empty where neither the description nor the space tells one.
        impossible: Numbers that no machine has, of each column that has any.
        merged: That the table had several clocks, if so.
        polled: That positions repeat readings, if so.
        arrivals: That its time stamps were found to be those of arrival, if so.
        wraps: That its clock began anew, and was counted on, if so.
        repeats: Rows of the file that repeat the one before, time stamp and all, which the log lacks.
        bridges: Numbers of inputs that were missing or wrong, and bridged.
        clocks: Columns of its file that count time, where the description names none.
        drives: Columns of its file that are called as inputs are, where the description names none.
        files: Files that were joined, by what they are called in front of the names of their columns.
    """

    part: str
    name: str
    path: Path
    rows: np.ndarray
    ts: np.ndarray
    q: np.ndarray
    rates: np.ndarray | None
    us: np.ndarray
    names: Mapping[str, tuple[str, ...]]
    units: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    impossible: tuple[Impossible, ...] = ()
    merged: Merged | None = None
    polled: Polled | None = None
    arrivals: Arrivals | None = None
    wraps: Wraps | None = None
    repeats: tuple[int, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    clocks: tuple[UnreadClock, ...] = ()
    drives: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of rows T."""
        return len(self.ts)

    @property
    def signals(self) -> dict[str, np.ndarray]:
        """Positions, rates if there are any, and inputs, by role."""
        every = {"positions": self.q, "rates": self.rates, "inputs": self.us}
        return {role: signal for role, signal in every.items() if signal is not None}

    @property
    def complete(self) -> np.ndarray:
        """Whether each row has all its numbers (T,)."""
        columns = [self.ts[:, None], *self.signals.values()]
        return np.asarray(np.isfinite(np.concatenate(columns, axis=1)).all(axis=1))

    @property
    def time_column(self) -> str:
        """Start of messages on the time stamps: the file and the column."""
        return f"`{self.path}`: column `{self.names['time'][0]}`" if "time" in self.names else f"`{self.path}`: `dt`"

    @property
    def units_below_names(self) -> dict[str, str]:
        """Units that a line under the names of its columns says, as it is written."""
        if not self.files:
            return units_below_names(self.path)
        below = {label: units_below_names(file) for label, file in self.files.items()}
        return {f"{label}.{name}": unit for label, each in below.items() for name, unit in each.items()}

    def title(self, role: str, column: int) -> str:
        """Name of a column for a reader, with its SI unit where that is known.

        Args:
            role: "positions", "rates" or "inputs".
            column: Which of them.

        Returns:
            The name.
        """
        unit = self.units[role][column] if role in self.units else ""
        name = self.names[role][column]
        return f"{split_unit(name)[0]} [{unit}]" if unit else name

    def place(self, row: int) -> str:
        """Where a row of the log is in the file.

        Args:
            row: The row, counted from the first one that was read.

        Returns:
            The words.
        """
        return place(self.path, int(self.rows[row]))


class Logs(NamedTuple):
    """What the files of a description hold.

    Attributes:
        found: The logs, or why there is none, part by part, in the order of the files.
        refusals: What the description says of the parts that is not so.
    """

    found: tuple[Log | Unreadable, ...]
    refusals: tuple[DataError, ...]


def read_logs(description: Description) -> Logs:
    """Read the files of a description.

    Args:
        description: What it says.

    Returns:
        The logs; that a file cannot be read is for the caller to raise or to report.

    Raises:
        DataError: If the description says another number of coordinates than it has columns.
    """
    is_angle = angles(description)
    parts, refusals = read_parts(description)
    found = {
        name: [one if isinstance(one, Unreadable) else _log_of(name, one, description, is_angle) for one in part]
        for name, part in parts.items()
    }
    return Logs(tuple(one for part in found.values() for one in _told_apart(part)), refusals)


def _told_apart(part: Sequence[Log | Unreadable]) -> list[Log | Unreadable]:
    """The logs of a part, each with a name of its own where folders tell them apart."""
    names = [one.name for one in part]
    above = [one.path.resolve().parent.parts[1:] for one in part]
    for depth in range(max(map(len, above), default=0)):
        places: dict[str, set[tuple[str, ...]]] = {}
        for name, folders in zip(names, above, strict=True):
            places.setdefault(name, set()).add(folders)
        names = [
            f"{folders[-1 - depth]}-{name}" if len(places[name]) > 1 and depth < len(folders) else name
            for name, folders in zip(names, above, strict=True)
        ]
    return [dataclasses.replace(one, name=name) for one, name in zip(part, names, strict=True)]


def angles(description: Description) -> np.ndarray:
    """Find out which coordinates are angles; there must be one per position column.

    Args:
        description: What it says.

    Returns:
        Whether each coordinate is an angle.

    Raises:
        DataError: If the space is misspelt, or has another number of coordinates than there are position columns.
    """
    is_angle = np.array(angles_of(description.path, description.space))
    if isinstance(description.positions, tuple):
        _refuse_other_size(description.path, description.space, is_angle, len(description.positions))
    return is_angle


def _refuse_other_size(path: Path, space: str, is_angle: np.ndarray, columns: int) -> None:
    """Refuse a space with another number of coordinates than there are position columns."""
    if len(is_angle) != columns:
        raise DataError(
            f"`{path}`: `space` must have one coordinate per position column; `{space}` has {len(is_angle)}, "
            f"`positions` has {columns}. Write for example R{columns} for lengths, T{columns} for angles; a column "
            'whose cells hold lists is taken whole by `positions = "state"`, or one by one: "state[0]", "state[1]".'
        )


def _log_of(part: str, rows: Rows, description: Description, is_angle: np.ndarray) -> Log | Unreadable:
    """The log of a recording, or why there is none."""
    name = "-".join(str(each) for each in (stem_of(rows.path), rows.label, rows.interval) if each is not None)
    try:
        return _log(part, name, rows, description, is_angle)
    except DataError as error:
        return Unreadable(part=part, name=name, path=rows.path, error=error)


def _log(part: str, name: str, rows: Rows, description: Description, is_angle: np.ndarray) -> Log:
    """The rows of a file by what they mean."""
    if len(rows) < 2:
        chosen = description.parts[part].rows_of(rows.path) != ALL_ROWS
        which = f"`{description.recording or 'recording'}` = {rows.label}: " if rows.label else ""
        raise DataError(
            f"`{rows.path}`: {which}a recording must have at least 2 rows; got {len(rows)}"
            + (f", from row {rows.index[0]} on" if chosen and len(rows) else "")
            + f". {'Correct `rows`, or leave' if chosen else 'Leave'} it out"
            + (": name the others by `recordings`." if rows.label else ".")
        )
    rows, repeats = _without_repeats(rows)
    rows, impossible = without_impossible(rows, description.units, description.zeros)
    q, rates = rows.signals["positions"], rows.signals.get("rates")
    _refuse_other_size(rows.path, description.space, is_angle, q.shape[1])
    if rates is not None and rates.shape != q.shape:
        raise DataError(
            f"`{rows.path}`: velocities or momenta must have one column per position, {q.shape[1]}; "
            f"got {rates.shape[1]}."
        )
    estimates = description.estimated_velocities
    if estimates is not None and len(estimates.noise_gain) != q.shape[1]:
        raise DataError(
            f"`{rows.path}`: `estimated_velocities` must have a noise_gain per position, {q.shape[1]}; got "
            f"{len(estimates.noise_gain)}."
        )
    return Log(
        part=part,
        name=name,
        path=rows.path,
        rows=rows.index,
        ts=_times(rows, description),
        q=q,
        rates=rates,
        us=rows.signals["inputs"],
        names=rows.names,
        units=_si_units(rows, description, is_angle),
        impossible=impossible,
        repeats=repeats,
        clocks=rows.clocks,
        drives=rows.drives,
        files=rows.files,
    )


def _without_repeats(rows: Rows) -> tuple[Rows, tuple[int, ...]]:
    """Leave out rows that repeat the one before, if all that have its time stamp do: else stamps are rounded.

    Returns:
        The others, and which of the file's rows were left out.
    """
    if "time" not in rows.signals:
        return rows, ()
    numbers = np.concatenate([signal for role, signal in rows.signals.items() if role != "time"], axis=1)
    at_once = np.flatnonzero((np.diff(rows.signals["time"], axis=0) == 0).all(axis=1)) + 1
    if not np.array_equal(numbers[at_once], numbers[at_once - 1], equal_nan=True):
        return rows, ()
    kept = np.delete(np.arange(len(rows)), at_once)
    return rows.take(kept, rows.label), tuple(rows.index[at_once].tolist())


def _si_units(rows: Rows, description: Description, is_angle: np.ndarray) -> dict[str, tuple[str, ...]]:
    """SI units of the columns, as far as the description or the space tells them."""
    units = {role: [of_column(name, description.si_units) or "" for name in rows.names[role]] for role in rows.names}
    rates = units["rates"] if description.velocities is not None else [""] * len(is_angle)
    units["positions"] = [
        "rad" if angle else unit or of_rate.removesuffix("/s")
        for angle, unit, of_rate in zip(is_angle, units["positions"], rates, strict=True)
    ]
    if description.velocities is not None:
        units["rates"] = [
            unit or (f"{of_position}/s" if of_position else "")
            for unit, of_position in zip(rates, units["positions"], strict=True)
        ]
    return {role: tuple(every) for role, every in units.items()}


def _times(rows: Rows, description: Description) -> np.ndarray:
    """Time stamps in the order of the rows."""
    if description.time is None and description.dt is not None:
        return description.dt * np.arange(len(rows), dtype=np.float64)
    times, columns = rows.signals["time"], rows.names["time"]
    if len(columns) != 1:
        raise DataError(f"`{rows.path}`: `{description.time}` must be one column of times; got {len(columns)} columns.")
    return times[:, 0]
