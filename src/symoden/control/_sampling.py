"""Whether a controller made for continuous control still holds the model when each input is held for a period."""

import math
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities

from ._controller import AbstractController, as_array
from ._judge import Tolerance
from ._motion import jacobians
from ._regulator import held
from ._tracking import Tracking

_SHORTEST: Final = 1e-3  # Of the period.
_TRIES: Final = 100
_BISECTIONS: Final = 10
_NEUTRAL: Final = 1e-5  # Growth in a period that rounding alone makes.


def check_period(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates, period: float, *, method: str
) -> None:
    """Refuse a control period for which the sampled closed loop is unstable, where a short one is stable.

    Loop and model are linearised at the target, or where a reference begins, at the speed of the tolerance: dry
    friction, which holds still whatever is slower, must not stand for damping. With A, B of the model and K of the
    controller, as it is without limits, a period T takes a deviation to (e^{AT} + ∫₀ᵀ e^{As} ds B K) times itself.

    Args:
        model: System or model.
        controller: Made for continuous control.
        target: Configuration to go to.
        period: Control period T [s].
        method: Its name, for the message.

    Raises:
        ValueError: If deviations grow from period to period, and do not with short ones.

    References:
        Åström & Wittenmark (1997), *Computer-Controlled Systems*, section 2.3.
    """
    A, B, K = _linearized(model, controller, target)
    growth = _growth(A, B, K, period)
    if not growth > 1 + _NEUTRAL:
        return
    tried = period * np.geomspace(_SHORTEST, 1.0, _TRIES)
    unstable = int(np.argmax([_growth(A, B, K, T) > 1 + _NEUTRAL for T in tried]))
    if unstable == 0:
        return
    stable, too_long = tried[unstable - 1], tried[unstable]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (stable + too_long)
        stable, too_long = (stable, middle) if _growth(A, B, K, middle) > 1 + _NEUTRAL else (middle, too_long)
    origin = "reference" if isinstance(controller, Tracking) else "target"
    raise ValueError(
        f"A period of {period:g} s is too long for {method}: inputs that are held so long make deviations from the "
        f"{origin} {growth:.3g} times as large from period to period, by the linearised model; up to "
        f"{_floored(stable):g} s they do not. Shorten the period."
    )


def _floored(value: float) -> float:
    """At most a number, with two digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit) * unit:.2g}")


def _growth(
    A: Float[np.ndarray, "s s"], B: Float[np.ndarray, "s m"], K: Float[np.ndarray, "m s"], period: float
) -> float:
    """Factor by which the fastest growing deviation grows, or the slowest falling one falls, in a period."""
    with np.errstate(all="ignore"):
        hold, effect = held(A, B, period)
        once = hold + effect @ K
    return float(np.abs(np.linalg.eigvals(once)).max()) if np.isfinite(once).all() else np.inf


def _linearized(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates
) -> tuple[Float[np.ndarray, "s s"], Float[np.ndarray, "s m"], Float[np.ndarray, "m s"]]:
    """A, B and K in (q, v)."""
    free = eqx.tree_at(lambda each: each.limits, controller, jnp.full_like(controller.limits, jnp.inf))
    A, B, K = _jacobians(model, free, target)
    return np.asarray(A, float), np.asarray(B, float), np.asarray(K, float)


@eqx.filter_jit
def _jacobians(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates
) -> tuple[Float[Array, "s s"], Float[Array, "s m"], Float[Array, "m s"]]:
    """The same, in one compiled program."""
    start = jnp.zeros((), target.dtype)
    q, v = controller.wanted(start)[:2] if isinstance(controller, Tracking) else (target, jnp.zeros_like(target))
    v = v + as_array(Tolerance().velocity)

    def feedback(q: Coordinates, v: Velocities, t: Scalar = start) -> Inputs:
        return controller(q, v, t)

    A, B = jacobians(model, q, v, feedback(q, v))
    return A, B, jnp.concatenate(jax.jacfwd(feedback, (0, 1))(q, v), axis=1)
