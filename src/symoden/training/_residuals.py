"""Residuals of any number of windows, some at a time."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from symoden.mechanics import AbstractDynamics

from ._objective import Batch, Objective
from ._starts import find_start

_ITERATIONS = 3  # From the measured starts; after a small change of the model one does.


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


def map_windows(function: Callable[[Batch], PyTree], batch: Batch, *, chunk: int) -> PyTree:
    """Apply a function of one window to any number of them, some at a time.

    Args:
        function: What to apply.
        batch: Windows.
        chunk: Number of windows at once.

    Returns:
        The results, stacked.
    """
    total = batch.ts.shape[0]
    results = jax.lax.map(lambda some: jax.vmap(function)(batch.take(some)), chunks(total, chunk))
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:total], results)


def evaluate_residuals(
    dynamics: AbstractDynamics, objective: Objective, batch: Batch, *, chunk: int = 512, iterations: int = _ITERATIONS
) -> Float[Array, "B k o"]:
    """Residuals of any number of windows in bounded memory.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows rolled out at once.
        iterations: Of the search for starts, where these are free; 0 to roll out from those at hand.

    Returns:
        The residuals of every window, from the starts that are found.
    """
    return _evaluate(dynamics, objective, batch, jnp.asarray(iterations), chunk=chunk)[0]


def evaluate_loss(
    dynamics: AbstractDynamics, objective: Objective, batch: Batch, *, chunk: int = 512, iterations: int = _ITERATIONS
) -> float:
    """Loss over any number of windows in bounded memory; the chunk's size changes it by rounding alone.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows rolled out at once.
        iterations: Of the search for starts, where these are free.

    Returns:
        Mean of the squared residuals; not finite where a rollout diverges.
    """
    residuals = np.asarray(evaluate_residuals(dynamics, objective, batch, chunk=chunk, iterations=iterations), float)
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.mean(residuals**2))


def integration_error(dynamics: AbstractDynamics, coarse: Objective, fine: Objective, batch: Batch) -> float:
    """Mean squared difference of the residuals under two solvers: what the coarse one adds to the loss.

    Args:
        dynamics: Model.
        coarse: The objective in use.
        fine: The same with a more accurate solver.
        batch: Windows.

    Returns:
        Mean of the squared differences.
    """
    one, other = (np.asarray(evaluate_residuals(dynamics, each, batch), float) for each in (coarse, fine))
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.mean((one - other) ** 2))


def find_starts(dynamics: AbstractDynamics, objective: Objective, batch: Batch, *, chunk: int = 512) -> Batch:
    """Find where rollouts start best, for any number of windows.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows at once.

    Returns:
        The windows with those starts; as they are where starts are not free.
    """
    if not objective.frees_starts:
        return batch
    return batch._replace(start=_evaluate(dynamics, objective, batch, jnp.asarray(_ITERATIONS), chunk=chunk)[1])


@eqx.filter_jit
def _evaluate(
    dynamics: AbstractDynamics, objective: Objective, batch: Batch, iterations: Int[Array, ""], *, chunk: int
) -> tuple[Float[Array, "B k o"], Float[Array, "B s"]]:
    """Residuals of all windows and the starts that they are from: one compilation for all that asks for either."""

    def one(window: Batch) -> tuple[Float[Array, "k o"], Float[Array, " s"]]:
        found = find_start(dynamics, objective, window, iterations=iterations)
        return objective.residuals(dynamics, found), found.start

    return map_windows(one, batch, chunk=chunk)
