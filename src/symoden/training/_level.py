"""What one independent residual would vary by: noise, and what a model leaves open."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics

from ._gauss_newton import NormalEquations, Parameters, normal_equations
from ._objective import Batch, Objective
from ._residuals import find_starts

_LEAST_WINDOWS: Final = 5  # Fewer do not tell how much they vary.
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
    fitted = float(np.trace(inverse @ equations.matrix))
    # At the optimum the scores sum to zero, which takes one window's worth from their variance.
    scores = float(np.trace(inverse @ equations.spread)) * windows / (windows - 1)
    effect = max(1.0, scores / (size * fitted * loss))
    return effect * loss / max(_LEAST_FREEDOM, 1 - fitted * effect / size)


def expected_level(
    restore: Callable[[Parameters], AbstractDynamics],
    theta: Parameters,
    objective: Objective,
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
    if objective.noise is None or batch.ts.shape[0] < _LEAST_WINDOWS:
        return math.inf
    free = objective.refined(solver, 0.0)
    equations = normal_equations(restore, theta, free, find_starts(restore(theta), free, batch))
    if not np.isfinite(equations.matrix).all():
        return math.inf
    level = math.sqrt(independent_variance(equations))
    sensors = float(np.max(objective.weights * objective.noise))
    return level if level < math.sqrt(batch.ts.shape[1] - 1) * sensors else math.inf
