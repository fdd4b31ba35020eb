"""Where the rollout of a window starts: noise in its first sample must not bias the model."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from symoden.mechanics import AbstractDynamics

from ._objective import Batch, Objective

_RIDGE = 1e-12


def find_start(
    dynamics: AbstractDynamics, objective: Objective, window: Batch, *, iterations: int | Int[Array, ""] = 1
) -> Batch:
    """Find the start from which the rollout of one window fits best, by Gauss-Newton from the start at hand.

    Starts are off by the sensors' noise only, over which a rollout is nearly linear: few iterations do.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        window: One window.
        iterations: Number of Gauss-Newton's steps; an array needs no new compilation when it changes.

    Returns:
        The window with that start; as it is where starts are not free, or no step is a gain.
    """
    if not objective.frees_starts:
        return window

    def improved(_: Int[Array, ""], start: Float[Array, " s"]) -> Float[Array, " s"]:
        r, J = _linearize(dynamics, objective, window._replace(start=start))
        squares = J.T @ J
        ridge = _RIDGE * jnp.trace(squares) * jnp.eye(start.shape[0], dtype=start.dtype)
        trial = start - jnp.linalg.solve(squares + ridge, J.T @ r)
        after = objective.residuals(dynamics, window._replace(start=trial))
        # Not so where a rollout diverges: NaN compares as no gain.
        return jnp.where(jnp.sum(after**2) < jnp.sum(r**2), trial, start)

    return window._replace(start=jax.lax.fori_loop(0, iterations, improved, window.start))


def without_starts(
    dynamics: AbstractDynamics, objective: Objective, window: Batch, cotangent: Float[Array, "k o"]
) -> Float[Array, "k o"]:
    """The part of a change of the residuals that no change of the start makes up for.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        window: One window.
        cotangent: The change.

    Returns:
        Its projection; the change itself where starts are not free.
    """
    if not objective.frees_starts:
        return cotangent
    _, J = _linearize(dynamics, objective, window)
    return project_out(J, cotangent.reshape(-1, 1)).reshape(cotangent.shape)


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


def _linearize(
    dynamics: AbstractDynamics, objective: Objective, window: Batch
) -> tuple[Float[Array, " r"], Float[Array, "r s"]]:
    """Residuals and their Jacobian by the start."""

    def residuals(start: Float[Array, " s"]) -> Float[Array, " r"]:
        return objective.residuals(dynamics, window._replace(start=start)).ravel()

    def along(direction: Float[Array, " s"]) -> tuple[Float[Array, " r"], Float[Array, " r"]]:
        return jax.jvp(residuals, (window.start,), (direction,))

    return eqx.filter_vmap(along, out_axes=(None, 1))(jnp.eye(window.start.shape[0], dtype=window.start.dtype))
