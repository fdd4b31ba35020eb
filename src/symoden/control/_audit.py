"""Does the desired energy fall? Its rate along the closed loop, by formula, at the states that were visited."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Scalar, Velocities

from ._controller import AbstractController
from ._episodes import Episode
from ._motion import velocity_field

_TOLERANCE: Final = 1e-6
_SHOWN: Final = 50_000
_BATCH: Final = 1_000  # Much larger batches of small factorizations can block XLA on processors of few cores.


@dataclass(frozen=True, kw_only=True, eq=False)
class LyapunovAudit:
    """Rate of the desired energy at visited states, with continuous control and without noise.

    Attributes:
        rates: dH_d/dt.
        holds: Whether it is not positive, up to a millionth of the largest |dH_d/dt|.
        share: Share of states at which it holds.
        worst: Largest rate beside the largest magnitude of any; not positive if it always holds.
        worst_q: Coordinates where the rate is largest, angles in [-π, π).
        worst_v: Velocities there.
        saturated: Of the states at which it fails, the share with an input at its limit; NaN without any.
    """

    rates: Float[np.ndarray, " k"]
    holds: Bool[np.ndarray, " k"]
    share: float
    worst: float
    worst_q: tuple[float, ...]
    worst_v: tuple[float, ...]
    saturated: float


def audit_energy(plant: AbstractDynamics, controller: AbstractController, episodes: Episode) -> LyapunovAudit:
    """Evaluate dH_d/dt = ∂H_d/∂q q̇ + ∂H_d/∂v v̇ + ∂H_d/∂t at the samples of a batch of episodes.

    Args:
        plant: What moves: the machine, or the model for which the decrease was meant.
        controller: The controller.
        episodes: Records, whose finite samples are taken.

    Returns:
        Where the desired energy falls.

    Raises:
        ValueError: If no sample is finite.
    """
    return audit_energies([(plant, episodes)], controller)


def audit_energies(tried: Sequence[tuple[AbstractDynamics, Episode]], controller: AbstractController) -> LyapunovAudit:
    """The same, at the samples of episodes of several systems.

    Args:
        tried: Systems, each with a batch of its episodes.
        controller: The controller.

    Returns:
        Where the desired energy falls.

    Raises:
        ValueError: If no sample is finite.
    """
    found = [_sampled(plant, controller, episodes, _SHOWN // len(tried)) for plant, episodes in tried]
    q, v, rates, u = (np.concatenate(parts) for parts in zip(*found, strict=True))
    if not rates.size:
        raise ValueError("Nothing to audit: every sample of the closed loop is NaN or infinite.")
    largest = float(np.abs(rates).max())
    holds = rates <= _TOLERANCE * largest
    at = int(np.argmax(rates))
    limited = np.any(np.abs(u) >= np.asarray(controller.limits), axis=1)
    return LyapunovAudit(
        rates=rates,
        holds=holds,
        share=float(holds.mean()),
        worst=float(rates[at] / largest) if largest else 0.0,
        worst_q=tuple(controller.space.wrap(jnp.asarray(q[at])).tolist()),
        worst_v=tuple(v[at].tolist()),
        saturated=float(limited[~holds].mean()) if not holds.all() else float("nan"),
    )


def _sampled(
    plant: AbstractDynamics, controller: AbstractController, episodes: Episode, most: int
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"], Float[np.ndarray, " k"], Float[np.ndarray, "k m"]]:
    """Finite samples of a batch of episodes: coordinates, velocities, dH_d/dt and inputs."""
    n, m = episodes.q.shape[-1], episodes.u.shape[-1]
    q, v = (np.asarray(part).reshape(-1, n) for part in (episodes.q, episodes.v))
    ts = np.asarray(episodes.ts).reshape(-1)
    finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
    q, v, ts = q[finite], v[finite], ts[finite]
    every = max(1, -(-len(q) // most))
    q, v, ts = q[::every], v[::every], ts[::every]
    if not len(q):
        return q, v, np.zeros(0), np.zeros((0, m))
    rates, u = _rates(plant, controller, jnp.asarray(q), jnp.asarray(v), jnp.asarray(ts))
    return q, v, np.asarray(rates), np.asarray(u).reshape(-1, m)


@eqx.filter_jit
def _rates(
    plant: AbstractDynamics,
    controller: AbstractController,
    q: Float[Array, "k n"],
    v: Float[Array, "k n"],
    ts: Float[Array, " k"],
) -> tuple[Float[Array, " k"], Float[Array, "k m"]]:
    """Rates and inputs at many states."""
    return jax.lax.map(lambda at: energy_rate(plant, controller, *at), (q, v, ts), batch_size=_BATCH)


def desired_energies(controller: AbstractController, episodes: Episode) -> Float[np.ndarray, "k T"]:
    """Evaluate the desired energy at the samples of a batch of episodes.

    Args:
        controller: The controller.
        episodes: Records.

    Returns:
        The energies.
    """
    n = episodes.q.shape[-1]
    flat = episodes.q.reshape(-1, n), episodes.v.reshape(-1, n), episodes.ts.reshape(-1)
    return np.asarray(_energies(controller, *flat)).reshape(episodes.ts.shape)


@eqx.filter_jit
def _energies(
    controller: AbstractController, q: Float[Array, "k n"], v: Float[Array, "k n"], ts: Float[Array, " k"]
) -> Float[Array, " k"]:
    """Desired energies at many states."""
    return jax.lax.map(lambda at: controller.desired_energy(*at), (q, v, ts), batch_size=_BATCH)


def energy_rate(
    plant: AbstractDynamics, controller: AbstractController, q: Coordinates, v: Velocities, t: Scalar
) -> tuple[Scalar, Array]:
    """dH_d/dt at one state under continuous control.

    Args:
        plant: What moves.
        controller: What controls it.
        q: Coordinates.
        v: Velocities.
        t: Time [s].

    Returns:
        The rate, and the input there.
    """
    u = controller(q, v, t)
    _, rate = jax.jvp(controller.desired_energy, (q, v, t), (*velocity_field(plant, q, v, u), jnp.ones_like(t)))
    return rate, u
