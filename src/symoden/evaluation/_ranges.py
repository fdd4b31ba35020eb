"""Where the training data lie, and how much of other data lies outside."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from symoden.data import Trajectory
from symoden.spaces import Space

Bounds: TypeAlias = tuple[tuple[float, float], ...]

_SLACK = 1e-9


class Farthest(NamedTuple):
    """The column of a recording that lies farthest outside of what training saw.

    Attributes:
        of: What it is.
        column: Which of these, from 0 on.
        here: Its least and largest value; of an angle, by the turn that is next to training.
        training: Those in training.
        share: How far it lies outside, as a share of its range in training.
    """

    of: Literal["position", "rate", "input"]
    column: int
    here: tuple[float, float]
    training: tuple[float, float]
    share: float


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
        *,
        margin: float = 0.0,
    ) -> Bool[np.ndarray, " T"]:
        """Which samples have a position, rate or input that training never saw.

        Args:
            q: Coordinates.
            rates: Velocities or momenta.
            us: Inputs; None where these do not matter, as what is linear in them reaches beyond the data.
            space: Space of the mechanism; angles are compared modulo 2π.
            margin: How far beyond it does not count, as a share of a column's range in training.

        Returns:
            Whether each sample lies outside; samples that are not finite do.
        """
        return np.any(self._beyond(q, rates, us, space) > margin, axis=1)

    def farthest(
        self,
        q: Float[np.ndarray, "T n"],
        rates: Float[np.ndarray, "T n"],
        us: Float[np.ndarray, "T m"] | None,
        space: Space,
    ) -> Farthest | None:
        """Find the column that goes farthest beyond what training saw.

        Args:
            q: Coordinates.
            rates: Velocities or momenta.
            us: Inputs, or None, as for `outside`.
            space: Space of the mechanism.

        Returns:
            The column; None where all that is finite lies inside.
        """
        beyond = self._beyond(q, rates, us, space)
        reach = np.where(np.isfinite(beyond), beyond, 0.0).max(axis=0)
        column = int(reach.argmax())
        if not reach[column]:
            return None
        columns, bounds = self._columns(q, rates, us)
        role, index = divmod(column, space.size) if column < 2 * space.size else (2, column - 2 * space.size)
        of: Literal["position", "rate", "input"] = ("position", "rate", "input")[role]
        (low, high), values = bounds[column], columns[:, column]
        if of == "position" and space.is_angle[index]:
            middle = (low + high) / 2
            values = middle + np.mod(values - middle + np.pi, 2 * np.pi) - np.pi
        here = float(np.nanmin(values)), float(np.nanmax(values))
        return Farthest(of=of, column=index, here=here, training=(low, high), share=float(reach[column]))

    def _columns(
        self, q: Float[np.ndarray, "T n"], rates: Float[np.ndarray, "T n"], us: Float[np.ndarray, "T m"] | None
    ) -> tuple[Float[np.ndarray, "T k"], Bounds]:
        """All columns beside each other, NaN where one is not finite, and their ranges in training."""
        driven = us is not None and bool(self.inputs)
        columns = np.concatenate([q, rates, us] if driven else [q, rates], axis=1)
        bounds = self.positions + self.rates + (self.inputs if driven else ())
        return np.where(np.isfinite(columns), columns, np.nan), bounds

    def _beyond(
        self,
        q: Float[np.ndarray, "T n"],
        rates: Float[np.ndarray, "T n"],
        us: Float[np.ndarray, "T m"] | None,
        space: Space,
    ) -> Float[np.ndarray, "T k"]:
        """How far every column of every sample lies outside, as a share of its range; infinite where none is finite."""
        columns, bounds = self._columns(q, rates, us)
        low, high = np.asarray(bounds).T
        far = np.maximum(low - columns, columns - high)
        turned = np.mod(columns - low, 2 * np.pi)
        round_trip = np.minimum(turned - (high - low), 2 * np.pi - turned)
        is_angle = np.zeros(len(low), bool)
        is_angle[: space.size] = space.is_angle
        far = np.where(is_angle, round_trip, far)
        far[:, list(self.cyclic)] *= 0.0  # NaN stays.
        slack = _SLACK * np.maximum(1.0, high - low)
        share = np.maximum(far - slack, 0.0) / np.maximum(high - low, _SLACK)
        return np.where(np.isnan(share), np.inf, share)


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
