"""Where a controller with limits brings the system to its target, found by simulating the model."""

import contextlib
from typing import Final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics

from ._controller import Limits, Target, as_array
from ._episodes import run_episodes
from ._follower import Follower
from ._free import anchored, free_of
from ._handover import Handover
from ._judge import Tolerance
from ._loop import Loop
from ._regulator import Regulator

QUICK: Final = 0.01
"""Control period, and step, that is short enough for simulations on a model [s]."""

_STIFFER: Final = (3.0, 10.0)  # Stiffnesses that are tried after that of one.
_NEARLY: Final = 0.9  # Share of the best one's successes that a softer regulator must reach.
_EVERY: Final = 3  # Of the directions; which is stiff enough is told by fewer than how far it reaches.
_DURATION: Final = 6.0  # Of a simulation [s].
_DIRECTIONS: Final = 48  # In which states lie on every level of the cost to go.
_LEVELS: Final = 16  # From the smallest one up to that of half a turn.
_SMALLEST: Final = 1e-3  # Level that is tried, relative to that of half a turn.
_CALMED: Final = 0.02  # Share of the cost to go that may be left at the end of a simulation.
_SHARE: Final = 0.8  # Of the largest level from which all came home.
_FASTER: Final = 3.0  # Times as fast, starts beyond the speed at which a free coordinate is braked.
_FUNNELS: Final = np.geomspace(0.02, 2.0, 6)  # Levels that are tried around a planned motion.
_ENOUGH: Final = 0.95  # Share of starts around a planned motion that must arrive.
_PLAN_PERIOD: Final = 0.02  # Between samples of a planned motion [s].
_AFTER: Final = 2.0  # For which it is simulated beyond its end [s].


def attraction(
    dynamics: AbstractDynamics,
    regulator: Regulator,
    *,
    period: float = QUICK,
    duration: float = _DURATION,
    seed: int = 0,
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
    levels, q0, v0 = _ellipsoids(regulator, seed)
    ends = _followed(dynamics, regulator, q0, v0, period, duration)
    left, away = (each.reshape(_LEVELS, -1) for each in ends)
    with np.errstate(invalid="ignore"):
        good = ((left <= _CALMED * levels[:, None]) | (away <= 1)).all(axis=1)
    count = _LEVELS if good.all() else int(np.argmin(good))
    return float(_SHARE * levels[count - 1]) if count else 0.0


def by_stiffness(
    dynamics: AbstractDynamics, target: Target, *, limits: Limits = None, period: float | None = None
) -> list[Regulator]:
    """Make regulators, first the softest that brings the model home nearly as often as any; then from soft to stiff.

    What friction and weak inputs leave beside a target is a matter of gains, which no linearisation tells: a cart that
    dry friction holds creeps to it in half a minute, or in two seconds with three times the gains. Too stiff, inputs
    are at their limits most of the time. Home is who is at the target within the tolerance after 6 s: what is slow by
    its weight is made stiffer as well.

    Args:
        dynamics: System or model.
        target: Configuration to hold.
        limits: Largest magnitude of the inputs; None for none.
        period: Control period [s] for which gains are optimal; None for continuous control.

    Returns:
        The regulators; such that there are none of, for their period or for rounding, are left out.

    Raises:
        ValueError: If holding the target takes more than the limits, or the linearised system cannot be stabilised.
    """
    made = [Regulator.of(dynamics, target, limits=limits, period=period)]
    _, q0, v0 = _ellipsoids(made[0], seed=0)

    def share_home(regulator: Regulator) -> float:
        every = slice(None, None, _EVERY)
        _, away = _followed(dynamics, regulator, q0[every], v0[every], simulated_period(period), _DURATION)
        with np.errstate(invalid="ignore"):
            return float((away <= 1).mean())

    shares = [share_home(made[0])]
    for stiffness in _STIFFER:
        if shares[0] >= _NEARLY or (len(shares) > 1 and not any(shares)):  # None is much better, or any good.
            break
        with contextlib.suppress(ValueError):  # Too stiff for its period, or for digits.
            made.append(Regulator.of(dynamics, target, limits=limits, period=period, stiffness=stiffness))
            shares.append(share_home(made[-1]))
    enough = _NEARLY * max(shares)
    first = next(i for i, share in enumerate(shares) if share >= enough)
    return [made.pop(first), *made]


def simulated_period(period: float | None) -> float:
    """Control period of simulations on a model: as long as wanted, or as is short enough.

    Args:
        period: Control period that is wanted [s]; None for continuous control.

    Returns:
        The period [s].
    """
    return QUICK if period is None else max(period, QUICK)


def follower_level(dynamics: AbstractDynamics, controller: Handover, *, period: float = QUICK, seed: int = 0) -> float:
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


def _ellipsoids(
    regulator: Regulator, seed: int
) -> tuple[Float[np.ndarray, " l"], Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
    """Levels of the cost to go, and states on them, one level after the other."""
    generator = np.random.default_rng(seed)
    kept, n = regulator.kept, regulator.space.size
    inverse = np.linalg.inv(np.asarray(regulator.cost)[np.ix_(kept, kept)])
    s = len(inverse)
    # An angle may reach half a turn, a length and a speed as much.
    levels = np.geomspace(_SMALLEST, 1.0, _LEVELS) * np.pi**2 / np.diag(inverse)[: s - n].max()
    x = np.zeros((_LEVELS, _DIRECTIONS, 2 * n))
    x[..., kept] = np.sqrt(levels)[:, None, None] * (_sphere(generator, s) @ np.linalg.cholesky(inverse).T)
    q0, v0 = np.split(x.reshape(-1, 2 * n), 2, axis=1)
    # Free coordinates may be faster than what counts: those that are get faster still.
    v0 = np.where(np.abs(v0) > np.asarray(regulator.fastest), _FASTER * v0, v0)
    return levels, q0 + np.asarray(anchored(regulator.target)), v0


def _followed(
    dynamics: AbstractDynamics,
    regulator: Regulator,
    q0: Float[np.ndarray, "k n"],
    v0: Float[np.ndarray, "k n"],
    period: float,
    duration: float,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Where the model ends that a regulator controls, as `_ends` says it."""
    episodes = run_episodes(
        dynamics, regulator, q0, v0, Loop(duration=duration, period=period, step=min(period, QUICK))
    )
    return _ends(regulator, episodes.q[:, -1], episodes.v[:, -1])


def _sphere(generator: np.random.Generator, size: int) -> Float[np.ndarray, "k s"]:
    """Random directions."""
    directions = generator.standard_normal((_DIRECTIONS, size))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _ends(
    regulator: Regulator, q: Float[Array, "k n"], v: Float[Array, "k n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Costs to go, and deviations beside the tolerance: at most 1 of what is at the target."""
    there, n = Tolerance(), regulator.space.size
    x, costs = map(np.array, _deviations(regulator, q, v))
    x[:, n:] *= ~free_of(regulator.target)  # No speed is asked of them either.
    return costs, np.abs(x / np.repeat([there.position, there.velocity], n)).max(axis=1)


@eqx.filter_jit
def _deviations(
    regulator: Regulator, q: Float[Array, "k n"], v: Float[Array, "k n"]
) -> tuple[Float[Array, "k s"], Float[Array, " k"]]:
    """Ways from the target, and costs to go."""
    return jax.vmap(regulator.deviation)(q, v), jax.vmap(regulator.desired_energy)(q, v)
