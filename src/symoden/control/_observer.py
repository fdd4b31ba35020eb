"""Estimate the state from noisy measurements: the learned model predicts, the measurement corrects."""

from collections.abc import Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, State, Velocities

from ._motion import moved


class Estimate(NamedTuple):
    """What is believed of the state.

    Attributes:
        q: Coordinates.
        v: Velocities.
        covariance: Covariance of (q, v).
    """

    q: Coordinates
    v: Velocities
    covariance: Float[Array, "s s"]


def _hashable(given: float | Sequence[float] | np.ndarray) -> float | tuple[float, ...]:
    """One number, or a tuple of one per channel."""
    numbers = np.asarray(given, float)
    return numbers.item() if numbers.ndim == 0 else tuple(numbers.ravel().tolist())


@final
class Observer(eqx.Module):
    """Extended Kalman filter on measurements of all coordinates and velocities.

    It is also what looks ahead where inputs act with a delay.

    Attributes:
        model: What predicts.
        noise: Standard deviation of the noise on every channel, or on each, coordinates before velocities.
        drift: Growth of the prediction's standard deviation on every channel, or on each, in its unit per √s: how far
            the model is trusted. The default suits a model of simulated data, whose errors are small.

    References:
        Anderson & Moore (1979), *Optimal Filtering*, section 8.2.
    """

    model: AbstractDynamics
    noise: float | tuple[float, ...] = eqx.field(static=True, converter=_hashable)
    drift: float | tuple[float, ...] = eqx.field(static=True, default=2e-3, converter=_hashable)

    def __check_init__(self) -> None:
        """Refuse a filter that cannot weigh.

        Raises:
            ValueError: If the noise or the drift is not positive, or is not one number or one per channel.
        """
        channels = 2 * self.model.space.size
        for name, each in (("noise", np.asarray(self.noise)), ("drift", np.asarray(self.drift))):
            if each.shape not in {(), (channels,)} or not np.all(each > 0):
                raise ValueError(
                    f"`{name}` must be positive, one number or one for each of the {channels} channels, coordinates "
                    f"before velocities; got {getattr(self, name)}."
                )

    def start(self, q: Coordinates, v: Velocities) -> Estimate:
        """Believe a first measurement.

        Args:
            q: Measured coordinates.
            v: Measured velocities.

        Returns:
            The estimate.
        """
        return Estimate(q, v, self._variance(self.noise, q.dtype))

    def correct(self, guess: Estimate, q: Coordinates, v: Velocities) -> Estimate:
        """Move a prediction towards a measurement, angles the short way round.

        Args:
            guess: The prediction.
            q: Measured coordinates.
            v: Measured velocities.

        Returns:
            The estimate.
        """
        P = guess.covariance
        one = jnp.eye(len(P), dtype=P.dtype)
        gain = jnp.linalg.solve(P + self._variance(self.noise, P.dtype), P).T
        surprise = jnp.concatenate([self.model.space.difference(q, guess.q), v - guess.v])
        by_q, by_v = jnp.split(gain @ surprise, 2)
        after = (one - gain) @ P
        return Estimate(guess.q + by_q, guess.v + by_v, 0.5 * (after + after.T))

    def predict(self, guess: Estimate, u: Inputs, seconds: float) -> Estimate:
        """Move an estimate with the model under a held input.

        Args:
            guess: The estimate.
            u: Input.
            seconds: How far ahead [s].

        Returns:
            The prediction.
        """
        if seconds == 0:
            return guess

        def move(x: State) -> tuple[State, State]:
            q, v = jnp.split(x, 2)
            after = jnp.concatenate(moved(self.model, q, v, u, seconds))
            return after, after

        A, after = jax.jacfwd(move, has_aux=True)(jnp.concatenate(guess[:2]))
        grown = A @ guess.covariance @ A.T + seconds * self._variance(self.drift, A.dtype)
        q, v = jnp.split(after, 2)
        return Estimate(q, v, grown)

    def look_ahead(
        self, guess: Estimate, us: Float[Array, "w m"], *, first: float, period: float
    ) -> tuple[Coordinates, Velocities]:
        """Move an estimate through inputs that were given but act later.

        Args:
            guess: The estimate.
            us: Inputs on their way, the one that acts now first.
            first: For how long the first one still acts [s]; a whole period if zero.
            period: For how long each other one acts [s].

        Returns:
            The state at which the next input will begin to act.
        """
        if len(us) == 0:
            return guess.q, guess.v
        x = moved(self.model, guess.q, guess.v, us[0], first or period)
        return jax.lax.scan(lambda x, u: (moved(self.model, *x, u, period), None), x, us[1:])[0]

    def _variance(self, deviation: float | tuple[float, ...], dtype: np.dtype) -> Float[Array, "s s"]:
        """Diagonal covariance of independent channels."""
        each = jnp.broadcast_to(jnp.asarray(deviation, dtype), 2 * self.model.space.size)
        return jnp.diag(each**2)
