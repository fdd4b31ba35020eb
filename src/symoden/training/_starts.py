"""Where the rollout of a window starts: noise in its first sample must not bias the model."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from symoden.mechanics import AbstractDynamics

from ._objective import AbstractObjective, Batch, channel_order

_RIDGE = 1e-12


class Found(NamedTuple):
    """Where rollouts start best; the first axis counts windows, and is absent in functions of one window.

    Attributes:
        windows: With those starts; as they are where starts are not free, or no step is a gain.
        residuals: From these starts.
        inverse: Pseudoinverse of the residuals' Jacobian by the start; None where starts are not free.
    """

    windows: Batch
    residuals: Float[Array, "*B k o"]
    inverse: Float[Array, "*B s r"] | None


def find_start(
    dynamics: AbstractDynamics, objective: AbstractObjective, window: Batch, *, iterations: int | Int[Array, ""] = 1
) -> Found:
    """Find the start from which the rollout of one window fits best, by Gauss-Newton from the start at hand.

    Starts are off by the sensors' noise only, over which a rollout is nearly linear: few iterations do, and one
    Jacobian serves them all.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        window: One window.
        iterations: Number of Gauss-Newton's steps; an array needs no new compilation when it changes.

    Returns:
        The start, the residuals from it, and what it takes to follow it when the model changes.
    """
    if not objective.frees_starts:
        return Found(window, objective.residuals(dynamics, window), None)
    J = by_start(dynamics, objective, window)
    # In units in which all change alike: of micrometres beside radians one ridge would hold the one and not the other.
    unit = 1 / jnp.zeros(J.shape[1], J.dtype).at[channel_order(dynamics.space)].max(objective.weights)
    even = J * unit[None]
    squares = even.T @ even
    ridge = _RIDGE * jnp.trace(squares) * jnp.eye(len(squares), dtype=squares.dtype)
    inverse = unit[:, None] * jnp.linalg.solve(squares + ridge, even.T)
    return follow_start(dynamics, objective, window, inverse, iterations=iterations)


def follow_start(
    dynamics: AbstractDynamics,
    objective: AbstractObjective,
    window: Batch,
    inverse: Float[Array, "s r"] | None,
    *,
    iterations: int | Int[Array, ""] = 1,
) -> Found:
    """Find the best start of one window from the one at hand with a pseudoinverse at hand.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        window: One window.
        inverse: As `find_start` has it, for this model or one that differs little; None leaves the start as it is.
        iterations: Number of steps.

    Returns:
        As of `find_start`.
    """
    first = objective.residuals(dynamics, window)
    if inverse is None:
        return Found(window, first, None)

    def closer(
        _: Int[Array, ""], at: tuple[Float[Array, " s"], Float[Array, "k o"]]
    ) -> tuple[Float[Array, " s"], Float[Array, "k o"]]:
        start, r = at
        trial = start - inverse @ r.ravel()
        after = objective.residuals(dynamics, window._replace(start=trial))
        # Not so where a rollout diverges: NaN compares as no gain.
        gains = jnp.sum(after**2) < jnp.sum(r**2)
        return jnp.where(gains, trial, start), jnp.where(gains, after, r)

    start, residuals = jax.lax.fori_loop(0, iterations, closer, (window.start, first))
    return Found(window._replace(start=start), residuals, inverse)


def project_out(by_start: Float[Array, "r s"], columns: Float[Array, "r c"]) -> Float[Array, "r c"]:
    """Project onto the orthogonal complement of some columns.

    The variable projection of separable least squares: a step in the parameters alone, the starts being the best ones
    before it and after it.

    Args:
        by_start: What to project out: the residuals' Jacobian by the start.
        columns: What is projected.

    Returns:
        The projections.

    References:
        Golub & Pereyra (1973), *The differentiation of pseudo-inverses and nonlinear least squares problems whose
        variables separate*; Kaufman (1975), *A variable projection method for solving separable nonlinear least squares
        problems*: the approximation in use here.
    """
    Q = jnp.linalg.qr(by_start)[0]
    return columns - Q @ (Q.T @ columns)


def by_start(dynamics: AbstractDynamics, objective: AbstractObjective, window: Batch) -> Float[Array, "r s"]:
    """Jacobian of one window's residuals by its start.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        window: One window.

    Returns:
        The Jacobian.
    """

    def residuals(start: Float[Array, " s"]) -> Float[Array, " r"]:
        return objective.residuals(dynamics, window._replace(start=start)).ravel()

    return jax.jacfwd(residuals)(window.start)
