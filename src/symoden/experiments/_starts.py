"""States that episodes of a controller begin at."""

from typing import Final, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from symoden.control import Method, lowest
from symoden.systems import Machine

_LEAST: Final = 0.1  # [rad] that what holds a target is tried from, whatever the data: twice the tolerance.


class Starts(NamedTuple):
    """Where episodes begin: uniformly within boxes.

    Attributes:
        middle: Configuration in the middle.
        q: Largest distance of each coordinate from it; half a turn is anywhere.
        v: Largest speed of each.
    """

    middle: Float[np.ndarray, " n"]
    q: Float[np.ndarray, " n"]
    v: Float[np.ndarray, " n"]

    def draw(self, episodes: int, seed: int) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
        """Draw random states.

        Args:
            episodes: Number of states.
            seed: Seed of the draw.

        Returns:
            Coordinates and velocities.
        """
        share_q, share_v = np.random.default_rng(seed).uniform(-1, 1, (2, episodes, len(self.middle)))
        return self.middle + self.q * share_q, self.v * share_v


def starts_of(machine: Machine, method: Method) -> Starts:
    """Where episodes begin: as far from the target as the method claims to reach.

    What only holds the target starts within 0.6 rad of it, lengths within 0.5 m; an acrobot within 0.2 rad of it, or of
    where its potential energy is lowest if it swings up; everything else starts anywhere, with the speeds of the
    paper's tasks.

    A learned model knows no more than its data reach: episodes begin between their ends and the target along lengths,
    and what only holds the target no farther from it than these go, as of a machine that has always been balanced.

    Args:
        machine: What is controlled.
        method: How.

    Returns:
        The boxes.
    """
    space, target = machine.system.space, np.nan_to_num(machine.target)
    least, most = np.asarray(machine.seen or [(-np.inf, np.inf)] * space.size, float).T
    target = np.where(np.isnan(machine.target), np.clip(target, least, most), target)
    free = np.isnan(machine.target).any()  # As a reaction wheel's pendulum, which no acrobot is.
    acrobot = space.size > machine.system.inputs and all(space.is_angle) and not free
    if method == "swing-up" and acrobot:
        hanging = np.asarray(lowest(machine.system, jnp.asarray(target)))
        return Starts(hanging, np.full(space.size, 0.2), np.full(space.size, 0.1))
    near = method in {"ida-pbc", "controlled-lagrangian", "lqr"}
    size = np.where(space.is_angle, (0.2 if acrobot else 0.6) if near else np.pi, 0.5)
    if near:
        size = np.minimum(size, np.where(space.is_angle, _reach(least, most, target), np.inf))
    least, most = (np.where(space.is_angle, end, bound) for end, bound in ((-np.inf, least), (np.inf, most)))
    speed = np.where(space.is_angle, 0.1 if near else 1.0, 0.05)
    low = np.maximum(target - size, np.minimum(least, target))
    high = np.minimum(target + size, np.maximum(most, target))
    return Starts((low + high) / 2, (high - low) / 2, speed)


def _reach(
    least: Float[np.ndarray, " n"], most: Float[np.ndarray, " n"], target: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """How far from a target the data go along an angle; infinite where that is half a turn about."""
    far = np.full(len(target), np.inf)
    told = most - least < np.pi
    ends = np.stack([least, most])[:, told] - target[told]
    far[told] = np.maximum(np.abs(np.mod(ends + np.pi, 2 * np.pi) - np.pi).max(axis=0), _LEAST)
    return far
