"""Second-order training: Levenberg-Marquardt on the residuals of all windows."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Scalar

from ._gauss_newton import NormalEquations, Parameters, normal_equations
from ._problem import Batch, Objective, evaluate_loss

_SMALLEST_DAMPING = 1e-14
_LARGEST_DAMPING = 1e8
_TRIALS = 6


class LevenbergState(NamedTuple):
    """Everything that the next step needs.

    Attributes:
        theta: Flat parameters.
        damping: Factor λ of the damping term, relative to the diagonal of JᵀJ.
    """

    theta: Parameters
    damping: float


class LevenbergStep(NamedTuple):
    """What one step did.

    Attributes:
        before: Loss before the step.
        after: Loss after it; equal to `before` where every trial was rejected.
        accepted: Whether the parameters moved.
    """

    before: float
    after: float
    accepted: bool


def levenberg_marquardt_step(
    state: LevenbergState,
    restore: Callable[[Parameters], AbstractDynamics],
    objective: Objective,
    batch: Batch,
    *,
    prior: float = 0.0,
) -> tuple[LevenbergState, LevenbergStep]:
    """Solve (JᵀJ + λ diag) δ = −Jᵀr, with λ raised until the loss falls, and lowered fivefold once it has.

    The loss is the negative logarithm of the posterior under Gaussian errors, whose variance σ² is what the residuals
    have before the step, and a Gaussian prior: mean r² + σ² `prior` ‖θ‖² / (number of residuals). Where the data are
    exact the prior fades as the errors do.

    Args:
        state: Where to start.
        restore: Makes the dynamics from flat parameters.
        objective: How rollouts are compared with windows.
        batch: Windows.
        prior: Precision of the prior on every parameter.

    Returns:
        The state after the step, and what the step did to the mean squared residual.

    References:
        Marquardt (1963), *An algorithm for least-squares estimation of nonlinear parameters*; Transtrum & Sethna
        (2012), *Improvements to the Levenberg-Marquardt algorithm*: lowering λ faster than raising it.
    """
    equations = normal_equations(restore, state.theta, objective, batch)
    ridge = prior * equations.loss / equations.residuals
    theta = np.asarray(state.theta, float)
    before = equations.loss + ridge * float(theta @ theta)
    damping, growth = state.damping, 2.0
    for _ in range(_TRIALS):
        trial = theta + _solve(equations, theta, damping=damping, ridge=ridge)
        moved = jnp.asarray(trial, state.theta.dtype)
        after = float(_loss(restore, moved, objective, batch))
        if after + ridge * float(trial @ trial) < before:
            done = LevenbergState(moved, max(damping / 5, _SMALLEST_DAMPING))
            return done, LevenbergStep(equations.loss, after, accepted=True)
        damping, growth = min(damping * growth, _LARGEST_DAMPING), 2 * growth
    rejected = LevenbergStep(equations.loss, equations.loss, accepted=False)
    return LevenbergState(state.theta, damping), rejected


def _solve(equations: NormalEquations, theta: np.ndarray, *, damping: float, ridge: float) -> np.ndarray:
    """Damped Gauss-Newton step."""
    diagonal = np.diag(equations.matrix) + ridge
    # A direction that the data do not determine has no scale of its own; the floor gives it one.
    scale = diagonal + 1e-8 * max(float(diagonal.mean()), 1e-300)
    matrix = equations.matrix + np.diag(ridge + damping * scale)
    factor = scipy.linalg.cho_factor(matrix, check_finite=False)
    return -scipy.linalg.cho_solve(factor, equations.gradient + ridge * theta, check_finite=False)


@eqx.filter_jit
def _loss(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, objective: Objective, batch: Batch
) -> Scalar:
    """Loss at some parameters; NaN, which compares as no gain, where a rollout diverges."""
    return evaluate_loss(restore(theta), objective, batch)
