"""The paper's errors on a task."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from symoden.data import Trajectory
from symoden.evaluation import Prediction, predict
from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space

from ._paper import MeanStd
from ._sources import Source


@dataclass(frozen=True, kw_only=True)
class TaskScore:
    """The paper's errors: for each trajectory the sum of the squared errors of one rollout from its first point.

    Attributes:
        train: Over the training trajectories.
        test: Over the test trajectories.
        prediction: Over the longer trajectories without input.
        diverged: How many trajectories of each part have no finite error.
    """

    train: MeanStd
    test: MeanStd
    prediction: MeanStd
    diverged: dict[str, int] = field(default_factory=dict)


def score_task(model: AbstractDynamics, source: Source, *, solver: AbstractSolver) -> TaskScore:
    """Score a model by the paper's metrics, in the task's own observation space whatever the model was told.

    Args:
        model: Learned model or analytic system.
        source: A task.
        solver: What advances rollouts.

    Returns:
        The errors; a rollout that diverges makes its error NaN or infinite.

    Raises:
        ValueError: If the source is no task.
    """
    if source.task is None:
        raise ValueError(f"The paper's errors are those of a task; got the data set `{source.name}`.")
    space = Space.parse(source.task.space)
    parts = (source.dataset.train, source.dataset.test, source.prediction)
    every = [recording for part in parts for recording in part]
    predictions = predict(model, every, hold=source.dataset.hold, solver=solver)
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.array([squared_error(model, space, *pair) for pair in zip(every, predictions, strict=True)])
        each = np.split(errors, np.cumsum([len(part) for part in parts])[:-1])
        train, test, prediction = (MeanStd(float(part.mean()), float(part.std())) for part in each)
    lost = [int(np.sum(~np.isfinite(part))) for part in each]
    diverged: dict[str, int] = dict(zip(("train", "test", "prediction"), lost, strict=True))
    return TaskScore(train=train, test=test, prediction=prediction, diverged=diverged)


def squared_error(model: AbstractDynamics, space: Space, measured: Trajectory, predicted: Prediction) -> float:
    """Sum of squared errors over samples and the observation channels of a space.

    Args:
        model: What predicted.
        space: Space of the channels.
        measured: The truth.
        predicted: The rollout.

    Returns:
        The sum; not finite if the rollout diverged.
    """
    seen = (
        predicted.observations
        if model.space.is_angle == space.is_angle
        else _observed(space, predicted.q, predicted.rates)
    )
    return float(np.sum((seen - _observed(space, measured.q, measured.rates)) ** 2))


def _observed(space: Space, q: Float[np.ndarray, "T n"], rates: Float[np.ndarray, "T n"]) -> Float[np.ndarray, "T o"]:
    """Embedded coordinates, then the rates."""
    angles = q[:, space.angles]
    return np.concatenate([q[:, space.lengths], np.cos(angles), np.sin(angles), rates], axis=1)
