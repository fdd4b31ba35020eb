"""Where the training data lie, and how much of other data lies outside."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from symoden.data import Trajectory
from symoden.spaces import Space

Bounds: TypeAlias = tuple[tuple[float, float], ...]

_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class Ranges:
    """Least and largest value of every column of the training data.

    Attributes:
        positions: Of each coordinate; angles without jumps of 2π, in one recording or from one to the next.
        rates: Of each velocity or momentum.
        inputs: Of each input.
        cyclic: Indices of the coordinates that nothing depends on: elsewhere along these all is as it was in training.
    """

    positions: Bounds
    rates: Bounds
    inputs: Bounds
    cyclic: tuple[int, ...] = ()

    @classmethod
    def of(cls, trajectories: Sequence[Trajectory], space: Space, *, cyclic: Sequence[str] = ()) -> "Ranges":
        """Ranges of recordings.

        Args:
            trajectories: At least one recording.
            space: Space of the mechanism: recordings of an angle that are a turn apart are of the same configurations.
            cyclic: Names of the coordinates that nothing depends on, such as "q1".

        Returns:
            The ranges.
        """

        def bounds(columns: Float[np.ndarray, "T k"]) -> Bounds:
            low, high = columns.min(axis=0), columns.max(axis=0)
            return tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))

        ends = np.array([[trajectory.q.min(axis=0), trajectory.q.max(axis=0)] for trajectory in trajectories])
        for i in np.flatnonzero(space.is_angle):
            ends[:, :, i] += 2 * np.pi * _turns(*ends[:, :, i].T)[:, None]
        return cls(
            positions=bounds(ends.reshape(-1, space.size)),
            rates=bounds(np.concatenate([trajectory.rates for trajectory in trajectories])),
            inputs=bounds(np.concatenate([trajectory.us for trajectory in trajectories])),
            cyclic=tuple(i for i in range(space.size) if f"q{i + 1}" in cyclic),
        )

    def configurations(self, space: Space) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Least and largest coordinate of all configurations; −π and π where an angle went all the way round.

        Args:
            space: Space of the mechanism.

        Returns:
            Both, of each coordinate.
        """
        low, high = np.asarray(self.positions).T
        around = np.asarray(space.is_angle) & (high - low > 2 * np.pi)
        return np.where(around, -np.pi, low), np.where(around, np.pi, high)

    def outside(
        self,
        q: Float[np.ndarray, "T n"],
        rates: Float[np.ndarray, "T n"],
        us: Float[np.ndarray, "T m"] | None,
        space: Space,
    ) -> Bool[np.ndarray, " T"]:
        """Which samples have a position, rate or input that training never saw.

        Args:
            q: Coordinates.
            rates: Velocities or momenta.
            us: Inputs; None where these do not matter, as what is linear in them reaches beyond the data.
            space: Space of the mechanism; angles are compared modulo 2π.

        Returns:
            Whether each sample lies outside; samples that are not finite do.
        """
        low, high = np.asarray(self.positions).T
        slack = _SLACK * np.maximum(1.0, high - low)
        angle = np.asarray(space.is_angle)
        above = np.where(angle, np.mod(q - low + slack, 2 * np.pi), q - low + slack)
        near = (above >= 0) & (above <= high - low + 2 * slack)
        near |= np.isin(np.arange(len(low)), self.cyclic) & np.isfinite(q)
        inside = np.all(near, axis=1)
        for bounds, columns in ((self.rates, rates), (self.inputs, us)):
            if bounds and columns is not None:
                low, high = np.asarray(bounds).T
                inside &= np.all((columns >= low - _SLACK) & (columns <= high + _SLACK), axis=1)
        return ~inside


def _turns(low: Float[np.ndarray, " K"], high: Float[np.ndarray, " K"]) -> Float[np.ndarray, " K"]:
    """Whole turns by which to move intervals of an angle, so that together they reach least far.

    Returns:
        The turns; none where those as they are reach no farther.
    """
    middles = (low + high) / 2
    best, reach = np.zeros(len(low)), float(np.ptp([low.min(), high.max()]))
    for middle in middles:
        turns = np.round((middle - middles) / (2 * np.pi))
        moved = float((high + 2 * np.pi * turns).max() - (low + 2 * np.pi * turns).min())
        if moved < reach - _SLACK:
            best, reach = turns, moved
    return best
