"""From a description to the recordings that it describes."""

import itertools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ._dataset import Dataset
from ._description import Description, Part, read_description
from ._errors import DataError
from ._files import find_files
from ._readers import Rows, Selector, read_rows, suffix_of
from ._resample import resample
from ._split import segments
from ._trajectory import Trajectory, refuse_times_out_of_order
from ._velocities import estimate_velocities


def read_dataset(path: Path | str, *, space: str | None = None) -> Dataset:
    """Read the data set that a TOML file describes.

    Args:
        path: The description.
        space: Configuration space to take instead of the description's, such as "R1" for an angle that shall count as
            a number.

    Returns:
        Its recordings: angles without jumps of 2π, resampled and split as described.

    Raises:
        DataError: If the description or a file is not what it must be, or one part has rows of another one.

    Example:
        >>> arm = read_dataset("arm.toml")  # doctest: +SKIP
        >>> [recording.name for recording in arm.test]  # doctest: +SKIP
        ['20230629-143524']
    """
    path = Path(path)
    description = read_description(path, space=space)
    is_angle = _is_angle(path, description)
    parts = {"train": description.train, "test": description.test, "validation": description.validation}
    rows = {name: _read_part(path, description, part) for name, part in parts.items() if part is not None}
    _refuse_overlaps(path, rows)
    recordings = {
        name: tuple(
            recording
            for taken in rows.get(name, ())
            for recording in _recordings(taken, description, part.split_every if part else None, is_angle)
        )
        for name, part in parts.items()
    }
    names = next(taken.names for part in rows.values() for taken in part)
    return Dataset(
        name=path.stem,
        space=description.space,
        train=recordings["train"],
        test=recordings["test"],
        validation=recordings["validation"],
        momenta=description.momenta is not None,
        hold=description.hold,
        input_matrix=None if description.input_matrix is None else np.array(description.input_matrix),
        position_names=names["positions"],
        input_names=names["inputs"],
    )


def _is_angle(path: Path, description: Description) -> np.ndarray:
    """Which coordinates are angles; there must be one per position column."""
    from symoden.spaces import Space  # imports JAX

    try:
        is_angle = np.array(Space.parse(description.space).is_angle)
    except ValueError as error:
        raise DataError(f"`{path}`: `space`: {error}") from error
    if isinstance(description.positions, tuple):
        _refuse_other_size(path, description.space, is_angle, len(description.positions))
    return is_angle


def _refuse_other_size(path: Path, space: str, is_angle: np.ndarray, columns: int) -> None:
    """Refuse a space with another number of coordinates than there are position columns."""
    if len(is_angle) != columns:
        raise DataError(
            f"`{path}`: `space` must have one coordinate per position column; `{space}` has {len(is_angle)}, "
            f"`positions` has {columns}. Write for example R{columns} for lengths, T{columns} for angles."
        )


def _read_part(path: Path, description: Description, part: Part) -> tuple[Rows, ...]:
    """Rows of all files of one part."""
    selectors: dict[str, Selector] = {"positions": description.positions, "inputs": description.inputs}
    optional = {"time": description.time, "rates": description.velocities or description.momenta}
    selectors |= {role: selector for role, selector in optional.items() if selector is not None}
    return tuple(read_rows(file, selectors, slice(*part.rows)) for file in find_files(part.files, path))


def _refuse_overlaps(path: Path, parts: Mapping[str, tuple[Rows, ...]]) -> None:
    """Refuse rows that are in two parts: a test on what was learned from tells nothing."""
    for (name, rows), (other_name, other_rows) in itertools.combinations(parts.items(), 2):
        for one, other in itertools.product(rows, other_rows):
            shared = range(max(one.start, other.start), min(one.stop, other.stop))
            if one.path.samefile(other.path) and len(shared):
                raise DataError(
                    f"`{path}`: [{name}] and [{other_name}] must have no rows in common; both have rows {shared.start} "
                    f"to {shared.stop - 1} of `{one.path}`. Name other files, or other `rows`."
                )


def _recordings(
    rows: Rows, description: Description, split_every: float | None, is_angle: np.ndarray
) -> tuple[Trajectory, ...]:
    """Recordings that the rows of a file become: rates completed, resampled, split, in this order."""
    name = rows.path.name[: -len(suffix_of(rows.path))]
    if len(rows) < 2:
        raise DataError(
            f"`{rows.path}`: a recording must have at least 2 rows; got {len(rows)}, from row {rows.start} on. Correct "
            "`rows`, or leave the file out."
        )
    ts = _times(rows, description)
    q = _positions(rows, description, is_angle)
    rates = rows.signals["rates"] if "rates" in rows.signals else estimate_velocities(ts, q, name=name)
    if rates.shape != q.shape:
        raise DataError(
            f"`{rows.path}`: velocities or momenta must have one column per position, {q.shape[1]}; "
            f"got {rates.shape[1]}."
        )
    trajectory = Trajectory(
        name=name, ts=ts, q=q, rates=rates, us=rows.signals["inputs"], initial_samples=description.initial_samples
    )
    if description.resample is not None:
        trajectory = resample(trajectory, description.resample, hold=description.hold)
    return (trajectory,) if split_every is None else segments(trajectory, split_every)


def _times(rows: Rows, description: Description) -> np.ndarray:
    """Time stamps that increase."""
    if description.dt is not None:
        return description.dt * np.arange(len(rows), dtype=np.float64)
    times, columns = rows.signals["time"], rows.names["time"]
    if len(columns) != 1:
        raise DataError(f"`{rows.path}`: `{description.time}` must be one column of times; got {len(columns)} columns.")
    refuse_times_out_of_order(times[:, 0], f"`{rows.path}`: column `{columns[0]}`", first_row=rows.start)
    return times[:, 0]


def _positions(rows: Rows, description: Description, is_angle: np.ndarray) -> np.ndarray:
    """Positions, angles without jumps of 2π."""
    q = rows.signals["positions"].copy()
    _refuse_other_size(rows.path, description.space, is_angle, q.shape[1])
    q[:, is_angle] = np.unwrap(q[:, is_angle], axis=0)
    return q
