"""Residuals of any number of windows, some at a time."""

import math
from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from symoden.blocks import without_silent
from symoden.mechanics import AbstractDynamics
from symoden.models import lagrangian

from ._objective import AbstractObjective, Batch, Objective
from ._starts import Found, find_start, follow_start

_ITERATIONS = 3
# Windows. A program compiles for seconds: of one size, it serves training and validation windows alike; what fills the
# last block is computed in vain, and of a handful of long windows more would be that than not.
_BLOCK = 16
_UNSTABLE = 10.0
_LOST = 1e20  # No digits are left to others; far beyond stability a finer solver may grow faster still.


def find_starts(dynamics: AbstractDynamics, objective: AbstractObjective, batch: Batch) -> Found:
    """Find where rollouts start best, for any number of windows, in bounded memory.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.

    Returns:
        The windows with those starts, and their residuals.
    """
    lean = _lean(dynamics, objective)
    return _block_by_block(lambda some: _find(lean, objective, some), batch)


def follow_starts(
    dynamics: AbstractDynamics,
    objective: AbstractObjective,
    batch: Batch,
    inverse: Float[Array, "B s r"] | None = None,
) -> Float[Array, "B k o"]:
    """Residuals of a model that differs little from the one that starts were found with, from its own best starts.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows with the starts that were found.
        inverse: As it was found with them; None leaves starts where they are.

    Returns:
        The residuals of every window.
    """
    lean = _lean(dynamics, objective)
    return _block_by_block(lambda some: _follow(lean, objective, *some), (batch, inverse))


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

    Where friction is stiff and a joint at rest, steps beyond the solver's stability chatter: rollouts stay where they
    should, since dry friction is bounded, but their derivatives grow with every step, up to 10¹¹ in a second. One such
    window rules the normal equations and leaves no digits to the others.

    Args:
        dynamics: Model.
        coarse: The objective in use.
        fine: The same with a more accurate solver.
        batch: Windows; their starts stay where they are.

    Returns:
        Mean of the squared differences; infinite where the coarse solver lets an error of a start grow `_UNSTABLE`
        times as much as the fine one does, or beyond `_LOST`.
    """
    lean = _lean(dynamics, coarse)
    spreads = [_block_by_block(partial(_spread, lean, each), batch) for each in (coarse, fine)]
    (one, grown), (other, expected) = jax.tree.map(lambda x: np.asarray(x, float), spreads)
    with np.errstate(over="ignore", invalid="ignore"):
        stable = np.all(grown <= np.minimum(_UNSTABLE * expected, _LOST))
        return mean_square(one - other) if stable else math.inf


def _lean(dynamics: AbstractDynamics, objective: AbstractObjective) -> AbstractDynamics:
    """The same dynamics, of which no more is computed than the objective needs."""
    lean = without_silent(dynamics)
    return lagrangian(lean) if isinstance(objective, Objective) else lean  # What rolls nothing out asks for H.


def filled(start: int, size: int, total: int) -> Int[np.ndarray, " s"]:
    """Indices of a block of windows; the last one is repeated to fill the last block, so that one program serves all.

    Args:
        start: The first.
        size: Number of windows in a block.
        total: Number of windows.

    Returns:
        The indices.
    """
    return np.minimum(np.arange(start, start + size), total - 1)


def _block_by_block(function: Callable[[PyTree], PyTree], batch: PyTree) -> PyTree:
    """Apply a function of a block of windows to any number of them."""
    batch = jax.tree.map(np.asarray, batch)
    total = len(jax.tree.leaves(batch)[0])
    blocks = (filled(start, _BLOCK, total) for start in range(0, total, _BLOCK))
    results = [function(jax.tree.map(lambda x: x[block], batch)) for block in blocks]  # noqa: B023 - called at once
    return jax.device_put(jax.tree.map(lambda *parts: np.concatenate(parts)[:total], *results))


@eqx.filter_jit
def _find(dynamics: AbstractDynamics, objective: AbstractObjective, block: Batch) -> Found:
    """`find_starts`, compiled."""
    return jax.vmap(lambda window: find_start(dynamics, objective, window, iterations=_ITERATIONS))(block)


@eqx.filter_jit
def _follow(
    dynamics: AbstractDynamics, objective: AbstractObjective, block: Batch, inverse: Float[Array, "B s r"] | None
) -> Float[Array, "B k o"]:
    """`follow_starts`, compiled."""
    return jax.vmap(lambda *pair: follow_start(dynamics, objective, *pair).residuals)(block, inverse)


@eqx.filter_jit
def _spread(
    dynamics: AbstractDynamics, objective: AbstractObjective, block: Batch
) -> tuple[Float[Array, "B k o"], Float[Array, " B"]]:
    """Residuals of windows, and how much an error of their starts grows."""

    def one(window: Batch) -> tuple[Float[Array, "k o"], Float[Array, ""]]:
        def residuals(start: Float[Array, " s"]) -> Float[Array, "k o"]:
            return objective.residuals(dynamics, window._replace(start=start))

        # In any direction: what explodes does so in nearly all of them, and to look at each takes as many rollouts.
        error = jnp.asarray(np.random.default_rng(0).normal(size=window.start.shape), window.start.dtype)
        found, grown = jax.jvp(residuals, (window.start,), (error,))
        predicted = grown[-(window.ts.shape[0] - 1) :]  # Before these stands the start's, where it is free.
        return found, jnp.linalg.norm(predicted)

    return jax.vmap(one)(block)
