"""What errors count: how far residuals are independent, and of what noise or the model has made them."""

import math
from typing import Final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.integrate import AbstractSolver
from symoden.spaces import Space

from ._flatten import Flattening
from ._gauss_newton import Linearization, NormalEquations, Parameters
from ._objective import AbstractObjective, Batch, Objective, measured_channels
from ._residuals import evaluate_residuals
from ._weighing import LARGEST, Weighing

LEAST_WINDOWS: Final = 5  # Fewer do not tell how much they vary.
_LEAST_FREEDOM: Final = 0.5  # Share of the independent residuals that fitting may use up at most.


def independent_variance(equations: NormalEquations) -> float:
    """Variance of the residuals times their design effect, what fitting has used up allowed for.

    Args:
        equations: Gauss-Newton's equations.

    Returns:
        The variance that each of fewer, independent residuals would have.
    """
    size, loss, windows = equations.residuals.size, equations.loss, len(equations.residuals)
    inverse = np.linalg.inv(equations.matrix + np.eye(len(equations.matrix)) * loss / size)
    fitted = float(np.sum(inverse * equations.matrix))
    total = equations.gradient * size  # Of the scores; at the optimum they sum to zero.
    of_windows = float(np.sum((equations.scores @ inverse) * equations.scores))
    scores = (of_windows - float(total @ inverse @ total) / windows) * windows / (windows - 1)
    effect = max(1.0, scores / (size * fitted * loss))
    return effect * loss / max(_LEAST_FREEDOM, 1 - fitted * effect / size)


def weigh(
    restore: Flattening,
    theta: Parameters,
    objective: AbstractObjective,
    solver: AbstractSolver,
    batch: Batch,
    weighing: Weighing,
) -> Weighing:
    """Find what the errors of a model count that has nothing more to learn but priors.

    Where noise is what most of them are made of, starts are estimated and errors are independent. Else starts are as
    measured, and errors are what the model leaves open, which adds up along a rollout.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        solver: Advances the state between samples.
        batch: Windows.
        weighing: A plain one, with the level.

    Returns:
        The weighing.
    """
    if batch.ts.shape[0] < LEAST_WINDOWS:
        return weighing
    residuals = evaluate_residuals(restore(theta), objective.refined(solver, weighing), batch)
    weighing = weighing.whitened(np.asarray(residuals, float), measured_channels(objective))
    equations = Linearization.at(restore, theta, objective.refined(solver, weighing), batch).normal_equations()
    if not is_sound(equations):
        return weighing
    try:
        effect = independent_variance(equations) / equations.loss
    except np.linalg.LinAlgError:  # Rounding, where a model is nearly exact.
        return weighing
    # Those of a window count as one at least.
    return weighing._replace(effect=jnp.asarray(min(effect, equations.residuals[0].size), float))


def expected_level(
    restore: Flattening,
    theta: Parameters,
    objective: AbstractObjective,
    solver: AbstractSolver,
    batch: Batch,
) -> float:
    """Root of the variance that each of fewer, independent residuals would have, were starts quite free.

    What a model leaves open makes the residuals of a window alike. Each of them then counts for little beside a sensor
    that measured its start: else starts would follow the model's errors, and hide them.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        solver: Advances the state between samples.
        batch: Windows.

    Returns:
        The level; infinite where a window tells less of its start than the sensors do, or too few windows tell.
    """
    if not isinstance(objective, Objective) or objective.noise is None or batch.ts.shape[0] < LEAST_WINDOWS:
        return math.inf
    model, free = restore(theta), objective.refined(solver, Weighing.plain(objective.weights.size, 0.0))
    with np.errstate(over="ignore", invalid="ignore"):
        equations = Linearization.at(restore, theta, free, batch).normal_equations()
    if not is_sound(equations):
        return math.inf
    level = math.sqrt(independent_variance(equations))
    sensors = float(np.max(objective.weights * _seen(model.space, objective.noise, batch)))
    return level if level < math.sqrt(batch.ts.shape[1] - 1) * sensors else math.inf


def is_sound(equations: NormalEquations) -> bool:
    """Whether anything can be told from equations: not so where a rollout diverges, or nothing open changes anything.

    Args:
        equations: Gauss-Newton's equations.

    Returns:
        Whether all is finite, and neither residuals nor what changes them are all zero.
    """
    finite = np.isfinite(equations.matrix).all() and np.isfinite(equations.gradient).all()
    finite = finite and np.abs(equations.residuals).max() < LARGEST
    return bool(finite and equations.loss and np.trace(equations.matrix) > 0)


def _seen(space: Space, noise: Float[Array, " o"], batch: Batch) -> Float[np.ndarray, " o"]:
    """Noise of every channel at the windows' starts: a cosine sees none of a small angle's."""
    angles = np.asarray(batch.q)[:, 0, space.angles]
    slopes = [np.sqrt(np.mean(x**2, axis=0)) for x in (np.sin(angles), np.cos(angles))]
    lengths, rates = np.ones(len(space.lengths)), np.ones(space.size)
    return np.concatenate([lengths, *slopes, rates]) * np.asarray(noise)
