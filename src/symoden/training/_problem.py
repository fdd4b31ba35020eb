"""What training minimises: the squared error of short rollouts from measured states."""

from collections.abc import Callable
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from symoden.data import Windows
from symoden.integrate import AbstractSolver, Hold, rollout
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Scalar


class Batch(NamedTuple):
    """Windows as arrays on the device; the first axis counts windows, and is absent in functions of one window.

    Attributes:
        ts: Times since the start of the window [s].
        q: Measured coordinates.
        rates: Measured velocities or momenta.
        us: Inputs.
    """

    ts: Float[Array, "*B h+1"]
    q: Float[Array, "*B h+1 n"]
    rates: Float[Array, "*B h+1 n"]
    us: Float[Array, "*B h+1 m"]

    @classmethod
    def of(cls, windows: Windows, dtype: DTypeLike = float) -> "Batch":
        """Put windows on the device in the given precision."""
        return cls(*(jnp.asarray(x, dtype) for x in (windows.ts, windows.q, windows.rates, windows.us)))

    def take(self, index: Array | np.ndarray | slice) -> "Batch":
        """Choose windows."""
        return jax.tree.map(lambda x: x[index], self)


@final
class Objective(eqx.Module):
    """How a rollout is compared with a window.

    Attributes:
        weights: Factor on the error of every observed channel (embedded coordinates, then rates).
        solver: Advances the state between samples.
        hold: How inputs act between samples.
        unroll: Write the samples out instead of looping over them.
    """

    weights: Float[Array, " o"]
    solver: AbstractSolver
    hold: Hold = eqx.field(static=True)
    unroll: bool = eqx.field(static=True, default=False)

    def residuals(self, dynamics: AbstractDynamics, window: Batch) -> Float[Array, "h o"]:
        """Weighted errors of the predicted samples of one window; its first sample is where the rollout starts."""
        path = rollout(
            dynamics,
            window.q[0],
            window.rates[0],
            window.ts,
            window.us,
            solver=self.solver,
            hold=self.hold,
            unroll=self.unroll,
        )
        measured = jnp.concatenate([jax.vmap(dynamics.space.embed)(window.q), window.rates], axis=1)
        return self.weights.astype(measured.dtype)[None] * (path.observations - measured)[1:]

    def loss(self, dynamics: AbstractDynamics, batch: Batch) -> Scalar:
        """Mean of the squared residuals over a batch of windows."""
        return jnp.mean(jax.vmap(lambda window: self.residuals(dynamics, window))(batch) ** 2)


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


@eqx.filter_jit
def evaluate_residuals(
    dynamics: AbstractDynamics, objective: Objective, batch: Batch, *, chunk: int = 512
) -> Float[Array, "B h o"]:
    """Residuals of any number of windows in bounded memory.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows rolled out at once.

    Returns:
        The residuals of every window.
    """
    return map_windows(lambda window: objective.residuals(dynamics, window), batch, chunk=chunk)


def evaluate_loss(dynamics: AbstractDynamics, objective: Objective, batch: Batch, *, chunk: int = 512) -> float:
    """Loss over any number of windows in bounded memory; the chunk's size changes it by rounding alone.

    Args:
        dynamics: Model.
        objective: How rollouts are compared with windows.
        batch: Windows.
        chunk: Number of windows rolled out at once.

    Returns:
        Mean of the squared residuals; not finite where a rollout diverges.
    """
    residuals = np.asarray(evaluate_residuals(dynamics, objective, batch, chunk=chunk), float)
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


def channel_weights(batch: Batch, dynamics: AbstractDynamics) -> np.ndarray:
    """Inverse of the spread of what a rollout has to predict, the change of each channel over a window.

    Args:
        batch: Windows.
        dynamics: Model, for its space.

    Returns:
        Weight of every observed channel.
    """
    embedded = jax.vmap(jax.vmap(dynamics.space.embed))(batch.q)
    observed = np.asarray(jnp.concatenate([embedded, batch.rates], axis=-1))
    spread = np.sqrt(np.mean((observed[:, 1:] - observed[:, :1]) ** 2, axis=(0, 1)))
    return 1 / np.maximum(spread, 1e-6 * max(float(spread.max()), 1e-300))
