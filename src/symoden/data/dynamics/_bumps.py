"""Recordings under short bumps: accelerations without a derivative of velocities, and what may cause them."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symoden.data._trajectory import Trajectory, median_step

from ._regression import unseen_residuals

_BUMP: Final = 0.15  # [s], or eight samples: what is shorter is noise of the velocities.
_FEWEST_STEPS: Final = 8
MOST: Final = 800
"""Bumps that are enough for a regression of all recordings together."""
_MANY: Final = 2  # Bumps in either half for each number of the regression.
_SHARP: Final = 0.1  # Of the usual speed, within which dry friction turns round.


class Bumps(NamedTuple):
    """A recording under bumps w.

    Attributes:
        recording: The recording.
        samples: Its samples under each bump.
        middle: Where positions are counted from, the same in all recordings; zero for angles.
        motion: ∫ w of what accelerates a mechanism beside its inputs.
        gained: ∫ w dv.
        cells: dt of every sample [s].
        given: ∫ u dt from the first row on.
        turning: w dt of every sample as it is, and as it turns with each angle.
        slopes: w′ dt of every sample.
    """

    recording: Trajectory
    samples: Int[np.ndarray, "B s"]
    middle: Float[np.ndarray, " n"]
    motion: Float[np.ndarray, "B k"]
    gained: Float[np.ndarray, "B n"]
    cells: Float[np.ndarray, "B s"]
    given: Float[np.ndarray, "T m"]
    turning: Float[np.ndarray, "B s a"]
    slopes: Float[np.ndarray, "B s"]

    def integral(self, columns: Float[np.ndarray, "T k"]) -> Float[np.ndarray, "B k"]:
        """∫ w c dt of what columns show."""
        return np.einsum("bs,bsk->bk", self.turning[:, :, 0], columns[self.samples])

    def changes(self, columns: Float[np.ndarray, "T k"]) -> Float[np.ndarray, "B k"]:
        """∫ w dc of what columns show, without a derivative of it: −∫ w′ c dt."""
        return -np.einsum("bs,bsk->bk", self.slopes, columns[self.samples])

    def pushed(self, delay: float) -> Float[np.ndarray, "B k"]:
        """∫ w u dt of inputs of some time ago, as they are and as they turn with each angle."""
        # Means over every sample's cell, half of which is before it: of an input that is held until the next row these
        # are (u[k−1] + u[k]) / 2, as it acts half a step later than its row.
        if not self.given.shape[1]:
            return np.zeros((len(self.samples), 0))
        ts = self.recording.ts
        at = ts[self.samples] - delay

        def integral(until: Float[np.ndarray, "B s"]) -> Float[np.ndarray, "B s m"]:
            return np.stack([np.interp(until, ts, column) for column in self.given.T], axis=2)

        means = (integral(at + self.cells / 2) - integral(at - self.cells / 2)) / self.cells[:, :, None]
        return np.einsum("bsm,bsa->bma", means, self.turning, optimize=True).reshape(len(at), -1)


class Rows(NamedTuple):
    """A regression of accelerations: recordings under bumps, one below another.

    Attributes:
        motion: ∫ w of what accelerates a mechanism beside its inputs.
        pushed: ∫ w u dt, input by input, as it is and as it turns with each angle.
        gained: ∫ w dv.
    """

    motion: Float[np.ndarray, "B k"]
    pushed: Float[np.ndarray, "B l"]
    gained: Float[np.ndarray, "B n"]


def stacked(parts: Sequence[Bumps], delay: float = 0.0) -> Rows:
    """Stack recordings.

    Args:
        parts: Recordings under bumps.
        delay: How late the inputs act [s].

    Returns:
        One row for each bump.
    """
    motion, gained = (np.concatenate([getattr(part, name) for part in parts]) for name in ("motion", "gained"))
    return Rows(motion, np.concatenate([part.pushed(delay) for part in parts]), gained)


def bumps_of(
    recordings: Sequence[Trajectory],
    is_angle: np.ndarray,
    *,
    first: float = 0.0,
    last: float = 0.0,
    held: bool,
    most: int = MOST,
) -> list[Bumps]:
    """Lay bumps (1 − x²)² on recordings, so many that a regression of accelerations may be asked.

    Args:
        recordings: Recordings of velocities with the same inputs.
        is_angle: Whether each coordinate is an angle.
        first: Where the first bump of each may begin [s].
        last: How long before its end the last one has to end [s].
        held: Whether inputs are held until the next sample.
        most: How many to lay, if recordings are long.

    Returns:
        One for each recording that is long enough; none where all together are too few.
    """
    size, enough = steps_under(recordings), _enough(recordings, is_angle)
    long, starts = _laid(recordings, first, last, most, enough)
    if sum(map(len, starts)) < enough:
        return []
    # Beside 1, powers of lengths that are far from zero would tell nothing. One file in another unit moves no median.
    middle = np.where(is_angle, 0.0, np.median([np.median(each.q, axis=0) for each in long], axis=0))
    return [
        under_bumps(each, start[:, None] + np.arange(size + 1), is_angle, middle, held=held)
        for each, start in zip(long, starts, strict=True)
    ]


def lacking_seconds(
    recordings: Sequence[Trajectory], is_angle: np.ndarray, *, first: float = 0.0, last: float = 0.0
) -> float:
    """Count how much longer recordings have to be for bumps to be laid on them.

    Args:
        recordings: Recordings of velocities with the same inputs.
        is_angle: Whether each coordinate is an angle.
        first: Where the first bump of each may begin [s].
        last: How long before its end the last one has to end [s].

    Returns:
        How much longer the last one would have to be, about [s]; 0 where they are long enough.
    """
    step, size, enough = median_step(recordings), steps_under(recordings), _enough(recordings, is_angle)
    long, starts = _laid(recordings, first, last, MOST, enough)
    lacking = max(0, enough - sum(map(len, starts))) * (size // 2)
    if not long:  # First of all comes what is not long enough for a single one.
        lacking += max(0, size + round((first + last) / step) - max(map(len, recordings)))
    return step * lacking


def _laid(
    recordings: Sequence[Trajectory], first: float, last: float, most: int, enough: int
) -> tuple[list[Trajectory], list[Int[np.ndarray, " b"]]]:
    """Recordings that are long enough, and the samples with which bumps begin on each."""
    step, size = median_step(recordings), steps_under(recordings)
    begin, end = (int(np.ceil(margin / step)) for margin in (first, last))
    long = [each for each in recordings if len(each) > begin + size + 1 + end]
    room = sum(len(each) - begin - size - end for each in long)
    stride = max(size // 2, min(sum(map(len, long)) // most, room // enough), 1)  # Eight joints take more than `most`.
    return long, [np.arange(begin, len(each) - end - size, stride) for each in long]


def _enough(recordings: Sequence[Trajectory], is_angle: np.ndarray) -> int:
    """How many bumps a regression takes: several for each number, in either half."""
    n, inputs = len(is_angle), recordings[0].us.shape[1]
    return 2 * _MANY * (1 + 6 * n + n * (n + 1) // 2 + inputs * (1 + 2 * int(np.sum(is_angle))))


def steps_under(recordings: Sequence[Trajectory]) -> int:
    """Count the steps that a bump spans.

    Args:
        recordings: Recordings on which bumps are laid.

    Returns:
        The number, one less than the samples.
    """
    return max(_FEWEST_STEPS, round(_BUMP / median_step(recordings)))


def unexplained(parts: Sequence[Bumps], delay: float = 0.0) -> Float[np.ndarray, "B n"]:
    """Share of the accelerations' variance that is left under each bump, by what it did not see.

    Args:
        parts: Recordings under bumps.
        delay: How late the inputs act [s].

    Returns:
        The squared residual of every bump, relative to the variance of all.
    """
    motion, pushed, gained = stacked(parts, delay)
    left = unseen_residuals(np.concatenate([motion, pushed], axis=1), gained)
    return left**2 / np.maximum(np.var(gained, axis=0), np.finfo(float).tiny)


def under_bumps(
    recording: Trajectory,
    samples: Int[np.ndarray, "B s"],
    is_angle: np.ndarray,
    middle: Float[np.ndarray, " n"],
    *,
    held: bool,
) -> Bumps:
    """Integrate a recording under bumps (1 − x²)².

    Args:
        recording: The recording.
        samples: Its samples under each bump.
        is_angle: Whether each coordinate is an angle.
        middle: Where positions are counted from.
        held: Whether inputs are held until the next sample.

    Returns:
        The recording under these bumps.
    """
    q = recording.q[:, is_angle]
    at = recording.ts[samples]
    span, times = at[:, -1:] - at[:, :1], np.gradient(at, axis=1)
    x = 2 * (at - at[:, :1]) / span - 1
    weight, slope = (1 - x**2) ** 2, -8 * x * (1 - x**2) / span
    us = recording.us
    between = us[:-1] if held else (us[:-1] + us[1:]) / 2
    sums = np.cumsum(between * np.diff(recording.ts)[:, None], axis=0)
    turns = np.concatenate([np.ones((len(q), 1)), np.cos(q), np.sin(q)], axis=1)
    return Bumps(
        recording=recording,
        samples=samples,
        middle=middle,
        motion=np.einsum("bs,bsk->bk", weight * times, _motion(recording, is_angle, middle)[samples]),
        gained=-np.einsum("bs,bsk->bk", slope * times, recording.rates[samples]),
        cells=times,
        given=np.concatenate([np.zeros((1, us.shape[1])), sums]),
        turning=(weight * times)[:, :, None] * turns[samples],
        slopes=slope * times,
    )


def _motion(recording: Trajectory, is_angle: np.ndarray, middle: Float[np.ndarray, " n"]) -> Float[np.ndarray, "T k"]:
    """What accelerates a mechanism beside its inputs, up to factors."""
    q, v = recording.q - middle, recording.rates
    usual = np.maximum(np.sqrt(np.mean(v**2, axis=0)), np.finfo(float).tiny)
    places = [np.where(is_angle, np.cos(q), q), np.where(is_angle, np.sin(q), q**2), np.where(is_angle, 0.0, q**3)]
    friction = [v, np.tanh(v / (_SHARP * usual)), v * np.abs(v)]
    i, j = np.triu_indices(q.shape[1])
    return np.concatenate([np.ones((len(q), 1)), *places, *friction, v[:, i] * v[:, j]], axis=1)
