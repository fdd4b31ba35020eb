"""Close the loop: sampled control with zero-order hold, measurement noise and delay on any dynamics."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, State, Velocities

from ._controller import AbstractController
from ._motion import rates_of, velocities_of
from ._observer import Observer

MOST_PERIODS: Final = 10**7
"""Most control periods in which states are kept."""
_LOUDEST: Final = 1e6
_STEP = 0.005
_ROUNDING = 1e-9


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
            ValueError: If a time is not positive, the episode is shorter than a period or has too many, noise or delay
                is negative, or noise is huge.
        """
        values = (self.duration, self.period, self.noise, self.delay, self.step)
        if not all(map(math.isfinite, values)) or min(self.period, self.step) <= 0 or self.duration < self.period:
            raise ValueError(
                "Duration, period and step must be positive, the duration at least one period; got "
                f"{self.duration}, {self.period} and {self.step} s."
            )
        if self.duration / self.period > MOST_PERIODS:
            raise ValueError(
                f"An episode must have at most {MOST_PERIODS} control periods; got {self.duration / self.period:.3g}."
            )
        if not 0 <= self.noise <= _LOUDEST or self.delay < 0:
            raise ValueError(
                f"Noise must be between 0 and {_LOUDEST:g}, delay at least 0; got {self.noise} and {self.delay}."
            )

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
    observer: Observer | None = None,
    key: PRNGKeyArray,
) -> Episode:
    """Simulate one episode; where the plant diverges, the record holds NaN or infinities.

    Args:
        plant: What is controlled: analytic system or model.
        controller: What controls it.
        q0: Coordinates at the start.
        v0: Velocities at the start.
        loop: How they are connected.
        observer: What filters the measurements, and looks ahead over the delay; the controller sees them raw if absent.
        key: Key of the noise.

    Returns:
        The record.
    """
    waiting = math.ceil(loop.delay / loop.period - _ROUNDING)
    first = loop.period - (waiting * loop.period - loop.delay)  # For how long the oldest input still acts.
    early = first if waiting and first < (1 - _ROUNDING) * loop.period else 0.0
    noise_key, start_key = jax.random.split(key)

    def advance(state: State, u: Inputs, seconds: float) -> State:
        if seconds == 0:
            return state
        still = jnp.zeros((), q0.dtype)
        solver = RK4(math.ceil(seconds / loop.step - _ROUNDING))
        return solver.step(plant.derivative, state, still, jnp.asarray(seconds, q0.dtype), u, u)

    def measure(q: Coordinates, v: Velocities, key: PRNGKeyArray) -> tuple[Coordinates, Velocities]:
        noise = loop.noise * jax.random.normal(key, (2, *q.shape), q.dtype)
        return q + noise[0], v + noise[1]

    def sample(carry: tuple, step: Array) -> tuple:
        state, queue, guess = carry
        q, v = velocities_of(plant, state)
        known = measured = measure(q, v, jax.random.fold_in(noise_key, step))
        if observer is not None:
            guess = observer.correct(guess, *measured)
            known = observer.look_ahead(guess, queue, first=early, period=loop.period)
        u = controller(*known, step.astype(q.dtype) * loop.period)
        queue = jnp.concatenate([queue, u[None]])
        after = advance(state, queue[0], early)
        after = advance(after, queue[1 if early else 0], loop.period - early)
        if observer is not None:
            guess = observer.predict(guess, queue[0], early)
            guess = observer.predict(guess, queue[1 if early else 0], loop.period - early)
        return (after, queue[1:], guess), (q, v, u)

    start = plant.encode(q0, rates_of(plant, q0, v0))
    steps = jnp.arange(loop.samples)
    guess = None if observer is None else observer.start(*measure(q0, v0, start_key))
    _, (q, v, u) = jax.lax.scan(sample, (start, jnp.zeros((waiting, plant.inputs), q0.dtype), guess), steps)
    return Episode(ts=steps.astype(q0.dtype) * loop.period, q=q, v=v, u=u)


def run_episodes(
    plant: AbstractDynamics,
    controller: AbstractController,
    q0: Float[np.ndarray, "k n"] | Float[Array, "k n"],
    v0: Float[np.ndarray, "k n"] | Float[Array, "k n"],
    loop: Loop,
    *,
    observer: Observer | None = None,
    seed: int = 0,
) -> Episode:
    """Simulate many episodes at once.

    Args:
        plant: What is controlled.
        controller: What controls it.
        q0: Coordinates at the start of each episode.
        v0: Velocities there.
        loop: How they are connected.
        observer: What filters the measurements; none if absent.
        seed: Seed of the noise.

    Returns:
        The records, episodes first.
    """
    keys = jax.random.split(jax.random.key(seed), len(q0))
    return _episodes(plant, controller, jnp.asarray(q0), jnp.asarray(v0), loop, observer, keys)


def run_in_turn(
    plants: Sequence[AbstractDynamics],
    controller: AbstractController,
    q0: Float[np.ndarray, "k n"],
    v0: Float[np.ndarray, "k n"],
    loop: Loop,
    *,
    observer: Observer | None = None,
    seed: int = 0,
) -> list[tuple[AbstractDynamics, Episode]]:
    """Simulate many episodes, the first on the first plant, the next on the next, and so on round.

    Args:
        plants: What is controlled, at most as many as episodes.
        controller: What controls it.
        q0: Coordinates at the start of each episode.
        v0: Velocities there.
        loop: How they are connected.
        observer: What filters the measurements; none if absent.
        seed: Seed of the noise.

    Returns:
        Each plant with the records of its episodes.
    """
    tried = []
    for k, plant in enumerate(plants):
        q, v = (part[k :: len(plants)] for part in (q0, v0))
        tried.append((plant, run_episodes(plant, controller, q, v, loop, observer=observer, seed=seed + k)))
    return tried


@eqx.filter_jit
def _episodes(
    plant: AbstractDynamics,
    controller: AbstractController,
    q0: Float[Array, "k n"],
    v0: Float[Array, "k n"],
    loop: Loop,
    observer: Observer | None,
    keys: Key[Array, " k"],
) -> Episode:
    """All episodes in one compiled program."""

    def one(q: Coordinates, v: Velocities, key: PRNGKeyArray) -> Episode:
        return close_loop(plant, controller, q, v, loop, observer=observer, key=key)

    return jax.vmap(one)(q0, v0, keys)
