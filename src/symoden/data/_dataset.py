"""Recordings of one mechanism, with what is known of their meaning."""

import dataclasses
import functools
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from symoden.known import KnownParts
from symoden.units import position_units

from ._errors import DataError
from ._trajectory import Trajectory, finite_numbers, log_numbers

_PARTS: Final = ("train", "test", "validation")


@dataclass(frozen=True, kw_only=True, eq=False)
class Dataset:
    """Recordings of one mechanism in three parts that have nothing in common, and what their numbers mean.

    Angles may be wrapped: where one jumps by more than π [rad] from a sample to the next, it is taken to have gone the
    short way round, and turns of 2π are added. So an angle must move by less than π from sample to sample.

    Attributes:
        name: Name in results.
        space: Configuration space, one factor per coordinate in the order of the columns of `q`: "R1", "T2", "R1 T1".
        train: Recordings to learn from; any iterable is made a tuple.
        test: Recordings for the final score only.
        validation: Recordings for every choice made during training; `split_validation` makes them from `train`.
        momenta: Whether `rates` are momenta rather than velocities.
        hold: What an input is between samples: constant ("zero") or a straight line ("linear").
        input_matrix: Known g (n × m), which fixes the scale of inertia, energy and friction; absent if unknown.
        known: Parts of the mechanism that are given as formulas or functions, or up to parameters.
        position_names: Names of the columns of `q`.
        input_names: Names of the columns of `us`.
        position_units: What each coordinate is measured in: "rad", "m", or "" where it is as it was logged. Angles on T
            are in rad; a coordinate on R may be an angle, too, that does not come back after a turn.
        delay: How late the machine's inputs act on what its sensors tell [s]. It concerns controllers: in recordings
            all is where it belongs.
        lag: Time constant of the lag by which what acts follows each input [s], none if empty; recordings have what
            acts.

    Example:
        >>> import numpy as np
        >>> ts = np.linspace(0.0, 1.0, 11)
        >>> swing = Trajectory(name="swing", ts=ts, q=ts[:, None], rates=np.ones((11, 1)), us=np.zeros((11, 0)))
        >>> dataset = Dataset(name="pendulum", space="T1", train=(swing,))
        >>> dataset.size, dataset.inputs
        (1, 0)
    """

    name: str
    space: str
    train: tuple[Trajectory, ...]
    test: tuple[Trajectory, ...] = ()
    validation: tuple[Trajectory, ...] = ()
    momenta: bool = False
    hold: Literal["zero", "linear"] = "zero"
    input_matrix: np.ndarray | None = None
    known: KnownParts | None = None
    position_names: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()
    position_units: tuple[str, ...] = ()
    delay: float = 0.0
    lag: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Complete names and units, unwrap angles, and refuse parts that do not belong together.

        Raises:
            DataError: If a part is no sequence of recordings, there is no recording, sizes differ, a part is repeated
                in another one, a unit is none of a coordinate, or a delay or lag is no time.
        """
        for part in _PARTS:
            object.__setattr__(self, part, _recordings(self.name, part, getattr(self, part)))
        if not self.recordings:
            raise DataError(f"`{self.name}`: a data set must have at least one recording; got none.")
        _refuse_mixed_sizes(self.name, self.recordings)
        is_angle = _angles_of(self.name, self.space, self.size)
        for part in _PARTS:
            object.__setattr__(self, part, tuple(_unwrapped(each, is_angle) for each in getattr(self, part)))
        _refuse_shared_recordings(self)
        if self.hold not in ("zero", "linear"):
            raise DataError(f'`{self.name}`: `hold` must be "zero" or "linear"; got {self.hold!r}.')
        if self.input_matrix is not None:
            matrix = finite_numbers(self.input_matrix, f"`{self.name}`: `input_matrix`", axes=2)
            if matrix.shape != (self.size, self.inputs):
                raise DataError(
                    f"`{self.name}`: `input_matrix` must be {self.size} × {self.inputs} (coordinates × inputs); "
                    f"got {matrix.shape[0]} × {matrix.shape[1]}."
                )
            object.__setattr__(self, "input_matrix", matrix)
            if self.known is not None and self.known.input_matrix is not None:
                raise DataError(
                    f"`{self.name}`: `input_matrix` must be given once; got it by itself and among the known parts. "
                    "Remove one of them."
                )
        for field, letter, count in (("position_names", "q", self.size), ("input_names", "u", self.inputs)):
            names = getattr(self, field) or tuple(f"{letter}{i + 1}" for i in range(count))
            if len(names) != count:
                raise DataError(f"`{self.name}`: `{field}` must be {count} names; got {len(names)}: {names}.")
            object.__setattr__(self, field, names)
        object.__setattr__(self, "position_units", _units_of(self.name, is_angle, self.position_units))
        object.__setattr__(self, "lag", _lags_of(self))

    def __repr__(self) -> str:
        """What it is, in a line."""
        parts = ", ".join(f"{len(getattr(self, part))} {part}" for part in _PARTS if getattr(self, part))
        of = f"positions {', '.join(self.position_names)}"
        inputs = f"; inputs {', '.join(self.input_names)}" if self.inputs else ""
        return f"Dataset({self.name!r}, {self.space}: {parts}; {of}{inputs})"

    @property
    def recordings(self) -> tuple[Trajectory, ...]:
        """All recordings: train, test, validation."""
        return self.train + self.test + self.validation

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return self.recordings[0].q.shape[1]

    @property
    def inputs(self) -> int:
        """Number of inputs m."""
        return self.recordings[0].us.shape[1]

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256: data that moved from one part to another, or of which something else is told, differ.

        Names and units do not count: no result depends on what the same numbers are called, but for which recordings
        are pieces of one log (`#1`, `#2`, …).
        """
        known = None if self.known is None else self.known.fingerprint
        digest = hashlib.sha256(f"({self.space!r}, {self.momenta!r}, {self.hold!r}, {known})".encode())
        arrays = {"input_matrix": np.zeros(0) if self.input_matrix is None else self.input_matrix}
        for part in ("train", "validation", "test"):
            for k, recording in enumerate(getattr(self, part)):
                arrays |= {f"{part}/{k}/{name}": getattr(recording, name) for name in ("ts", "q", "rates", "us")}
        told = _beside_numbers(self.train + self.validation + self.test)
        if told != [(k, "", 1, 0.0, []) for k in range(len(told))]:  # Of whole logs as measured it is as it always was.
            digest.update(repr(told).encode())
        for name, array in arrays.items():
            digest.update(f"{name} {array.shape}".encode())
            digest.update(array.tobytes())
        return digest.hexdigest()


def _beside_numbers(recordings: Sequence[Trajectory]) -> list[tuple[int, str, int, float, list[float]]]:
    """What else training goes by: log and piece, initial samples, and how rates were estimated."""
    return [
        (
            number,
            each.name.partition("#")[2],
            each.initial_samples,
            each.one_sided,
            [] if each.noise_gain is None else np.ravel(each.noise_gain).tolist(),
        )
        for number, each in zip(log_numbers(recordings).tolist(), recordings, strict=True)
    ]


def _recordings(name: str, part: str, given: Iterable[Trajectory] | Trajectory) -> tuple[Trajectory, ...]:
    """The recordings of a part, whatever holds them."""
    every = tuple(given) if isinstance(given, Iterable) else (given,)
    if wrong := [each for each in every if not isinstance(each, Trajectory)]:
        raise DataError(
            f"`{name}`: `{part}` must be recordings, each a `Trajectory`; got {type(wrong[0]).__name__}. "
            "`read_dataset` reads a description of files."
        )
    return every


def _refuse_mixed_sizes(name: str, recordings: tuple[Trajectory, ...]) -> None:
    """Refuse recordings that differ in their number of coordinates or inputs."""
    first = recordings[0]
    for other in recordings[1:]:
        if other.q.shape[1] != first.q.shape[1] or other.us.shape[1] != first.us.shape[1]:
            raise DataError(
                f"`{name}`: all recordings must have the same coordinates and inputs; `{first.name}` has "
                f"{first.q.shape[1]} and {first.us.shape[1]}, `{other.name}` has {other.q.shape[1]} and "
                f"{other.us.shape[1]}."
            )


def _angles_of(name: str, space: str, size: int) -> np.ndarray:
    """Whether each coordinate is an angle; the space must be known and have as many as the recordings."""
    from symoden.spaces import Space

    if not isinstance(space, str):
        raise DataError(f'`{name}`: `space` must be its name, such as "T1 R1"; got {type(space).__name__}.')
    try:
        known = Space.parse(space)
    except ValueError as error:
        raise DataError(f"`{name}`: {error}") from error
    if known.size != size:
        raise DataError(
            f"`{name}`: the space `{space}` has {known.size} coordinate{'s' if known.size > 1 else ''}, the recordings "
            f"have {size}. Give one factor per position column, in their order."
        )
    return np.array(known.is_angle)


def _lags_of(dataset: Dataset) -> tuple[float, ...]:
    """Lags of a data set's inputs, refused like its delay where they are no times."""
    lags = finite_numbers(dataset.lag, f"`{dataset.name}`: `lag`", axes=1) if len(dataset.lag) else np.zeros(0)
    if len(lags) not in (0, 1, dataset.inputs) or min([dataset.delay, *lags]) < 0 or not np.isfinite(dataset.delay):
        raise DataError(
            f"`{dataset.name}`: `delay` and `lag` must be at least 0 s, lags none, one, or one per input "
            f"({dataset.inputs}); got {dataset.delay} and {lags.tolist()}."
        )
    return tuple(lags.tolist())


def _units_of(name: str, is_angle: np.ndarray, told: tuple[str, ...]) -> tuple[str, ...]:
    """What each coordinate is measured in, as far as that is known."""
    try:
        return position_units(is_angle.tolist(), told)
    except ValueError as error:
        raise DataError(f"`{name}`: {error}") from error


def _unwrapped(recording: Trajectory, is_angle: np.ndarray) -> Trajectory:
    """The recording with angles without jumps of 2π; itself if it has none."""
    turned = is_angle & (np.abs(np.diff(recording.q, axis=0)) > np.pi).any(axis=0)
    if not turned.any():
        return recording
    q = recording.q.copy()
    q[:, turned] = np.unwrap(q[:, turned], axis=0)
    return dataclasses.replace(recording, q=q)


def _refuse_shared_recordings(dataset: Dataset) -> None:
    """Refuse a recording that is in two parts: a test on what was learned from tells nothing."""
    parts = {part: getattr(dataset, part) for part in _PARTS}
    seen: dict[tuple[bytes, ...], tuple[str, str]] = {}
    for part, recordings in parts.items():
        for recording in recordings:
            contents = tuple(array.tobytes() for array in (recording.ts, recording.q, recording.rates, recording.us))
            other, name = seen.setdefault(contents, (part, recording.name))
            if other != part:
                raise DataError(
                    f"`{dataset.name}`: `{recording.name}` of `{part}` must not be a recording of `{other}`; it equals "
                    f"`{name}` number by number. Leave it out of one of the two."
                )
