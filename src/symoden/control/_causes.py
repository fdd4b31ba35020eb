"""Why a regulator does not hold a model at its target."""

from typing import Final

import numpy as np
import scipy.linalg
from jaxtyping import Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates
from symoden.wording import number

from ._attraction import QUICK, attraction, by_stiffness, simulated_period
from ._controller import as_array
from ._free import anchored, told
from ._judge import Tolerance
from ._regulator import Regulator, linearize, remaining_motion

_NEWTON: Final = 12
_STILL: Final = 1e-3  # Accelerations [rad/s² or m/s²].
_NEAR: Final = 1.0  # [rad or m].
_MORE: Final = (10, 100)


def why_not_held(model: AbstractDynamics, regulator: Regulator, period: float | None) -> str:
    """Find what to change, by trying it on the model.

    Args:
        model: What the regulator was made for.
        regulator: The regulator that does not hold it.
        period: Its control period [s].

    Returns:
        What must hold, what arrived, what to do.
    """
    target, said = regulator.target.tolist(), told(regulator.target)

    def holds(limits: tuple[float, ...], period: float | None) -> bool:
        try:
            others = by_stiffness(model, target, limits=limits, period=period)
        except ValueError:  # There is none.
            return False
        return any(attraction(model, each, period=simulated_period(period)) > 0 for each in others)

    limits = tuple(regulator.limits.tolist())
    goal, kept = anchored(regulator.target), regulator.kept
    A, B, _ = linearize(model, goal, speed=Tolerance().velocity)
    motion = remaining_motion(model, goal, regulator.hold)
    rest = np.linalg.solve((A - B @ np.asarray(regulator.gain))[np.ix_(kept, kept)], -motion[kept])
    aside = float(np.abs(rest[: -model.space.size]).max())
    if aside > Tolerance().position:
        nearest = _nearest_equilibrium(model, goal)
        where = "." if nearest is None else f"; nearby that is {nearest.round(4).tolist()}."
        return (
            f"The target {said} must be an equilibrium of the model, but no input holds it there: the regulator "
            f"would come to rest {aside:.2g} rad or m away, by its linearisation. Choose a target where it rests{where}"
        )
    if period is not None and period > QUICK and holds(limits, QUICK):
        return (
            f"A period of {period:g} s is too long for the regulator to hold the model at the target; with "
            f"{QUICK:g} s it does. {_growth(A)}Shorten the period."
        )
    inputs = f"inputs up to {', '.join(map(number, limits))}"
    for factor in _MORE:
        larger = tuple(factor * limit for limit in limits)
        if holds(larger, period):
            return (
                f"From as far as it must be caught, the regulator does not hold the model at the target with {inputs}; "
                f"with {factor} times as much it does. Allow more input, or use lqr from near the target."
            )
        if period is not None and period > QUICK and holds(larger, QUICK):
            return (
                f"The regulator does not hold the model at the target with {inputs} and a period of {period:g} s; with "
                f"{factor} times as much and {QUICK:g} s it does. {_growth(A)}Allow more input and shorten the period."
            )
    return (
        f"The regulator does not hold the model at the target {said}, and would not with {_MORE[-1]} times the "
        "input: there the model is not what its linearisation says, as with sharp dry friction. Choose another "
        "target, or collect data about this one."
    )


def _nearest_equilibrium(model: AbstractDynamics, target: Coordinates) -> Float[np.ndarray, " n"] | None:
    """A configuration near the target where some input stops all motion, by Newton's method; None if it finds none."""
    start = q = np.asarray(target, float)
    for _ in range(_NEWTON):
        at = as_array(q)
        A, B, hold = linearize(model, at)
        motion = remaining_motion(model, at, as_array(hold))
        if np.abs(motion).max() < _STILL:
            return q
        q = q + _to_equilibrium(A, B, motion)
        if not np.abs(q - start).max() < _NEAR:
            return None
    return None


def _to_equilibrium(
    A: Float[np.ndarray, "s s"], B: Float[np.ndarray, "s m"], motion: Float[np.ndarray, " s"]
) -> Float[np.ndarray, " n"]:
    """The shortest way from a configuration to one where some input stops all motion, to first order."""
    n = len(A) // 2
    left = scipy.linalg.null_space(B[n:].T).T  # Accelerations that no input makes.
    return -np.linalg.pinv(left @ A[n:, :n]) @ left @ motion[n:]


def _growth(A: np.ndarray) -> str:
    """How fast deviations grow, in words."""
    rate = float(np.linalg.eigvals(A).real.max())
    return f"Without input, deviations grow by a factor of e in {1 / rate:.2g} s. " if rate > 0 else ""
