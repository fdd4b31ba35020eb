"""From a description to the recordings that it describes."""

import dataclasses
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ._dataset import Dataset
from ._errors import DataError, DataWarning, listing
from ._findings import Finding
from ._trajectory import Trajectory
from .checks import Examination, find_merged, survey
from .description import Description, Unreadable, of_column, read_description, split_unit
from .dynamics import find_doubts
from .files import Table
from .logs import (
    Log,
    Mask,
    angles,
    find_arrivals,
    find_copies,
    find_other_clocks,
    find_polled,
    find_uneven,
    read_all,
    recordings_of,
)

_SHOWN = 3  # recordings that a warning names


def read_dataset(
    description: Path | str | Mapping[str, object],
    *,
    space: str | None = None,
    tables: Mapping[str, Table] | None = None,
) -> Dataset:
    """Read the data set that a TOML file describes, or a mapping of the same keys.

    Rows that lack a number are left out, and a recording is split at gaps in time. `check_dataset` tells more.

    Args:
        description: The description's file, or a mapping of its keys; files that this names are looked for in the
            working directory.
        space: Configuration space to take instead of the description's, such as "R1" for an angle that shall count as
            a number.
        tables: Tables in memory, by the names or patterns that the description gives as `files`, and in place of
            these: mappings of names to arrays, data frames of pandas or Polars, structured arrays.

    Returns:
        Its recordings: angles without jumps of 2π, late velocities estimated anew, inputs delayed, resampled and split
        as described.

    Raises:
        DataError: If the description or a file is not what it must be, or one part has rows of another one.

    Warns:
        DataWarning: If something was left out, or looks wrong: a stuck sensor, a wrong unit, sign, delay or hold, a
            part that has rows of another one in a file of its own; if velocities come late and are estimated from the
            positions instead.

    Example:
        >>> arm = read_dataset("arm.toml")  # doctest: +SKIP
        >>> [recording.name for recording in arm.test]  # doctest: +SKIP
        ['20230629-143524']
        >>> ts = np.linspace(0.0, 2.0, 201)
        >>> columns = {"time": "t", "positions": ["q"], "inputs": ["u"]}
        >>> said = {"space": "T1", **columns, "train": {"files": ["swing*"]}}
        >>> read_dataset(said, tables={"swing1": {"t": ts, "q": np.sin(3 * ts), "u": np.zeros(201)}}).train
        (Trajectory('swing1': 201 samples, 2 s, n = 1, m = 1, estimated rates),)
    """
    said = read_description(description, space=space, tables=tables)
    is_angle = angles(said)
    logs, unreadable, refusals = read_all(said, is_angle)
    _refuse_unreadable(said, unreadable)
    used, rows, examinations, replaced = survey(logs, said, is_angle)
    masks = [_usable(each) for each in rows]
    recordings = [recordings_of(log, chosen, said, is_angle) for log, chosen in zip(used, masks, strict=True)]
    if refusals:  # What is wrong with a file comes before what is wrong with it beside others.
        raise refusals[0]
    dataset = assemble(said, used, recordings)
    _warn_of_clocks(said, logs, is_angle)
    _warn_of_masks(said, used, masks)
    _warn_of_suspicions(said, logs, examinations, replaced)
    doubts = find_doubts(with_full_names(dataset, used), said, is_angle)
    for finding in (*find_copies(logs), *doubts.description, *doubts.files):
        if finding.level == "warning":
            warnings.warn(f"`{said.path}`: {finding.text}. {finding.advice}", DataWarning, stacklevel=2)
    return dataset


def _refuse_unreadable(description: Description, unreadable: Sequence[Unreadable]) -> None:
    """Refuse files that cannot be read: the first one, and how many there are."""
    if not unreadable:
        return
    first, *others = unreadable
    more = len({(one.path, one.name) for one in others} - {(first.path, first.name)})
    told = f" {more} more cannot be read either: {description.check} says why." if more else ""
    raise DataError(f"{first.error}{told}") from first.error


def _usable(rows: Mask | DataError) -> Mask:
    """The rows of a log, if there are any."""
    if isinstance(rows, DataError):
        raise rows
    return rows


def assemble(description: Description, logs: Sequence[Log], recordings: Sequence[tuple[Trajectory, ...]]) -> Dataset:
    """Put recordings together with what the description says of them.

    Args:
        description: What it says.
        logs: Every log.
        recordings: The recordings of each log.

    Returns:
        The data set.

    Raises:
        DataError: If the recordings do not belong together.
    """
    parts: Mapping[str, list[Trajectory]] = {"train": [], "test": [], "validation": []}
    for log, each in zip(logs, recordings, strict=True):
        parts[log.part].extend(each)
    names = [_plain(logs[0].names[role], description.units) for role in ("positions", "inputs")]
    short = _without_common_path([*names[0], *names[1]])
    return Dataset(
        name=description.path.stem,
        space=description.space,
        train=tuple(parts["train"]),
        test=tuple(parts["test"]),
        validation=tuple(parts["validation"]),
        momenta=description.momenta is not None,
        hold=description.hold,
        input_matrix=None if description.input_matrix is None else np.array(description.input_matrix),
        known=description.known,
        position_names=short[: len(names[0])],
        input_names=short[len(names[0]) :],
        position_units=logs[0].units["positions"],
        # What was logged late (a delay below zero) acts no sooner.
        delay=max(0.0, *description.input_delay) + max(description.position_delay),
        lag=description.input_lag if any(description.input_lag) else (),
    )


def with_full_names(dataset: Dataset, logs: Sequence[Log]) -> Dataset:
    """Name columns as the description does: what messages advise is to be written there.

    Args:
        dataset: The data set.
        logs: Its logs.

    Returns:
        The same data set, its names neither short nor without units.
    """
    names = logs[0].names
    return dataclasses.replace(dataset, position_names=names["positions"], input_names=names["inputs"])


def _plain(names: Sequence[str], units: Mapping[str, float]) -> tuple[str, ...]:
    """Names of columns without the units that their numbers no longer have, where they can be told apart without."""
    plain = tuple(name if of_column(name, units) is None else split_unit(name)[0] for name in names)
    return plain if len(set(plain)) == len(plain) else tuple(names)


def _without_common_path(names: Sequence[str]) -> tuple[str, ...]:
    """Names of topics, or of arrays in groups, without what all of them begin and end with."""
    paths = [name.split("/") for name in names]
    if len(names) == 1 or any(len(path) == 1 or " " in name for path, name in zip(paths, names, strict=True)):
        return tuple(names)
    for end in (0, -1):
        while min(map(len, paths)) > 1 and len({path[end] for path in paths}) == 1:
            paths = [path[1:] if end == 0 else path[:-1] for path in paths]
    return tuple("/".join(path) for path in paths)


def _warn_of_clocks(description: Description, logs: Sequence[Log], is_angle: np.ndarray) -> None:
    """Say in one line that tables had several clocks, in another that stamps are of arrival, and what looks wrong."""
    merged = {log.name: log.merged.columns for log in logs if log.merged is not None}
    if merged:
        columns = listing(dict.fromkeys(name for each in merged.values() for name in each))
        more = f" and {len(merged) - 1} more" if len(merged) > 1 else ""
        warnings.warn(
            f"`{description.path}`: {columns} and the positions have numbers in different rows of "
            f"`{next(iter(merged))}`{more}: brought to the rows of the positions. {description.check} says more.",
            DataWarning,
            stacklevel=3,
        )
    told = list(zip(_told_apart(logs), logs, strict=True))
    arrived = [f"{name}: {each.text}" for name, log in told for each in find_arrivals(log)]
    if arrived:
        _warn(description, "not taken at the times that were logged,", arrived)
    polled = [f"{name}: {each.text}" for name, log in told for each in find_polled(log)]
    if polled:
        _warn(description, "left out in", polled)
    wrong = [
        f"{name}: {each.text}"
        for name, log in told
        for each in (*find_merged(log), *find_uneven(log, is_angle))
        if each.level != "note"
    ]
    if wrong:
        _warn(description, "perhaps wrong in", wrong)


def _warn_of_masks(description: Description, logs: Sequence[Log], masks: Sequence[Mask]) -> None:
    """Say in one line what was left out."""
    said = [mask.describe(log.name) for log, mask in zip(logs, masks, strict=True)]
    masked = [f"{name}: {what}" for name, what in zip(_told_apart(logs), said, strict=True) if what]
    if masked:
        _warn(description, "left out in", masked)


def _warn_of_suspicions(
    description: Description,
    logs: Sequence[Log],
    examinations: Sequence[Examination],
    replaced: Finding | None,
) -> None:
    """Say in one line what looks wrong, and in another what became of velocities that come late."""
    found = [
        f"{name}: {finding.text.removesuffix('?')}"
        for name, clocks, examination in zip(
            _told_apart(logs), find_other_clocks(logs, description), examinations, strict=True
        )
        for finding in (*clocks, *examination.findings)
        if finding.level == "warning"
    ]
    if found:
        _warn(description, "perhaps wrong in", found)
    if replaced:
        warnings.warn(f"`{description.path}`: {replaced.text}. {replaced.advice}", DataWarning, stacklevel=3)


def _told_apart(logs: Sequence[Log]) -> list[str]:
    """Names of logs, with their parts where several parts have one name, as of one file."""
    count = Counter(name for name, _ in {(log.name, log.part) for log in logs})
    return [f"`{log.name}`" + f" ({log.part})" * (count[log.name] > 1) for log in logs]


def _warn(description: Description, what: str, every: list[str]) -> None:
    """Warn of something in several recordings, naming the first ones."""
    more = f"; and {len(every) - _SHOWN} more" if len(every) > _SHOWN else ""
    said = f"{'; '.join(every[:_SHOWN])}{more}"
    warnings.warn(
        f"`{description.path}`: {what} {said}{'' if said.endswith('?') else '.'} {description.check} says what to do.",
        DataWarning,
        stacklevel=4,
    )
