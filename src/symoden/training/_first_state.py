"""The first state of a recording, found with a model from several of its samples."""

from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from symoden.data import (
    SensorNoise,
    Trajectory,
    first_samples,
    least_lively,
    measure_noise,
    rate_errors_at_ends,
    windows,
)
from symoden.integrate import AbstractSolver, Hold
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Scalar
from symoden.spaces import Space

from ._objective import Batch, Objective, channel_order
from ._starts import find_start

_ROUNDS: Final = 4  # A free start hides the model's error from the first.
_ITERATIONS: Final = 5
_FINEST: Final = 1e-3  # Of a channel's spread: no model is as good as better sensors are.


def find_first_state(
    dynamics: AbstractDynamics, recording: Trajectory, *, hold: Hold, solver: AbstractSolver
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Find the state from which the rollout over a recording's `first_samples` fits them best.

    Least squares, every channel in units of its sensor's noise, by Gauss-Newton from the measured state. Beside a model
    that leaves open more than the noise, the first measurement counts for more than the others. Of rates that were
    estimated from positions each counts for as much as an estimate at an end is worth, beside the positions themselves.

    Args:
        dynamics: Model.
        recording: A recording; its noise is measured along all of it, its first state found from the `first_samples`.
        hold: How inputs act between samples.
        solver: Advances the state between samples.

    Returns:
        Coordinates and rates; as measured where there is one such sample, no noise is seen in measured rates, or the
        rollout diverges.
    """
    samples, is_estimated = first_samples(recording), recording.noise_gain is not None
    if samples == 1 or not ((noise := measure_noise([recording])).is_seen or is_estimated):
        return recording.q[0], recording.rates[0]
    weights, sensors = _channels(recording, noise, dynamics.space)
    objective = Objective(jnp.asarray(weights), solver, hold, noise=jnp.asarray(sensors), level=jnp.asarray(1.0))
    batch = Batch.of(windows([recording], samples - 1, stride=len(recording)))
    window = jax.tree.map(lambda x: x[0], batch)
    q, rates = np.split(np.asarray(_found(dynamics, objective, window), float), 2)
    return q, rates


def _channels(
    recording: Trajectory, noise: SensorNoise, space: Space
) -> tuple[Float[np.ndarray, " o"], Float[np.ndarray, " o"]]:
    """Weight of every observed channel, and the noise of its sensor."""
    rates = noise.rates if recording.noise_gain is None else rate_errors_at_ends(recording)
    sensors = np.concatenate([noise.q, rates])
    spreads = [np.std(signals, axis=0) for signals in (recording.q, recording.rates)]
    finest = _FINEST * np.concatenate([np.maximum(each, least_lively(each, space.is_angle)) for each in spreads])
    finest[space.angles] = np.minimum(finest[space.angles], _FINEST)  # They are seen on the unit circle.
    order = channel_order(space)
    return 1 / np.maximum(sensors, finest)[order], sensors[order]


@eqx.filter_jit
def _found(dynamics: AbstractDynamics, objective: Objective, window: Batch) -> Float[Array, " s"]:
    """The start of a window, first as if noise alone made the residuals, then with the level that these have."""

    def closer(_: Int[Array, ""], pair: tuple[Float[Array, " s"], Scalar]) -> tuple[Float[Array, " s"], Scalar]:
        start, level = pair
        held = eqx.tree_at(lambda o: o.level, objective, level)
        found = find_start(dynamics, held, window._replace(start=start), iterations=_ITERATIONS)
        r = found.residuals[1:]  # The start's own is weighted by the level.
        # What noise does not explain is the model's error, which is alike in all samples: their mean has as much of it.
        excess = jnp.maximum(jnp.sum(r**2) / (len(r) * len(start)) - 1, 0)
        return found.windows.start, jnp.sqrt(1 + (len(r) + 1) * excess)

    return jax.lax.fori_loop(0, _ROUNDS, closer, (window.start, jnp.ones(())))[0]
