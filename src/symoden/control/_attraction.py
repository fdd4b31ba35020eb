"""Where a regulator with limits brings the system to its target, found by simulating the model."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics

from ._loop import Loop, run_episodes
from ._regulator import Regulator

_DIRECTIONS = 48
_LEVELS = 16
_SMALLEST = 1e-3
_CALMED = 0.02
_SHARE = 0.8


def attraction(
    dynamics: AbstractDynamics, regulator: Regulator, *, period: float = 0.01, duration: float = 6.0, seed: int = 0
) -> float:
    """Level c of the cost to go below which the model, so controlled, always comes near its target.

    States are drawn on ellipsoids xᵀ P x = level, levels going up geometrically; c is a share of the first level at
    which a simulation fails. This is a sample, not a proof.

    Args:
        dynamics: What the regulator was made for; never the machine itself.
        regulator: The regulator, with its limits.
        period: Control period of the simulations [s].
        duration: Their length [s].
        seed: Seed of the directions.

    Returns:
        The level c.
    """
    generator = np.random.default_rng(seed)
    s = len(regulator.cost)
    directions = generator.standard_normal((_DIRECTIONS, s))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shape = np.linalg.cholesky(np.linalg.inv(np.asarray(regulator.cost)))
    levels = np.geomspace(_SMALLEST, 1.0, _LEVELS) * _largest_level(regulator)
    x = np.sqrt(levels)[:, None, None] * (directions @ shape.T)
    q0, v0 = np.split(x.reshape(-1, s), 2, axis=1)
    episodes = run_episodes(
        dynamics, regulator, q0 + np.asarray(regulator.target), v0, Loop(duration=duration, period=period, step=period)
    )
    left = np.asarray(_cost(regulator, episodes.q[:, -1], episodes.v[:, -1])).reshape(_LEVELS, -1)
    with np.errstate(invalid="ignore"):
        good = (left <= _CALMED * levels[:, None]).all(axis=1)
    first_failure = int(np.argmin(good)) if not good.all() else _LEVELS
    return float(_SHARE * levels[first_failure - 1]) if first_failure else 0.0


def _largest_level(regulator: Regulator) -> float:
    """Level of the cost at which an angle may reach half a turn, or a length or speed what is large for it."""
    inverse = np.linalg.inv(np.asarray(regulator.cost))
    n = regulator.space.size
    return float(np.pi**2 / np.diag(inverse)[:n].max())


@eqx.filter_jit
def _cost(regulator: Regulator, q: Float[Array, "k n"], v: Float[Array, "k n"]) -> Float[Array, " k"]:
    """Costs to go."""
    return jax.vmap(regulator.desired_energy)(q, v)


_ = jnp
