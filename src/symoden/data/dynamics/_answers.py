"""Whether a mechanism moves as single samples of its inputs would move it."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._shapes import Times
from symoden.data._trajectory import Trajectory, median_step

from ._bumps import Bumps, Rows, bumps_of, stacked, steps_under, under_bumps
from ._regression import inverse, unseen_residuals

_LATE: Final = 0.25  # [s] that a motor, a network or a propeller may take to act.
_TELLS: Final = 5.0  # Times what is left of 99 of 100 ordinary bumps, that a sample must do to be seen in the motion,
_SURE: Final = 5.0  # and standard errors of what inputs do.
_ORDINARY: Final = 0.99
_MANY: Final = 2  # Bumps for each number of the regression.
_STRIDES: Final = 4  # Of a bump, from one that is laid beside a sample to the next.


class Law(NamedTuple):
    """How a mechanism accelerates, in units of what is left of ordinary bumps.

    Attributes:
        effects: Of what moves, and of what pushes.
        errors: Factor of their covariance, the same for each coordinate.
        left: What is left under each bump, by what it did not see.
        noise: Root mean square of that, before it is scaled.
        size: Steps under a bump.
        reach: How long after a sample its answer is looked for [s].
        middle: Where positions are counted from.
    """

    effects: Float[np.ndarray, "k n"]
    errors: Float[np.ndarray, "r k"]
    left: Float[np.ndarray, "B n"]
    noise: Float[np.ndarray, " n"]
    size: int
    reach: float
    middle: Float[np.ndarray, " n"]


def law_of(
    recordings: Sequence[Trajectory], aside: Sequence[Times], is_angle: Bool[np.ndarray, " n"], *, held: bool
) -> Law | None:
    """Regress accelerations of recordings, apart from some of their times.

    Args:
        recordings: Recordings of velocities with the same inputs.
        aside: Times of each [s] at which bumps, also those that begin a while after, are left out.
        is_angle: Whether each coordinate is an angle.
        held: Whether inputs are held until the next sample.

    Returns:
        The law; none where there are too few bumps.
    """
    apart = {id(each): times for each, times in zip(recordings, aside, strict=True)}
    parts = bumps_of(recordings, is_angle, held=held)
    if not parts:
        return None
    ordinary = [Rows(*(rows[_is_apart(part, apart[id(part.recording)])] for rows in stacked([part]))) for part in parts]
    motion, pushed, gained = (np.concatenate(each) for each in zip(*ordinary, strict=True))
    causes = np.concatenate([motion, pushed], axis=1)
    if len(causes) < _MANY * causes.shape[1]:
        return None
    left = unseen_residuals(causes, gained)
    noise = np.maximum(np.sqrt(np.mean(left**2, axis=0)), np.finfo(float).tiny)
    makes = inverse(causes)
    steps = steps_under(recordings)
    reach = _LATE + steps * median_step(recordings)
    return Law(makes @ gained / noise, makes.T, left / noise, noise, steps, reach, parts[0].middle)


def _is_apart(bumps: Bumps, times: Times) -> Bool[np.ndarray, " B"]:
    """Which bumps nothing acts on that was at some times."""
    at = bumps.recording.ts[bumps.samples[:, [0, -1]]]
    return np.asarray(~((times > at[:, :1] - _LATE) & (times < at[:, 1:])).any(axis=1))


def shares_answered(
    law: Law, without: Trajectory, with_: Trajectory, times: Times, is_angle: Bool[np.ndarray, " n"], *, held: bool
) -> Float[np.ndarray, " k"]:
    """Say how much of what samples of an input would do is in the motion.

    Args:
        law: How the mechanism accelerates.
        without: A recording without the samples.
        with_: The same with them.
        times: When each acts [s], within the recording.
        is_angle: Whether each coordinate is an angle.
        held: Whether inputs are held until the next sample.

    Returns:
        The largest acceleration up to a quarter of a second later that nothing else explains, along that which the
        sample would make, relative to it; NaN where it would hardly stand out.
    """
    late = round(_LATE * (len(without) - 1) / without.duration)
    beside = np.arange(-law.size, late + 1, -(-law.size // _STRIDES))
    starts = np.clip(np.searchsorted(without.ts, times)[:, None] + beside, 0, len(without) - law.size - 1)
    samples = starts.reshape(-1, 1) + np.arange(law.size + 1)
    rest, all_ = (stacked([under_bumps(each, samples, is_angle, law.middle, held=held)]) for each in (without, with_))
    more = np.concatenate([np.zeros_like(rest.motion), all_.pushed - rest.pushed], axis=1)
    unexplained = rest.gained / law.noise - np.concatenate([rest.motion, rest.pushed], axis=1) @ law.effects
    shares = np.full(len(times), np.nan)
    for i, rows in enumerate(np.arange(len(samples)).reshape(starts.shape)):
        done = more[rows] @ law.effects
        most = int(np.argmax(np.linalg.norm(done, axis=1)))
        much = float(np.linalg.norm(done[most]))
        direction = done[most] / max(much, np.finfo(float).tiny)
        ordinary = float(np.quantile(np.abs(law.left @ direction), _ORDINARY))
        if much > max(_TELLS * ordinary, _SURE * float(np.linalg.norm(law.errors @ more[rows[most]]))):
            shares[i] = np.abs(unexplained[rows] @ direction).max() / much
    return shares
