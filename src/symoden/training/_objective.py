"""What training minimises: above all the squared error of short rollouts from measured or estimated states."""

import abc
import math
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int

from symoden.data import Windows, least_lively
from symoden.integrate import AbstractSolver, Hold, rollout
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Scalar
from symoden.spaces import Space

from ._flatten import cast
from ._weighing import Weighing, Whitening

_MOST_TRUST = 1e3  # In a sensor, against the residuals.


class Batch(NamedTuple):
    """Windows as arrays; the first axis counts windows, and is absent in functions of one window.

    Attributes:
        ts: Times since the start of the window [s].
        q: Measured coordinates.
        rates: Measured velocities or momenta.
        us: Inputs.
        start: Coordinates and rates that the rollout starts from: as measured, or as they are found.
        recording: Number of the recording that the window was cut out of; None where it is not known.
    """

    ts: Float[Array, "*B h+1"]
    q: Float[Array, "*B h+1 n"]
    rates: Float[Array, "*B h+1 n"]
    us: Float[Array, "*B h+1 m"]
    start: Float[Array, "*B 2*n"]
    recording: Int[Array, "*B"] | None = None

    @classmethod
    def of(cls, windows: Windows, dtype: DTypeLike = float) -> "Batch":
        """Windows in the given precision."""
        start = np.concatenate([windows.q[:, 0], windows.rates[:, 0]], axis=1)
        arrays = [windows.ts, windows.q, windows.rates, windows.us, start, windows.recording]
        return cast(cls(*jax.device_put(arrays)), dtype)

    def take(self, index: Array | np.ndarray | slice) -> "Batch":
        """Choose windows."""
        if any(isinstance(x, Tracer) for x in (index, *self)):
            return jax.tree.map(lambda x: x[index], self)
        # On the host: on a device every shape is a program, which takes 20 ms to compile.
        return jax.device_put(jax.tree.map(lambda x: np.asarray(x)[index], self))


class AbstractObjective(eqx.Module):
    """What second-order training minimises the squares of.

    Attributes:
        weights: Factor on the error of every channel.
    """

    weights: eqx.AbstractVar[Float[Array, " o"]]

    @abc.abstractmethod
    def refined(self, solver: AbstractSolver, weighing: Weighing) -> "AbstractObjective":
        """The same for second-order training.

        Args:
            solver: Advances the state between samples.
            weighing: What errors count, among each other and beside the sensors.

        Returns:
            The objective.
        """

    @property
    @abc.abstractmethod
    def frees_starts(self) -> bool:
        """Whether windows start from estimated states."""

    @abc.abstractmethod
    def residuals(self, dynamics: AbstractDynamics, window: Batch) -> Float[Array, "k o"]:
        """Weighted errors on one window.

        Args:
            dynamics: Model.
            window: One window.

        Returns:
            The residuals.
        """

    def loss(self, dynamics: AbstractDynamics, batch: Batch) -> Scalar:
        """Mean of the squared residuals over a batch of windows."""
        return jnp.mean(jax.vmap(lambda window: self.residuals(dynamics, window))(batch) ** 2)


@final
class Objective(AbstractObjective):
    """How a rollout is compared with a window.

    Attributes:
        weights: Factor on the error of every observed channel (embedded coordinates, then rates).
        solver: Advances the state between samples.
        hold: How inputs act between samples.
        unroll: Write the samples out instead of looping over them.
        noise: Standard deviation of every channel's sensor: windows then start from states that are estimated, so that
            noise in the first sample does not bias the model. None where they start from the measured ones.
        level: Root of the variance that an independent residual is expected to have, of noise and of what the model
            leaves open. A start may leave its measurement only as far as the sensor's noise explains.
        whitening: Takes from errors what those before them tell, where starts are not free; None leaves them as they
            are.
        measured: 1 for every channel, but 0 for rates that were estimated from positions; None where all were measured.
            Estimates are the positions once more, and smoothed, which biases what is learned: where starts are free, or
            errors are weighed by what they tell, they do not count.
    """

    weights: Float[Array, " o"]
    solver: AbstractSolver
    hold: Hold = eqx.field(static=True)
    unroll: bool = eqx.field(static=True, default=False)
    noise: Float[Array, " o"] | None = None
    level: Float[Array, ""] | None = None
    whitening: Whitening | None = None
    measured: Float[Array, " o"] | None = None

    def refined(self, solver: AbstractSolver, weighing: Weighing) -> "Objective":
        """The same for second-order training.

        Args:
            solver: Advances the state between samples.
            weighing: What errors count, among each other and beside the sensors.

        Returns:
            The objective.
        """
        if self.noise is None or math.isinf(weighing.level):
            return Objective(self.weights, solver, self.hold, whitening=weighing.whitening, measured=self.measured)
        free = {"noise": self.noise, "level": weighing.level, "measured": self.measured}
        return Objective(self.weights, solver, self.hold, **free)

    @property
    def frees_starts(self) -> bool:
        """Whether windows start from estimated states."""
        return self.noise is not None and self.level is not None

    def residuals(self, dynamics: AbstractDynamics, window: Batch) -> Float[Array, "k o"]:
        """Weighted errors of the rollout of one window from its start.

        Args:
            dynamics: Model.
            window: One window.

        Returns:
            Those of the h predicted samples; before them that of the start, where it is free.
        """
        q, rates = jnp.split(window.start, 2)
        path = rollout(dynamics, q, rates, window.ts, window.us, solver=self.solver, hold=self.hold, unroll=self.unroll)
        return self.compare(dynamics, path.observations, window)

    def compare(
        self, dynamics: AbstractDynamics, observations: Float[Array, "samples o"], window: Batch
    ) -> Float[Array, "k o"]:
        """Weighted errors of predicted observations, as `residuals` gives them.

        Args:
            dynamics: Model, for its space.
            observations: Of all samples, the start's being the first.
            window: One window.

        Returns:
            The residuals.
        """
        measured = jnp.concatenate([jax.vmap(dynamics.space.embed)(window.q), window.rates], axis=1)
        rows = self.row_weights(window.ts.shape[0]).astype(measured.dtype)
        return self.whitened(rows * (observations - measured)[-len(rows) :])

    def whitened(self, errors: Float[Array, "k o *P"]) -> Float[Array, "k o *P"]:
        """What counts of the weighted errors of one window, or of their derivatives.

        Args:
            errors: Sample by sample.

        Returns:
            As many.
        """
        return errors if self.whitening is None else self.whitening(errors)

    def row_weights(self, samples: int) -> Float[Array, "k o"]:
        """Factor on the error of every sample's channels.

        Args:
            samples: Number of samples of a window.

        Returns:
            The factors; the first row is the start's, where that is free.
        """
        size = samples - 1, self.weights.shape[0]
        if self.noise is None or self.level is None:
            return jnp.broadcast_to(self.weights, size)
        # The first sample counts as the others do, but more where the sensors are better than the model.
        sensors = self.weights * self.noise
        held = self.level >= _MOST_TRUST * sensors  # Also where there is no noise, nor a level.
        trust = jnp.where(held, _MOST_TRUST, jnp.maximum(self.level / jnp.where(held, 1, sensors), 1))
        weights = self.weights if self.measured is None else self.measured * self.weights
        return jnp.concatenate([(trust * weights)[None], jnp.broadcast_to(weights, size)])


def channel_order(space: Space) -> Int[np.ndarray, " o"]:
    """Which entry of (q, rates) each observed channel shows: lengths, angles by cosine and by sine, rates.

    Args:
        space: Configuration space.

    Returns:
        The entries' numbers.
    """
    rates = space.size + np.arange(space.size)
    return np.concatenate([space.lengths, space.angles, space.angles, rates]).astype(int)


def measured_channels(objective: AbstractObjective) -> Float[Array, " o"] | None:
    """Which channels were measured, for what weighs errors.

    Args:
        objective: What makes them.

    Returns:
        1 for channels that were measured, 0 for those that were estimated; None where all were measured.
    """
    return objective.measured if isinstance(objective, Objective) else None


def channel_weights(batch: Batch, dynamics: AbstractDynamics) -> np.ndarray:
    """Inverse of the spread of what a rollout has to predict, the change of each channel over a window.

    Args:
        batch: Windows.
        dynamics: Model, for its space.

    Returns:
        Weight of every observed channel.
    """
    q, space = np.asarray(batch.q), dynamics.space  # Embedded as by `Space.embed`.
    angles = q[..., space.angles]
    observed = np.concatenate([q[..., space.lengths], np.cos(angles), np.sin(angles), batch.rates], axis=-1)
    spread = np.sqrt(np.mean((observed[:, 1:] - observed[:, :1]) ** 2, axis=(0, 1)))
    # What rests must not outweigh what moves: the flicker of an encoder, or nothing at all.
    positions, lengths = space.embedded_size, len(space.lengths)
    circular = np.arange(positions) >= lengths
    least = [least_lively(spread[:positions], circular), least_lively(spread[positions:], space.is_angle)]
    return 1 / np.maximum(np.maximum(spread, np.concatenate(least)), 1e-300)
