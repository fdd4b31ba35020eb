"""Episodes that ended at rest beside the target because friction held them there."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, gradient
from symoden.shapes import Coordinates, Inputs

from ._controller import as_array
from ._episodes import Episode
from ._free import way_from
from ._judge import Tolerance, judge
from ._scales import slow_friction

_PUSH = 0.01  # of friction; with less nothing is held, for nothing pushes.
_SLOWER, _DRY = 0.1, 0.5  # At a tenth of the speed dry friction is more than half as large; viscous friction is not.


class Stuck(NamedTuple):
    """What friction holds, for each episode; of the coordinate that is farthest from the target.

    Attributes:
        held: Whether it ended at rest beside the target, pushed towards it by less than friction.
        distance: How far from the target [rad or m].
        push: Input that pushes, beside what holds the weight.
        friction: Input that moving takes, at the speed of the tolerance.
    """

    held: Bool[np.ndarray, " k"]
    distance: Float[np.ndarray, " k"]
    push: Float[np.ndarray, " k"]
    friction: Float[np.ndarray, " k"]


def find_stuck(plant: AbstractDynamics, episodes: Episode, target: Float[np.ndarray, " n"] | Coordinates) -> Stuck:
    """Compare the forces at the ends of episodes with friction.

    Args:
        plant: What moved; of one without energy it is not known what friction holds.
        episodes: A batch of its records.
        target: Where it was to come to rest.

    Returns:
        What was held.
    """
    if not isinstance(plant, AbstractPortHamiltonian):
        nothing = np.zeros(len(episodes.q))
        return Stuck(held=nothing > 0, distance=nothing, push=nothing, friction=nothing)
    there, verdict = Tolerance(), judge(episodes, plant.space, target)
    ends = episodes.q[:, -1], episodes.u[:, -1]
    distance, push, friction, slower = map(np.asarray, _forces(plant, *ends, as_array(target)))
    still = ~verdict.success & (verdict.velocity_error <= there.velocity)
    held = still & (distance > there.position) & (push > _PUSH * friction) & (push <= friction)
    held &= slower > _DRY * friction
    return Stuck(held=held, distance=distance, push=push, friction=friction)


@eqx.filter_jit
def _forces(
    plant: AbstractPortHamiltonian, q: Float[Array, "k n"], u: Float[Array, "k m"], target: Coordinates
) -> tuple[Float[Array, " k"], ...]:
    """Of the farthest coordinate, in inputs: distance, push towards the target, friction, and friction when slower."""

    def one(q: Coordinates, u: Inputs) -> tuple[Array, ...]:
        e, g = way_from(target, plant.space, q), plant.input_matrix(q)
        i = jnp.argmax(jnp.abs(e))
        unit = jnp.abs(g[i]).max()
        push = -jnp.sign(e[i]) * (g @ u - gradient(plant, q))[i]
        speed = as_array(Tolerance().velocity)
        friction, slower = (slow_friction(plant, q, share * speed)[i] for share in (1.0, _SLOWER))
        return jnp.abs(e[i]), push / unit, friction / unit, slower / unit

    return jax.vmap(one)(q, u)
