"""The Gauss-Newton matrix JᵀJ of the residuals, gathered window by window."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Inputs, Scalar, State

from ._flatten import cast
from ._objective import Batch, Objective
from ._residuals import chunks, evaluate_residuals, map_windows
from ._starts import project_out, without_starts

Parameters = Float[Array, " P"]
Sensitivity = Float[Array, "s P"]


_LARGEST_JACOBIAN = 2**23  # Entries held at once.
_CACHED_WINDOWS = 32
_PINNED = 1e-5  # Relative standard deviation.


class NormalEquations(NamedTuple):
    """Second-order model of the loss at one point: loss + 2 gradientᵀ δ + δᵀ matrix δ.

    Attributes:
        matrix: Mean of JᵀJ over the residuals.
        gradient: Mean of Jᵀr.
        residuals: The residuals r of every window.
        spread: Sum over the windows of (Jᵀr)(Jᵀr)ᵀ, each window's own; how much they disagree about the parameters.
    """

    matrix: np.ndarray
    gradient: np.ndarray
    residuals: np.ndarray
    spread: np.ndarray

    @property
    def loss(self) -> float:
        """Mean of r²; not finite where a rollout diverges."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.mean(self.residuals**2))

    def pinned(self, direction: np.ndarray) -> "NormalEquations":
        """The same with what a relative change along a direction would be known to, as if it had been measured.

        Args:
            direction: Gradient of the logarithm of what stays as it is.

        Returns:
            The equations.
        """
        information = self.loss / (_PINNED**2 * self.residuals.size)
        return self._replace(matrix=self.matrix + information * np.outer(direction, direction))


def linearize(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, objective: Objective, window: Batch
) -> tuple[Float[Array, " r"], Float[Array, "r P"]]:
    """Residuals of one window and their Jacobian, by integrating the sensitivity S = ∂x/∂θ beside the state.

    Ṡ = (∂f/∂x) S + ∂f/∂θ is integrated by the solver of the state, which gives the exact derivative of a Runge-Kutta
    rollout. Its cost grows linearly with the horizon, where one reverse pass per residual grows quadratically.
    Where starts are free, they follow the parameters.

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
        return rate, by_state @ sensitivity + _padded(by_theta, sensitivity.shape[1] - by_theta.shape[1])

    def step(pair: tuple[State, Sensitivity], sample: tuple) -> tuple:
        after = objective.solver.step(field, pair, *sample)
        return after, after

    def observe(state: State, theta: Parameters) -> Array:
        return restore(theta).observe(state)

    def encode(theta: Parameters, start: Array) -> State:
        return restore(theta).encode(*jnp.split(start, 2))

    first = encode(theta, window.start)
    by_theta, by_start = jax.jacrev(encode, argnums=(0, 1))(theta, window.start)
    freed = by_start if objective.frees_starts else by_start[:, :0]  # More columns of the sensitivity.
    start = (first, jnp.concatenate([by_theta, freed], axis=1))
    _, after = jax.lax.scan(step, start, (window.ts[:-1], window.ts[1:], *objective.hold(window.us)))
    states, sensitivities = jax.tree.map(lambda x, rest: jnp.concatenate([x[None], rest]), start, after)
    by_state, by_theta = jax.vmap(jax.jacrev(observe, argnums=(0, 1)), in_axes=(0, None))(states, theta)
    dynamics = restore(theta)
    residuals = objective.compare(dynamics, jax.vmap(dynamics.observe)(states), window)
    rows = objective.row_weights(window.ts.shape[0]).astype(theta.dtype)
    jacobian = by_state @ sensitivities + _padded(by_theta, freed.shape[1])
    jacobian = (rows[:, :, None] * jacobian[-len(rows) :]).reshape(residuals.size, -1)
    if objective.frees_starts:
        jacobian = project_out(jacobian[:, theta.size :], jacobian[:, : theta.size])
    return residuals.ravel(), jacobian


def _padded(derivative: Float[Array, "... P"], columns: int) -> Float[Array, "... Q"]:
    """A derivative by the parameters as one by these and the start, on which it does not depend."""
    return jnp.pad(derivative, [(0, 0)] * (derivative.ndim - 1) + [(0, columns)])


@eqx.filter_jit
def _jacobian(restore: Callable, theta: Parameters, objective: Objective, batch: Batch) -> Float[Array, "R P"]:
    """Stacked Jacobians of some windows, a few at a time so that they stay in the processor's cache."""
    return map_windows(
        lambda window: linearize(restore, theta, objective, window)[1], batch, chunk=_CACHED_WINDOWS
    ).reshape(-1, theta.size)


def normal_equations(
    restore: Callable[[Parameters], AbstractDynamics],
    theta: Parameters,
    objective: Objective,
    batch: Batch,
    *,
    chunk: int | None = None,
    precision: DTypeLike = jnp.float32,
) -> NormalEquations:
    """Gather JᵀJ and Jᵀr over all windows in bounded memory.

    The residuals have the precision of `theta`. The Jacobian may have less: rounding its entries is a small error of
    the step, not of the loss, and takes a third of the time off. Its products run in double precision, which keeps
    JᵀJ positive semidefinite, and in NumPy's BLAS: on a CPU it is three times as fast as XLA's (`benchmarks/`), and it
    sees that JᵀJ is symmetric.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        batch: Windows, from the best starts where these are free.
        chunk: Number of windows linearised at once; as many as keep their Jacobian below 64 MB if None.
        precision: Of the Jacobian.

    Returns:
        The normal equations, in double precision.
    """
    residuals = np.asarray(evaluate_residuals(restore(theta), objective, batch, iterations=0), float)
    total, rows = len(residuals), residuals[0].size
    chunk = min(chunk or max(1, _LARGEST_JACOBIAN // (rows * theta.size)), total)
    rough_restore, rough_theta, rough_objective, rough_batch = (
        cast(part, precision) for part in (restore, theta, objective, batch)
    )
    matrix, spread = np.zeros((2, theta.size, theta.size))
    gradient = np.zeros(theta.size)
    for start in range(0, total, chunk):
        # The last chunk is filled up with windows whose rows are dropped, so that one compiled function serves all.
        index = np.minimum(np.arange(start, start + chunk), total - 1)
        r = residuals[start : start + chunk].ravel()
        J = np.asarray(_jacobian(rough_restore, rough_theta, rough_objective, rough_batch.take(index)))
        J = J[: len(r)].astype(float)
        with np.errstate(over="ignore", invalid="ignore"):  # Callers see that the sums are not finite.
            pulls = np.einsum("wrp,wr->wp", J.reshape(-1, rows, theta.size), r.reshape(-1, rows), optimize=True)
            matrix += J.T @ J
            spread += pulls.T @ pulls
            gradient += pulls.sum(axis=0)
    count = residuals.size
    return NormalEquations(matrix / count, gradient / count, residuals, spread)


@eqx.filter_jit
def pull_back(
    restore: Callable[[Parameters], AbstractDynamics],
    theta: Parameters,
    objective: Objective,
    batch: Batch,
    cotangents: Float[Array, "B k o"],
    *,
    chunk: int = 128,
) -> Parameters:
    """Jᵀ c without J, by reverse-mode differentiation of some windows at a time; starts stay where they are.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows; its solver must be one that reverse mode reaches through.
        batch: Windows.
        cotangents: One number c for each residual.
        chunk: Number of windows at once.

    Returns:
        The product.
    """
    index = chunks(batch.ts.shape[0], chunk)
    repeated = jnp.arange(index.size).reshape(index.shape) > index

    def add(total: Parameters, some: tuple[Int[Array, " c"], Bool[Array, " c"]]) -> tuple[Parameters, None]:
        which, dropped = some
        windows = batch.take(which)
        kept = jnp.where(dropped[:, None, None], 0, cotangents[which])
        kept = jax.vmap(lambda window, c: without_starts(restore(theta), objective, window, c))(windows, kept)

        def residuals(theta: Parameters) -> Float[Array, "c k o"]:
            return jax.vmap(lambda window: objective.residuals(restore(theta), window))(windows)

        _, pull = jax.vjp(residuals, theta)
        return total + pull(kept)[0], None

    return jax.lax.scan(add, jnp.zeros_like(theta), (index, repeated))[0]
