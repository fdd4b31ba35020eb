"""The Gauss-Newton matrix JᵀJ of the residuals, gathered window by window."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Inputs, Scalar, State

from ._problem import Batch, Objective

Parameters = Float[Array, " P"]
Sensitivity = Float[Array, "s P"]


_LARGEST_JACOBIAN = 2**23  # Entries held at once.


class NormalEquations(NamedTuple):
    """Second-order model of the loss at one point: loss + 2 gradientᵀ δ + δᵀ matrix δ.

    Attributes:
        matrix: Mean of JᵀJ over the residuals.
        gradient: Mean of Jᵀr.
        loss: Mean of r².
        residuals: Number of residuals.
    """

    matrix: np.ndarray
    gradient: np.ndarray
    loss: float
    residuals: int


def linearize(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, objective: Objective, window: Batch
) -> tuple[Float[Array, " r"], Float[Array, "r P"]]:
    """Residuals of one window and their Jacobian, by integrating the sensitivity S = ∂x/∂θ beside the state.

    Ṡ = (∂f/∂x) S + ∂f/∂θ is integrated by the solver of the state, which gives the exact derivative of a Runge-Kutta
    rollout. Its cost grows linearly with the horizon, where one reverse pass per residual grows quadratically.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        window: One window.

    Returns:
        Residuals, sample by sample, and their derivatives by the parameters.
    """

    def field(t: Scalar, pair: tuple[State, Sensitivity], u: Inputs) -> tuple[State, Sensitivity]:
        state, sensitivity = pair

        def derivative(state: State, theta: Parameters) -> State:
            return restore(theta).derivative(t, state, u)

        rate, pullback = jax.vjp(derivative, state, theta)
        by_state, by_theta = jax.vmap(pullback)(jnp.eye(state.shape[0], dtype=state.dtype))
        return rate, by_state @ sensitivity + by_theta

    def step(pair: tuple[State, Sensitivity], sample: tuple) -> tuple:
        after = objective.solver.step(field, pair, *sample)
        return after, after

    def observe(state: State, theta: Parameters) -> Array:
        return restore(theta).observe(state)

    def encode(theta: Parameters) -> State:
        return restore(theta).encode(window.q[0], window.rates[0])

    start = (encode(theta), jax.jacrev(encode)(theta))
    _, (states, sensitivities) = jax.lax.scan(step, start, (window.ts[:-1], window.ts[1:], *objective.hold(window.us)))
    by_state, by_theta = jax.vmap(jax.jacrev(observe, argnums=(0, 1)), in_axes=(0, None))(states, theta)
    weights = objective.weights.astype(theta.dtype)[None]
    jacobian = weights[:, :, None] * (by_state @ sensitivities + by_theta)
    dynamics = restore(theta)
    measured = jnp.concatenate([jax.vmap(dynamics.space.embed)(window.q), window.rates], axis=1)[1:]
    residuals = weights * (jax.vmap(dynamics.observe)(states) - measured)
    return residuals.ravel(), jacobian.reshape(residuals.size, theta.size)


@eqx.filter_jit
def _linearize_chunk(
    restore: Callable, theta: Parameters, objective: Objective, batch: Batch
) -> tuple[Float[Array, " R"], Float[Array, "R P"]]:
    """Stacked residuals and Jacobians of some windows, a few at a time so that they stay in the processor's cache."""
    residuals, jacobian = jax.lax.map(
        lambda window: linearize(restore, theta, objective, window), batch, batch_size=min(32, batch.ts.shape[0])
    )
    return residuals.ravel(), jacobian.reshape(-1, theta.size)


def normal_equations(
    restore: Callable[[Parameters], AbstractDynamics],
    theta: Parameters,
    objective: Objective,
    batch: Batch,
    *,
    chunk: int | None = None,
) -> NormalEquations:
    """Gather JᵀJ and Jᵀr over all windows in bounded memory.

    The products run in NumPy's BLAS: on a CPU it is three times as fast as XLA's (`benchmarks/`), and it sees that
    JᵀJ is symmetric.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows linearised at once; as many as keep their Jacobian below 64 MB if None.

    Returns:
        The normal equations, in double precision.
    """
    matrix = np.zeros((theta.size, theta.size))
    gradient = np.zeros(theta.size)
    loss, count = 0.0, 0
    total = batch.ts.shape[0]
    rows = (batch.ts.shape[1] - 1) * objective.weights.size
    chunk = min(chunk or max(1, _LARGEST_JACOBIAN // (rows * theta.size)), total)
    for start in range(0, total, chunk):
        # The last chunk is filled up with windows whose rows are dropped, so that one compiled function serves all.
        index = np.minimum(np.arange(start, start + chunk), total - 1)
        r, J = (np.asarray(x) for x in _linearize_chunk(restore, theta, objective, batch.take(index)))
        kept = rows * min(chunk, total - start)
        r, J = r[:kept], J[:kept]
        matrix += J.T @ J
        gradient += J.T @ r
        loss += float(r.astype(np.float64) @ r)
        count += r.size
    return NormalEquations(matrix / count, gradient / count, loss / count, count)
