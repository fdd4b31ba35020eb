"""Whether a controller made for continuous control still holds the model when each input is held for a period."""

from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, Scalar, Velocities

from ._controller import AbstractController, as_array
from ._judge import Tolerance
from ._motion import velocity_field
from ._tracking import Tracking

_SHORTER: Final = 0.9
_TRIES: Final = 120  # Down to 3e-6 of the period.
_BISECTIONS: Final = 8


def check_period(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates, period: float, *, method: str
) -> None:
    """Refuse a control period for which the sampled closed loop is unstable, where a shorter one is stable.

    Loop and model are linearised at the target, or where a reference begins, at the speed of the tolerance: dry
    friction, which holds still whatever is slower, must not stand for damping. With A, B of the model and K of the
    controller a period T takes a deviation to (e^{AT} + ∫₀ᵀ e^{As} ds B K) times itself.

    Args:
        model: System or model.
        controller: Made for continuous control.
        target: Configuration to go to.
        period: Control period T [s].
        method: Its name, for the message.

    Raises:
        ValueError: If deviations grow from period to period, and would not with a shorter one.

    References:
        Åström & Wittenmark (1997), *Computer-Controlled Systems*, section 2.3.
    """
    A, B, K = _linearized(model, controller, target)
    if (growth := _growth(A, B, K, period)) <= 1:
        return
    shorter = (period * _SHORTER**k for k in range(1, _TRIES))
    stable = next((T for T in shorter if _growth(A, B, K, T) < 1), None)
    if stable is None:
        return
    too_long = stable / _SHORTER
    for _ in range(_BISECTIONS):
        middle = 0.5 * (stable + too_long)
        stable, too_long = (middle, too_long) if _growth(A, B, K, middle) < 1 else (stable, middle)
    raise ValueError(
        f"A period of {period:g} s is too long for {method}: inputs that are held so long make deviations from the "
        f"target {growth:.3g} times as large from period to period, by the linearised model; up to {stable:.2g} s "
        "they do not. Shorten the period."
    )


def _growth(
    A: Float[np.ndarray, "s s"], B: Float[np.ndarray, "s m"], K: Float[np.ndarray, "m s"], period: float
) -> float:
    """Factor by which the fastest growing deviation grows, or the slowest falling one falls, in a period."""
    s, m = B.shape
    held = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, s + m))]]) * period)[:s]
    with np.errstate(all="ignore"):
        once = held[:, :s] + held[:, s:] @ K
    return float(np.abs(np.linalg.eigvals(once)).max()) if np.isfinite(once).all() else np.inf


def _linearized(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates
) -> tuple[Float[np.ndarray, "s s"], Float[np.ndarray, "s m"], Float[np.ndarray, "m s"]]:
    """A, B and K in (q, v)."""
    A, B, K = _jacobians(model, controller, target)
    return np.asarray(A, float), np.asarray(B, float), np.asarray(K, float)


@eqx.filter_jit
def _jacobians(
    model: AbstractDynamics, controller: AbstractController, target: Coordinates
) -> tuple[Float[Array, "s s"], Float[Array, "s m"], Float[Array, "m s"]]:
    """The same, in one compiled program."""
    start = jnp.zeros((), target.dtype)
    q, v = controller.wanted(start)[:2] if isinstance(controller, Tracking) else (target, jnp.zeros_like(target))
    v = v + as_array(Tolerance().velocity)

    def field(q: Coordinates, v: Velocities, u: Inputs) -> Float[Array, " s"]:
        return jnp.concatenate(velocity_field(model, q, v, u))

    def feedback(q: Coordinates, v: Velocities, t: Scalar = start) -> Inputs:
        return controller(q, v, t)

    by_q, by_v, by_u = jax.jacfwd(field, argnums=(0, 1, 2))(q, v, feedback(q, v))
    return jnp.concatenate([by_q, by_v], axis=1), by_u, jnp.concatenate(jax.jacfwd(feedback, (0, 1))(q, v), axis=1)
