"""Second-order training: Levenberg-Marquardt on the residuals of all windows."""

import dataclasses
from typing import Final, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Float
from threadpoolctl import threadpool_limits

from ._flatten import Flattening
from ._gauss_newton import Linearization, NormalEquations, Parameters
from ._objective import AbstractObjective, Batch
from ._residuals import mean_square

CLOSED: Final = 1e20
"""Precision of what stays zero, whatever the data say."""

_SMALLEST_DAMPING = 1e-14
_LARGEST_DAMPING = 1e8
_TRIALS = 6
_NEARBY = 0.1  # Share of the step over which its bend is measured.
_LARGEST_BEND = 0.75  # Of a step that is accelerated, relative to its length.


class Prior(NamedTuple):
    """Gaussian prior of the parameters.

    Attributes:
        precision: λ of every parameter, or of each.
        mean: θ₀, likewise.
        variance: σ² of the residuals that it is weighed against; as it is before the step if None.
        effect: How many of them count as one, where σ² is not given.
    """

    precision: float | Float[np.ndarray, " P"] = 0.0
    mean: float | Float[np.ndarray, " P"] = 0.0
    variance: float | None = None
    effect: float = 1.0


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
        equations: Second-order model of the loss before the step.
    """

    before: float
    after: float
    accepted: bool
    equations: NormalEquations

    def falls_by(self, share: float) -> bool:
        """Whether the loss fell by more than a share of itself."""
        return self.accepted and self.after < (1 - share) * self.before


def levenberg_marquardt_step(
    state: LevenbergState,
    restore: Flattening,
    objective: AbstractObjective,
    batch: Batch,
    *,
    prior: Prior = Prior(),  # noqa: B008 - immutable
    pin: Float[np.ndarray, " P"] | None = None,
) -> tuple[LevenbergState, LevenbergStep]:
    """Solve (JᵀJ + λ diag) δ = −Jᵀr, with λ raised until the loss falls, and lowered fivefold once it has.

    The loss is the negative logarithm of the posterior under Gaussian errors of variance σ² and a Gaussian prior:
    mean r² + σ² Σ λ (θ − θ₀)² / (number of residuals). Where the data are exact the prior fades as the errors do.

    The way to the bottom leads along curved valleys, so a step follows the valley's bend: it is δ + a / 2 with
    (JᵀJ + λ diag) a = −Jᵀ ∂²r/∂δ², the acceleration of a geodesic on the surface of all predictions. It takes a third
    of the steps (`benchmarks/`).

    Args:
        state: Where to start.
        restore: Makes the dynamics from flat parameters.
        objective: How rollouts are compared with windows.
        batch: Windows.
        prior: λ, θ₀ and σ².
        pin: Direction along which the parameters stay where they are, if any.

    Returns:
        The state after the step, and what the step did to the mean squared residual.

    References:
        Marquardt (1963), *An algorithm for least-squares estimation of nonlinear parameters*; Transtrum & Sethna
        (2012), *Improvements to the Levenberg-Marquardt algorithm*: lowering λ faster than raising it, and geodesic
        acceleration.
    """
    about = Linearization.at(restore, state.theta, objective, batch)
    equations = about.normal_equations()
    if not np.isfinite(equations.matrix).all():  # Sensitivities can overflow in single precision.
        about = dataclasses.replace(about, precision=state.theta.dtype)
        equations = about.normal_equations()
    variance = prior.effect * equations.loss if prior.variance is None else prior.variance
    ridge = np.full(state.theta.size, prior.precision * variance)
    ridge /= equations.residuals.size
    # A direction that the data do not determine has no scale of its own; the floor gives it one. What is pinned along
    # one must not be held in all others that its parameters have a part in.
    diagonal = np.diag(equations.matrix) + ridge
    opened = diagonal[np.broadcast_to(prior.precision, diagonal.shape) < CLOSED]
    scale = diagonal + 1e-8 * max(float(opened.mean()), 1e-300)
    if pin is not None:
        equations = equations.pinned(pin, variance)
    theta = np.asarray(state.theta, float)
    middle = np.full_like(theta, prior.mean)
    before = equations.loss + float(ridge @ (theta - middle) ** 2)
    damping, growth = state.damping, 2.0
    for _ in range(_TRIALS):
        trial = theta + _step(equations, about, damping=damping * scale, ridge=ridge, pull=ridge * (theta - middle))
        after = mean_square(about.residuals(trial))
        if after + float(ridge @ (trial - middle) ** 2) < before:
            done = LevenbergState(jnp.asarray(trial, state.theta.dtype), max(damping / 5, _SMALLEST_DAMPING))
            return done, LevenbergStep(equations.loss, after, accepted=True, equations=equations)
        damping, growth = min(damping * growth, _LARGEST_DAMPING), 2 * growth
    rejected = LevenbergStep(equations.loss, equations.loss, accepted=False, equations=equations)
    return LevenbergState(state.theta, damping), rejected


def _step(
    equations: NormalEquations,
    about: Linearization,
    *,
    damping: np.ndarray,
    ridge: np.ndarray,
    pull: np.ndarray,
) -> np.ndarray:
    """Damped Gauss-Newton step and half its acceleration; NaN where the equations have no solution."""
    try:
        # One thread: more of them gain little on so small a matrix, and wait for each other on a busy machine.
        with threadpool_limits(1, user_api="blas"):
            factor = scipy.linalg.cho_factor(equations.matrix + np.diag(ridge + damping), check_finite=False)
    except np.linalg.LinAlgError:  # Rounding: more damping helps.
        return np.full_like(ridge, np.nan)
    step = -scipy.linalg.cho_solve(factor, equations.gradient + pull, check_finite=False)
    with np.errstate(over="ignore", invalid="ignore"):
        theta = np.asarray(about.theta, float)
        ahead, behind = (about.residuals(theta + sign * _NEARBY * step) for sign in (1, -1))
        bend = (ahead - 2 * equations.residuals + behind) / _NEARBY**2
    if not np.isfinite(bend).all():
        return step
    pulled = about.pull_back(bend) / bend.size
    half = -scipy.linalg.cho_solve(factor, pulled, check_finite=False) / 2
    # Where the bend is not small beside the step, the series is of no use.
    bent = float((half * damping) @ half) > (_LARGEST_BEND / 2) ** 2 * float((step * damping) @ step)
    return step if bent else step + half
