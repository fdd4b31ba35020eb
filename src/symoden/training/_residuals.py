"""Residuals of any number of windows, some at a time."""

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from symoden.blocks import without_silent
from symoden.mechanics import AbstractDynamics

from ._objective import AbstractObjective, Batch
from ._starts import Found, find_start, follow_start

_ITERATIONS = 3


def chunks(total: int, size: int) -> Int[Array, "k c"]:
    """Indices of windows in chunks of one size, so that one compiled body serves all.

    Args:
        total: Number of windows.
        size: Largest number in a chunk.

    Returns:
        The indices; after the last window it is repeated to fill the last chunk.
    """
    size = min(size, total)
    return jnp.minimum(jnp.arange(-(-total // size) * size), total - 1).reshape(-1, size)


def map_windows(function: Callable[[PyTree], PyTree], batch: PyTree, *, chunk: int) -> PyTree:
    """Apply a function of one window to any number of them, some at a time.

    Args:
        function: What to apply.
        batch: Windows, and what belongs to each.
        chunk: Number of windows at once.

    Returns:
        The results, stacked.
    """
    total = jax.tree.leaves(batch)[0].shape[0]

    def some(index: Int[Array, " c"]) -> PyTree:
        return jax.vmap(function)(jax.tree.map(lambda x: x[index], batch))

    results = jax.lax.map(some, chunks(total, chunk))
    return jax.tree.map(lambda x: x.reshape(x.shape[0] * x.shape[1], *x.shape[2:])[:total], results)


def find_starts(dynamics: AbstractDynamics, objective: AbstractObjective, batch: Batch, *, chunk: int = 512) -> Found:
    """Find where rollouts start best, for any number of windows, in bounded memory.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows rolled out at once; it changes the residuals by rounding alone.

    Returns:
        The windows with those starts, and their residuals.
    """
    return _find(without_silent(dynamics), objective, batch, chunk=chunk)


def follow_starts(
    dynamics: AbstractDynamics,
    objective: AbstractObjective,
    batch: Batch,
    inverse: Float[Array, "B s r"] | None = None,
    *,
    chunk: int = 512,
) -> Float[Array, "B k o"]:
    """Residuals of a model that differs little from the one that starts were found with, from its own best starts.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows with the starts that were found.
        inverse: As it was found with them; None leaves starts where they are.
        chunk: Number of windows rolled out at once.

    Returns:
        The residuals of every window.
    """
    return _follow(without_silent(dynamics), objective, batch, inverse, chunk=chunk)


def evaluate_residuals(dynamics: AbstractDynamics, objective: AbstractObjective, batch: Batch) -> Float[Array, "B k o"]:
    """Residuals of any number of windows in bounded memory, from the starts that are found.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.

    Returns:
        The residuals of every window.
    """
    return find_starts(dynamics, objective, batch).residuals


def evaluate_loss(dynamics: AbstractDynamics, objective: AbstractObjective, batch: Batch) -> float:
    """Loss over any number of windows in bounded memory.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.

    Returns:
        Mean of the squared residuals; infinite where a rollout diverges.
    """
    return mean_square(np.asarray(evaluate_residuals(dynamics, objective, batch), float))


def mean_square(residuals: Float[np.ndarray, "..."]) -> float:
    """Mean of r²; infinite where a rollout diverges, for no comparison with what is no number is true."""
    with np.errstate(over="ignore", invalid="ignore"):
        mean = float(np.mean(residuals**2))
    return math.inf if math.isnan(mean) else mean


def integration_error(
    dynamics: AbstractDynamics, coarse: AbstractObjective, fine: AbstractObjective, batch: Batch
) -> float:
    """Mean squared difference of the residuals under two solvers: what the coarse one adds to the loss.

    Args:
        dynamics: Model.
        coarse: The objective in use.
        fine: The same with a more accurate solver.
        batch: Windows; their starts stay where they are.

    Returns:
        Mean of the squared differences.
    """
    one, other = (np.asarray(follow_starts(dynamics, each, batch), float) for each in (coarse, fine))
    with np.errstate(over="ignore", invalid="ignore"):
        return mean_square(one - other)


@eqx.filter_jit
def _find(dynamics: AbstractDynamics, objective: AbstractObjective, batch: Batch, *, chunk: int) -> Found:
    """`find_starts`, compiled."""

    def one(window: Batch) -> Found:
        return find_start(dynamics, objective, window, iterations=_ITERATIONS)

    return map_windows(one, batch, chunk=chunk)


@eqx.filter_jit
def _follow(
    dynamics: AbstractDynamics,
    objective: AbstractObjective,
    batch: Batch,
    inverse: Float[Array, "B s r"] | None,
    *,
    chunk: int,
) -> Float[Array, "B k o"]:
    """`follow_starts`, compiled."""

    def one(pair: tuple[Batch, Float[Array, "s r"] | None]) -> Float[Array, "k o"]:
        return follow_start(dynamics, objective, *pair).residuals

    return map_windows(one, (batch, inverse), chunk=chunk)
