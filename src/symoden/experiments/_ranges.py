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
        positions: Of each coordinate; angles without jumps of 2π.
        rates: Of each velocity or momentum.
        inputs: Of each input.
    """

    positions: Bounds
    rates: Bounds
    inputs: Bounds

    @classmethod
    def of(cls, trajectories: Sequence[Trajectory]) -> "Ranges":
        """Ranges of recordings.

        Args:
            trajectories: At least one recording.

        Returns:
            The ranges.
        """

        def bounds(columns: Float[np.ndarray, "T k"]) -> Bounds:
            low, high = columns.min(axis=0), columns.max(axis=0)
            return tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))

        return cls(
            positions=bounds(np.concatenate([trajectory.q for trajectory in trajectories])),
            rates=bounds(np.concatenate([trajectory.rates for trajectory in trajectories])),
            inputs=bounds(np.concatenate([trajectory.us for trajectory in trajectories])),
        )

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
        inside = np.all((above >= 0) & (above <= high - low + 2 * slack), axis=1)
        for bounds, columns in ((self.rates, rates), (self.inputs, us)):
            if bounds and columns is not None:
                low, high = np.asarray(bounds).T
                inside &= np.all((columns >= low - _SLACK) & (columns <= high + _SLACK), axis=1)
        return ~inside
