"""Where the prediction error of a model comes from that was told that an angle is a number."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from symoden.data import Trajectory
from symoden.evaluation import Prediction, Ranges
from symoden.spaces import Space

from ._portrait import coordinate_title
from ._score_task import squared_error
from ._trained import Contest


@dataclass(frozen=True, kw_only=True, eq=False)
class Extrapolation:
    """Errors of rollouts over how far the true motion leaves the coordinates that training visited.

    Attributes:
        kind: Which model.
        coordinate: Name and unit of the coordinate.
        visited: Least and largest of its values in the training data.
        beyond: How far the truth of each prediction trajectory goes beyond them; negative if it stays inside, by how
            far it keeps from the nearer end.
        errors: Squared error of each trajectory's rollout, as prediction error counts it.
        inside_median: Median error of those that stay inside; NaN if there is none.
        outside_median: Median error of the others; NaN if there is none.
        outside_share: Share of the sum of all errors that the others have.
        training: The coordinate at all samples of the training data.
        positions: The true coordinate at all samples of the prediction trajectories but the first, which is given.
        deviations: Squared error of the coordinate there.
    """

    kind: str
    coordinate: str
    visited: tuple[float, float]
    beyond: Float[np.ndarray, " k"]
    errors: Float[np.ndarray, " k"]
    inside_median: float
    outside_median: float
    outside_share: float
    training: Float[np.ndarray, " S"]
    positions: Float[np.ndarray, " P"]
    deviations: Float[np.ndarray, " P"]

    @property
    def outside(self) -> Bool[np.ndarray, " k"]:
        """Which trajectories leave the range."""
        return self.beyond > 0


def extrapolation(
    contest: Contest, rollouts: Mapping[str, Sequence[Prediction]], *, kind: str = "dissipative"
) -> Extrapolation | None:
    """Relate the prediction error of each trajectory to how far its true motion leaves the training data.

    Args:
        contest: The models.
        rollouts: Their rollouts of all prediction trajectories, from `free_rollouts`.
        kind: Which of them.

    Returns:
        What was found; None if there is no such model, or it was told that every angle is one.
    """
    told, truly = Space.parse(contest.source.dataset.space), contest.task.system.space
    misled = [
        i for i, (angle, true) in enumerate(zip(told.is_angle, truly.is_angle, strict=True)) if true and not angle
    ]
    if kind not in contest.trained or not misled:
        return None
    i, source, model = misled[0], contest.source, contest.trained[kind].model
    low, high = Ranges.of(source.dataset.train, told).positions[i]
    pairs = list(zip(source.prediction, rollouts[kind], strict=True))
    space = Space.parse(contest.task.space)
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.nan_to_num([squared_error(model, space, *pair) for pair in pairs], nan=np.inf, posinf=np.inf)
        deviations = np.concatenate([(path.q[1:, i] - truth.q[1:, i]) ** 2 for truth, path in pairs])
    beyond = np.array([_beyond(truth, i, low, high) for truth in source.prediction])
    outside = beyond > 0
    return Extrapolation(
        kind=kind,
        coordinate=coordinate_title(contest.task, i),
        visited=(low, high),
        beyond=beyond,
        errors=errors,
        inside_median=_median(errors[~outside]),
        outside_median=_median(errors[outside]),
        outside_share=_share(errors, outside),
        training=np.concatenate([recording.q[:, i] for recording in source.dataset.train]),
        positions=np.concatenate([truth.q[1:, i] for truth in source.prediction]),
        deviations=deviations,
    )


def _share(errors: Float[np.ndarray, " K"], some: Bool[np.ndarray, " K"]) -> float:
    """Share that some have of the sum; of infinite errors, their number counts."""
    weights = errors if np.isfinite(errors).all() else np.isinf(errors).astype(float)
    return float(np.sum(weights[some]) / max(float(np.sum(weights)), np.finfo(float).tiny))


def _beyond(trajectory: Trajectory, coordinate: int, low: float, high: float) -> float:
    """How far a trajectory goes beyond a range."""
    q = trajectory.q[:, coordinate]
    return float(max(low - q.min(), q.max() - high))


def _median(values: Float[np.ndarray, " k"]) -> float:
    """Median; NaN of nothing."""
    return float(np.median(values)) if len(values) else np.nan
