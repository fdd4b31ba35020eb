"""Where a controller with limits brings the system to its target, found by simulating the model."""

from typing import Final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics

from ._controller import as_array
from ._follower import Follower
from ._handover import Handover
from ._judge import Tolerance
from ._loop import Loop, run_episodes
from ._regulator import Regulator

_DIRECTIONS: Final = 48
_LEVELS: Final = 16
_SMALLEST: Final = 1e-3
_CALMED: Final = 0.02
_SHARE: Final = 0.8
_FUNNELS: Final = np.geomspace(0.02, 2.0, 6)
_ENOUGH: Final = 0.95
_PLAN_PERIOD: Final = 0.02
_AFTER: Final = 2.0


def attraction(
    dynamics: AbstractDynamics, regulator: Regulator, *, period: float = 0.01, duration: float = 6.0, seed: int = 0
) -> float:
    """Level c of the cost to go below which the model, so controlled, always comes near its target.

    States are drawn on ellipsoids xᵀ P x = level, levels going up geometrically; c is a share of the last level before
    a simulation fails: is neither at the target within the tolerance, which a learned equilibrium may lie beside and
    dry friction reaches no closer, nor calmed to a fiftieth of the level. This is a sample, not a proof.

    Args:
        dynamics: What the regulator was made for; never the machine itself.
        regulator: The regulator, with its limits.
        period: Control period of the simulations [s].
        duration: Their length [s].
        seed: Seed of the directions.

    Returns:
        The level c; zero if none is safe.
    """
    generator = np.random.default_rng(seed)
    inverse = np.linalg.inv(np.asarray(regulator.cost))
    s, n = len(inverse), regulator.space.size
    # An angle may reach half a turn, a length and a speed as much.
    levels = np.geomspace(_SMALLEST, 1.0, _LEVELS) * np.pi**2 / np.diag(inverse)[:n].max()
    x = np.sqrt(levels)[:, None, None] * (_sphere(generator, s) @ np.linalg.cholesky(inverse).T)
    q0, v0 = np.split(x.reshape(-1, s), 2, axis=1)
    loop = Loop(duration=duration, period=period, step=period)
    episodes = run_episodes(dynamics, regulator, q0 + np.asarray(regulator.target), v0, loop)
    left, away = (x.reshape(_LEVELS, -1) for x in _ends(regulator, episodes.q[:, -1], episodes.v[:, -1]))
    with np.errstate(invalid="ignore"):
        good = ((left <= _CALMED * levels[:, None]) | (away <= 1)).all(axis=1)
    count = _LEVELS if good.all() else int(np.argmin(good))
    return float(_SHARE * levels[count - 1]) if count else 0.0


def follower_level(dynamics: AbstractDynamics, controller: Handover, *, period: float = 0.01, seed: int = 0) -> float:
    """Largest cost to go at which following a motion brings the model to its target nearly always.

    Args:
        dynamics: What the motion was planned on.
        controller: Handover from a `Follower`.
        period: Control period of the simulations [s].
        seed: Seed of the states.

    Returns:
        The level, at least the least one tried.

    Raises:
        TypeError: If the controller is of another kind.
    """
    follower = controller.far
    if not isinstance(follower, Follower):
        raise TypeError(f"States are drawn along the path of a `Follower`; got {type(follower).__name__}.")
    generator = np.random.default_rng(seed)
    x, P = np.asarray(follower.x), np.asarray(follower.cost)
    at = generator.integers(len(x), size=_DIRECTIONS)
    s = x.shape[1]
    away = np.einsum("kij,kj->ki", np.linalg.cholesky(np.linalg.inv(P[at])), _sphere(generator, s))
    starts = (x[at] + np.sqrt(_FUNNELS)[:, None, None] * away).reshape(-1, s)
    following = eqx.tree_at(lambda c: c.far.level, controller, as_array(np.inf))
    loop = Loop(duration=len(x) * _PLAN_PERIOD + _AFTER, period=period, step=period)
    q0, v0 = np.split(starts, 2, axis=1)
    episodes = run_episodes(dynamics, following, q0, v0, loop)
    costs = _ends(controller.near, episodes.q[:, -1], episodes.v[:, -1])[0].reshape(len(_FUNNELS), -1)
    with np.errstate(invalid="ignore"):
        good = (costs < float(controller.level)).mean(axis=1) >= _ENOUGH
    count = len(_FUNNELS) if good.all() else int(np.argmin(good))
    return float(_FUNNELS[max(count - 1, 0)])


def _sphere(generator: np.random.Generator, size: int) -> Float[np.ndarray, "k s"]:
    """Random directions."""
    directions = generator.standard_normal((_DIRECTIONS, size))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _ends(
    regulator: Regulator, q: Float[Array, "k n"], v: Float[Array, "k n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Costs to go, and deviations beside the tolerance: at most 1 of what is at the target."""
    there = Tolerance()
    x, costs = map(np.asarray, _deviations(regulator, q, v))
    return costs, np.abs(x / np.repeat([there.position, there.velocity], regulator.space.size)).max(axis=1)


@eqx.filter_jit
def _deviations(
    regulator: Regulator, q: Float[Array, "k n"], v: Float[Array, "k n"]
) -> tuple[Float[Array, "k s"], Float[Array, " k"]]:
    """Ways from the target, and costs to go."""
    return jax.vmap(regulator.deviation)(q, v), jax.vmap(regulator.desired_energy)(q, v)
