"""Close the loop: sampled control with zero-order hold, measurement noise and delay on any dynamics."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, Velocities

from ._controller import AbstractController
from ._motion import rates_of, velocities_of

_STEP = 0.005


@dataclass(frozen=True, kw_only=True)
class Loop:
    """How a controller is connected to its machine.

    Attributes:
        duration: Length of an episode [s].
        period: Control period [s]; the input is held in between.
        noise: Standard deviation of the Gaussian noise on every measured coordinate and velocity.
        delay: Time from a measurement to its input [s].
        step: Longest step of the plant's integration [s], within the control period.
    """

    duration: float = 10.0
    period: float = 0.005
    noise: float = 0.0
    delay: float = 0.0
    step: float = _STEP

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated.

        Raises:
            ValueError: If a time is not positive, the episode is shorter than a period, or noise or delay is negative.
        """
        values = (self.duration, self.period, self.noise, self.delay, self.step)
        if not all(map(math.isfinite, values)) or min(self.period, self.step) <= 0 or self.duration < self.period:
            raise ValueError(
                "Duration, period and step must be positive, the duration at least one period; got "
                f"{self.duration}, {self.period} and {self.step} s."
            )
        if self.noise < 0 or self.delay < 0:
            raise ValueError(f"Noise and delay must be at least 0; got {self.noise} and {self.delay}.")

    @property
    def samples(self) -> int:
        """Number of control periods."""
        return round(self.duration / self.period)


class Episode(NamedTuple):
    """What happened in one episode, or in each of a batch of them; the true state, not the measured one.

    Attributes:
        ts: Times of the samples [s].
        q: Coordinates, at the start of each period.
        v: Velocities there.
        u: Inputs that the controller gave there; with a delay, they act later.
    """

    ts: Float[Array, "*k T"]
    q: Float[Array, "*k T n"]
    v: Float[Array, "*k T n"]
    u: Float[Array, "*k T m"]


def close_loop(
    plant: AbstractDynamics,
    controller: AbstractController,
    q0: Coordinates,
    v0: Velocities,
    loop: Loop,
    *,
    key: PRNGKeyArray,
) -> Episode:
    """Simulate one episode; where the plant diverges, the record holds NaN or infinities.

    Args:
        plant: What is controlled: analytic system or model.
        controller: What controls it.
        q0: Coordinates at the start.
        v0: Velocities at the start.
        loop: How they are connected.
        key: Key of the noise.

    Returns:
        The record.
    """
    whole, rest = divmod(loop.delay / loop.period, 1.0)
    waiting = math.ceil(loop.delay / loop.period - 1e-9)
    early = loop.period * (rest if waiting > whole else 0.0)
    period = jnp.asarray(loop.period, q0.dtype)

    def advance(state: Array, u: Inputs, seconds: float) -> Array:
        if seconds == 0:
            return state
        still = jnp.zeros((), q0.dtype)
        solver = RK4(math.ceil(seconds / loop.step - 1e-9))
        return solver.step(plant.derivative, state, still, jnp.asarray(seconds, q0.dtype), u, u)

    def sample(carry: tuple, step: Array) -> tuple:
        state, queue = carry
        q, v = velocities_of(plant, state)
        q_key, v_key = jax.random.split(jax.random.fold_in(key, step))
        measured_q = q + loop.noise * jax.random.normal(q_key, q.shape, q.dtype)
        measured_v = v + loop.noise * jax.random.normal(v_key, v.shape, v.dtype)
        u = controller(measured_q, measured_v, step.astype(q.dtype) * period)
        queue = jnp.concatenate([queue, u[None]])
        after = advance(state, queue[0], early)
        after = advance(after, queue[1 if early else 0], loop.period - early)
        return (after, queue[1:]), (q, v, u)

    start = plant.encode(q0, rates_of(plant, q0, v0))
    steps = jnp.arange(loop.samples)
    _, (q, v, u) = jax.lax.scan(sample, (start, jnp.zeros((waiting, plant.inputs), q0.dtype)), steps)
    return Episode(ts=steps.astype(q0.dtype) * period, q=q, v=v, u=u)


def run_episodes(
    plant: AbstractDynamics,
    controller: AbstractController,
    q0: Float[np.ndarray, "k n"] | Float[Array, "k n"],
    v0: Float[np.ndarray, "k n"] | Float[Array, "k n"],
    loop: Loop,
    *,
    seed: int = 0,
) -> Episode:
    """Simulate many episodes at once.

    Args:
        plant: What is controlled.
        controller: What controls it.
        q0: Coordinates at the start of each episode.
        v0: Velocities there.
        loop: How they are connected.
        seed: Seed of the noise.

    Returns:
        The records, episodes first.
    """
    keys = jax.random.split(jax.random.key(seed), len(q0))
    return _episodes(plant, controller, jnp.asarray(q0), jnp.asarray(v0), loop, keys)


@eqx.filter_jit
def _episodes(
    plant: AbstractDynamics,
    controller: AbstractController,
    q0: Float[Array, "k n"],
    v0: Float[Array, "k n"],
    loop: Loop,
    keys: PRNGKeyArray,
) -> Episode:
    """All episodes in one compiled program."""
    return jax.vmap(lambda q, v, key: close_loop(plant, controller, q, v, loop, key=key))(q0, v0, keys)
