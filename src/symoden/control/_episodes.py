"""Close the loop on any dynamics, and record what happens."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, State, Velocities

from ._controller import AbstractController
from ._loop import Loop
from ._motion import rates_of, velocities_of
from ._observer import Observer
from ._predictor import PredictorFeedback


class Episode(NamedTuple):
    """What happened in one episode, or in each of a batch of them; the true state, not the measured one.

    Attributes:
        ts: Times of the samples [s].
        q: Coordinates, at the start of each period.
        v: Velocities there.
        u: Inputs that the controller gave there; with a delay or a lag, they act later.
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
        observer: What filters the measurements, and looks ahead to when inputs act; the controller sees them raw if
            absent.
        key: Key of the noise.

    Returns:
        The record.

    Raises:
        ValueError: If the number of lags is wrong.
    """
    lag, noise_key, start_key = loop.lag_of(plant.inputs), *jax.random.split(key)
    feedback = None if observer is None else PredictorFeedback(controller, observer, loop)

    def advance(state: State, acting: Inputs, u: Inputs, seconds: float) -> tuple[State, Inputs]:
        count = loop.steps(seconds)
        still, ahead = jnp.zeros((), q0.dtype), jnp.asarray(seconds / count, q0.dtype)

        def step(carry: tuple[State, Inputs], _: None) -> tuple[tuple[State, Inputs], None]:
            state, acting = carry
            acting, mean = lag.follow(acting, u, seconds / count)
            return (RK4().step(plant.derivative, state, still, ahead, mean, mean), acting), None

        return jax.lax.scan(step, (state, acting), None, count)[0]

    def measure(q: Coordinates, v: Velocities, key: PRNGKeyArray) -> tuple[Coordinates, Velocities]:
        noise = loop.noise * jax.random.normal(key, (2, *q.shape), q.dtype)
        return q + noise[0], v + noise[1]

    def sample(carry: tuple, step: Array) -> tuple:
        state, waiting, acting, memory = carry
        q, v = velocities_of(plant, state)
        measured, t = measure(q, v, jax.random.fold_in(noise_key, step)), step.astype(q.dtype) * loop.period
        if feedback is None:
            u = controller(*measured, t)
        else:
            u, memory = feedback.answer(memory, *measured, t)
        given = jnp.concatenate([waiting, u[None]])
        for held, seconds in loop.parts(given):
            state, acting = advance(state, acting, held, seconds)
        return (state, given[1:], acting, memory), (q, v, u)

    start = plant.encode(q0, rates_of(plant, q0, v0))
    steps, none = jnp.arange(loop.samples), jnp.zeros((loop.waiting + 1, plant.inputs), q0.dtype)
    memory = None if feedback is None else feedback.start(*measure(q0, v0, start_key))
    _, (q, v, u) = jax.lax.scan(sample, (start, none[1:], none[0], memory), steps)
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
