"""Gains of a swing-up, searched by simulating the model: the machine itself is never asked."""

from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from symoden.mechanics import AbstractDynamics

from ._episodes import close_loop
from ._handover import Handover
from ._loop import Loop
from ._pumps import CollocatedPump

SEARCHED: Final = Loop(duration=12.0, period=0.01, step=0.01)
"""How the loop is closed in the simulations."""

_CANDIDATES: Final = 32
_ELITE: Final = 6
_SPREAD: Final = 0.6
_LEAST_SPREAD: Final = 0.05


def searched(
    dynamics: AbstractDynamics,
    controller: Handover,
    q0: Float[np.ndarray, "k n"],
    v0: Float[np.ndarray, "k n"],
    *,
    rounds: int = 5,
    loop: Loop = SEARCHED,
    seed: int = 0,
) -> Handover:
    """Improve the gains of a collocated pump by the cross-entropy method on simulations of the model.

    A candidate's score is the mean share of time outside the regulator's region, and whether it ends inside.

    Args:
        dynamics: The learned model that is simulated.
        controller: Handover from a `CollocatedPump`, whose gains are where the search starts.
        q0: Coordinates to start from.
        v0: Velocities there.
        rounds: Number of rounds.
        loop: How the loop is closed in the simulations.
        seed: Seed of the candidates.

    Returns:
        The controller with the best gains that were seen.

    Raises:
        TypeError: If the controller is of another kind.
    """
    generator = np.random.default_rng(seed)
    pump = controller.far
    if not isinstance(pump, CollocatedPump):
        raise TypeError(f"Gains are searched of a `CollocatedPump`; got {type(pump).__name__}.")
    best = mean = np.log(np.asarray(pump.gains))
    best_score, spread = np.inf, np.full(mean.shape, _SPREAD)
    for _ in range(rounds):
        draw = mean + spread * generator.standard_normal((_CANDIDATES, len(mean)))
        draw[0] = best
        starts = jnp.asarray(q0), jnp.asarray(v0), jax.random.split(jax.random.key(seed), len(q0))  # The same noise.
        scores = np.asarray(_scores(dynamics, controller, jnp.exp(jnp.asarray(draw)), *starts, loop))
        order = np.argsort(np.where(np.isfinite(scores), scores, np.inf))
        if scores[order[0]] < best_score:
            best, best_score = draw[order[0]], scores[order[0]]
        chosen = draw[order[:_ELITE]]
        mean, spread = chosen.mean(axis=0), np.maximum(chosen.std(axis=0), _LEAST_SPREAD)
    return _with_gains(controller, jnp.exp(jnp.asarray(best)))


def _with_gains(controller: Handover, gains: Float[Array, "7"]) -> Handover:
    """Other gains."""
    return eqx.tree_at(lambda whole: whole.far.gains, controller, gains)


@eqx.filter_jit
def _scores(
    dynamics: AbstractDynamics,
    controller: Handover,
    gains: Float[Array, "c g"],
    q0: Float[Array, "k n"],
    v0: Float[Array, "k n"],
    keys: Key[Array, " k"],
    loop: Loop,
) -> Float[Array, " c"]:
    """Mean score of each candidate over the starts."""

    def one(gains: Float[Array, " g"], q: Array, v: Array, key: PRNGKeyArray) -> Float[Array, ""]:
        episode = close_loop(dynamics, _with_gains(controller, gains), q, v, loop, key=key)
        cost = jax.vmap(controller.near.desired_energy)(episode.q, episode.v) / controller.level
        cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
        away = jnp.mean((cost > 1).astype(q.dtype))
        return away + jnp.where(cost[-1] > 1, 1.0, 0.0) + 0.1 * jnp.log10(jnp.minimum(jnp.min(cost), 1e3) + 0.01)

    by_start = jax.vmap(one, in_axes=(None, 0, 0, 0))
    return jax.vmap(lambda g: jnp.mean(by_start(g, q0, v0, keys)))(gains)
