"""One recording of a mechanism."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Int

from ._errors import DataError
from ._shapes import Times

ROUNDED: Final = (
    "Where some are equal because they are rounded, or tell when rows arrived, write the step in seconds at which rows "
    "were taken as `dt` beside `time`, or in its place."
)
"""Advice on time stamps of which some are equal."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Positions, rates and inputs of a mechanism at increasing times; its arrays are copies that cannot be written to.

    Attributes:
        name: Name in messages and results; a file's stem, with `#1`, `#2`, … where the file was split.
        ts: Time stamps [s], strictly increasing, spaced as they were recorded.
        q: Positions; lengths in their unit, angles [rad]; a data set takes out jumps of 2π.
        rates: Velocities or momenta; the data set says which.
        us: Inputs; with hold "zero", `us[k]` acts on [`ts[k]`, `ts[k + 1]`). No columns mean free motion.
        initial_samples: How many samples may be used to find the first state; scoring starts after them.
        noise_gain: Standard deviation of the rates' noise over that of the positions' [1/s], for each coordinate or one
            for all, where the rates were estimated from the positions (`velocity_noise_gain` says it); None where they
            were measured.
        one_sided: Time at either end in which estimated rates had samples on one side alone [s]; 0 where they were
            measured.

    Example:
        >>> import numpy as np
        >>> ts = np.linspace(0.0, 1.0, 11)
        >>> swing = Trajectory(name="swing", ts=ts, q=ts[:, None], rates=np.ones((11, 1)), us=np.zeros((11, 0)))
        >>> len(swing), swing.duration
        (11, 1.0)
    """

    name: str
    ts: np.ndarray  # (T,), (T, n), (T, n), (T, m): refused with a DataError otherwise, with or without type checks
    q: np.ndarray
    rates: np.ndarray
    us: np.ndarray
    initial_samples: int = 1
    noise_gain: np.ndarray | float | None = None  # (n,) once made
    one_sided: float = 0.0

    def __post_init__(self) -> None:
        """Copy the arrays, and refuse what is no recording.

        Raises:
            DataError: If a shape, a value, the order of the times, the number of initial samples or the gain is wrong.
        """
        if self.rates is None:
            raise DataError(
                f"`{self.name}`: `rates` must be velocities or momenta; got None. `estimate_velocities(ts, q, name=…)` "
                "makes velocities of positions."
            )
        for field, axes in (("ts", 1), ("q", 2), ("rates", 2), ("us", 2)):
            object.__setattr__(
                self, field, finite_numbers(getattr(self, field), f"`{self.name}`: `{field}`", axes=axes)
            )
        samples = len(self.ts)
        if samples < 2:
            raise DataError(f"`{self.name}`: a recording must have at least 2 samples; got {samples}.")
        if not len(self.q) == len(self.rates) == len(self.us) == samples or self.q.shape != self.rates.shape:
            raise DataError(
                f"`{self.name}`: `ts` (T,), `q` (T, n), `rates` (T, n) and `us` (T, m) must agree in T and n; got "
                f"shapes {self.ts.shape}, {self.q.shape}, {self.rates.shape}, {self.us.shape}. "
                "Free motion has `us` (T, 0)."
            )
        if self.q.shape[1] == 0:
            raise DataError(f"`{self.name}`: `q` must have at least one coordinate; got shape {self.q.shape}.")
        refuse_times_out_of_order(self.ts, f"`{self.name}`: `ts`")
        if not 1 <= self.initial_samples < samples:
            raise DataError(
                f"`{self.name}`: `initial_samples` must be at least 1 and leave a sample to score; "
                f"got {self.initial_samples} of {samples} samples."
            )
        if self.noise_gain is not None:
            object.__setattr__(self, "noise_gain", self._gains(self.noise_gain))

    def _gains(self, noise_gain: np.ndarray | float) -> np.ndarray:
        """One gain for each coordinate, checked."""
        gains = np.array(noise_gain, dtype=np.float64)
        if gains.shape not in {(), self.q.shape[1:]} or not np.all((gains > 0) & (gains < np.inf)):
            raise DataError(
                f"`{self.name}`: `noise_gain` must be positive and finite; got {noise_gain}. Give one number or one "
                "per coordinate, or leave it out where the rates were measured."
            )
        return np.broadcast_to(gains, self.q.shape[1:])

    def __repr__(self) -> str:
        """What it is, in a line."""
        sizes = f"n = {self.q.shape[1]}, m = {self.us.shape[1]}"
        rates = "" if self.noise_gain is None else ", estimated rates"
        return f"Trajectory({self.name!r}: {len(self)} samples, {self.duration:.6g} s, {sizes}{rates})"

    def __len__(self) -> int:
        """Number of samples T."""
        return len(self.ts)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.ts[-1] - self.ts[0])

    def cut(self, start: int, stop: int, *, name: str) -> "Trajectory":
        """Take the samples [start, stop) as a recording of its own, with its time stamps.

        Of estimated rates so many stay `one_sided`, at ends that are cut too: those there have seen beyond the cut.

        Args:
            start: First sample.
            stop: Sample after the last one.
            name: Name of the new recording.

        Returns:
            The part.
        """
        part = slice(start, stop)
        return dataclasses.replace(
            self, name=name, ts=self.ts[part], q=self.q[part], rates=self.rates[part], us=self.us[part]
        )


def median_step(recordings: Sequence[Trajectory]) -> float:
    """Take the median time from sample to sample.

    Args:
        recordings: Recordings, one at least.

    Returns:
        The step [s].
    """
    return float(np.median(np.concatenate([np.diff(each.ts) for each in recordings])))


def pieces_of(trajectories: Sequence[Trajectory]) -> dict[str, list[int]]:
    """Group recordings by the log that they are pieces of.

    Args:
        trajectories: Recordings; those whose names differ in what follows `#` alone are pieces of one.

    Returns:
        By the log's name, indices of its pieces.
    """
    whole: dict[str, list[int]] = {}
    for k, trajectory in enumerate(trajectories):
        whole.setdefault(trajectory.name.split("#")[0], []).append(k)
    return whole


def log_numbers(trajectories: Sequence[Trajectory]) -> Int[np.ndarray, " R"]:
    """Number the logs that recordings are pieces of, in their order.

    Args:
        trajectories: Recordings.

    Returns:
        The number of each one's log.
    """
    numbers = np.zeros(len(trajectories), int)
    for number, pieces in enumerate(pieces_of(trajectories).values()):
        numbers[pieces] = number
    return numbers


def refuse_times_out_of_order(ts: Times, where: str, *, place: Callable[[int], str] = "row {}".format) -> None:
    """Refuse time stamps that do not increase.

    Args:
        ts: Time stamps [s]; NaN where one is missing, which is passed over.
        where: Start of the message: the file and the column.
        place: What the message calls the row of a time stamp.

    Raises:
        DataError: If a time stamp is not greater than the one before it.
    """
    known = np.flatnonzero(np.isfinite(ts))
    late = np.flatnonzero(np.diff(ts[known]) <= 0)
    if late.size:
        before, k = (int(i) for i in known[late[0] : late[0] + 2])
        raise DataError(
            f"{where}, {place(k)}: times must increase; got {float(ts[k])!r} after {float(ts[before])!r} "
            f"({late.size} such row{'s' if late.size > 1 else ''}). "
            f"Sort the rows by time and keep one of each. {ROUNDED}"
        )


def finite_numbers(values: object, what: str, *, axes: int) -> np.ndarray:
    """Copy values into an array in double precision that cannot be written to.

    Args:
        values: Anything that NumPy makes an array of.
        what: Start of the message: what holds the values.
        axes: Number of axes that the array must have.

    Returns:
        The copy.

    Raises:
        DataError: If the values are no array of finite real numbers with so many axes.
    """
    try:
        array = np.array(values)
    except ValueError as error:
        raise DataError(f"{what} must be an array of numbers; got rows of different length.") from error
    if array.dtype.kind not in "biuf" or array.ndim != axes:
        column = " An array `x` of one axis becomes a column by `x[:, None]`." if (array.ndim, axes) == (1, 2) else ""
        raise DataError(
            f"{what} must be an array of real numbers with {axes} ax{'is' if axes == 1 else 'es'}; "
            f"got {array.dtype} with shape {array.shape}.{column}"
        )
    array = array.astype(np.float64)
    unfit = np.argwhere(~np.isfinite(array))
    if unfit.size:
        row = tuple(int(i) for i in unfit[0])
        raise DataError(f"{what}, row {row[0]}: must be finite; got {float(array[row])!r}.")
    array.flags.writeable = False
    return array
