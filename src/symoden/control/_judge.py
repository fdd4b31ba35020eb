"""Judge episodes: was the target reached and kept, and when."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.shapes import Coordinates
from symoden.spaces import Space

from ._episodes import Episode

_ROUNDING: Final = 1e-9


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """What counts as being at the target.

    Attributes:
        position: Largest distance in each coordinate [rad or m].
        velocity: Largest speed [rad/s or m/s].
        hold: For how long before the end of the episode [s].
    """

    position: float = 0.05
    velocity: float = 0.1
    hold: float = 2.0

    def check_duration(self, seconds: float) -> None:
        """Refuse episodes in which a target cannot be kept for long enough.

        Args:
            seconds: How long they last [s].

        Raises:
            ValueError: If that is shorter than `hold`.
        """
        if seconds < self.hold * (1 - _ROUNDING):
            raise ValueError(
                f"Episodes must last at least {self.hold:g} s, for which the target has to be kept; got {seconds:g} s."
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict:
    """How a batch of episodes ended.

    Attributes:
        success: Whether the target was kept until the end of each episode, for long enough.
        settling: Time [s] after which the target was never left; NaN where it was not kept.
        position_error: Largest distance from the target over the last seconds, of any coordinate.
        velocity_error: Largest speed over the last seconds.
    """

    success: Bool[np.ndarray, " k"]
    settling: Float[np.ndarray, " k"]
    position_error: Float[np.ndarray, " k"]
    velocity_error: Float[np.ndarray, " k"]


def judge(
    episodes: Episode,
    space: Space,
    target: Float[np.ndarray, " n"] | Float[np.ndarray, "T n"] | Coordinates,
    *,
    velocities: Float[np.ndarray, "T n"] | None = None,
    tolerance: Tolerance | None = None,
) -> Verdict:
    """Compare the end of each episode with the target.

    Args:
        episodes: A batch of records.
        space: Configuration space; angles count the short way round.
        target: Wanted configuration, NaN along coordinates of which nothing is wanted; or one for each sample.
        velocities: Wanted velocities at each sample; zero if absent.
        tolerance: What counts as being there.

    Returns:
        The verdict on each.

    Raises:
        ValueError: If they are shorter than a target has to be kept.
    """
    near = Tolerance() if tolerance is None else tolerance
    ts = np.asarray(episodes.ts)[0]
    near.check_duration(len(ts) * (ts[-1] - ts[0]) / max(len(ts) - 1, 1))
    wanted = ~np.isnan(np.asarray(target)) if np.ndim(target) == 1 else np.ones(space.size, bool)
    e = np.asarray(episodes.q) - np.where(wanted, target, 0.0)
    e = np.where(space.is_angle, np.mod(e + np.pi, 2 * np.pi) - np.pi, e)
    v = np.asarray(episodes.v) - (0.0 if velocities is None else velocities)
    position, speed = (np.abs(each * wanted).max(axis=2) for each in (e, v))
    with np.errstate(invalid="ignore"):
        there = (position <= near.position) & (speed <= near.velocity)
    last = ts > ts[-1] - near.hold
    success = there[:, last].all(axis=1)
    left = np.where(there, -1, np.arange(len(ts))).max(axis=1)  # Last sample away from the target.
    settling = np.where(success, ts[np.minimum(left + 1, len(ts) - 1)], np.nan)
    return Verdict(
        success=success,
        settling=settling,
        position_error=position[:, last].max(axis=1),
        velocity_error=speed[:, last].max(axis=1),
    )
