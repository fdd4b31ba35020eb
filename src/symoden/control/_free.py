"""Targets that leave coordinates free, such as the angle of a reaction wheel: NaN where nothing is to be kept."""

from typing import Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, potential
from symoden.shapes import Coordinates
from symoden.spaces import Space

from ._scales import configurations

_FLAT: Final = 0.02


def free_of(target: Coordinates) -> Bool[np.ndarray, " n"]:
    """Which coordinates a target leaves free.

    Args:
        target: Configuration, NaN along those.

    Returns:
        A flag for each.
    """
    return np.isnan(np.asarray(target))


def anchored(target: Coordinates) -> Coordinates:
    """A configuration at the target: as nothing depends on what is free, that is zero.

    Args:
        target: Configuration, NaN along what is free.

    Returns:
        The configuration.
    """
    return jnp.where(jnp.isnan(target), 0.0, target)


def way_from(target: Coordinates, space: Space, q: Coordinates) -> Coordinates:
    """Distance from a target, angles the short way round.

    Args:
        target: Configuration, NaN along what is free.
        space: Configuration space.
        q: Coordinates.

    Returns:
        e, zero along what is free.
    """
    return jnp.where(jnp.isnan(target), 0.0, space.difference(q, anchored(target)))


def weightless(model: AbstractPortHamiltonian, target: Coordinates) -> Bool[np.ndarray, " n"]:
    """Along which coordinates the potential energy hardly changes, such that a target may leave them free.

    Args:
        model: System or model.
        target: Configuration, NaN along what is free.

    Returns:
        A flag for each: whether the largest slope along it is at most a fiftieth of the largest along any.
    """
    slopes = jax.vmap(jax.grad(potential, argnums=1), (None, 0))(model, configurations(model, anchored(target)))
    largest = np.abs(np.asarray(slopes)).max(axis=0)
    return largest <= _FLAT * largest.max()


def check_free(model: AbstractDynamics, target: Coordinates) -> None:
    """Refuse targets that leave free what weight depends on, or everything.

    Args:
        model: System or model; of one without energy weight is not known.
        target: Configuration, NaN along what is free.

    Raises:
        ValueError: If the potential energy depends on a free coordinate, or no coordinate has a target.
    """
    free = free_of(target)
    if free.all():
        raise ValueError("A target must name a place for at least one coordinate; all were left free.")
    if not free.any() or not isinstance(model, AbstractPortHamiltonian):
        return
    held = np.flatnonzero(free & ~weightless(model, target))
    if held.size:
        raise ValueError(
            f"What a target leaves free must be what weight does not depend on; the model's potential energy depends "
            f"on coordinate {held[0] + 1}. Give it a place; or, if nothing of the machine depends on it, name it by "
            "`cyclic` under `[known]`, and train anew."
        )
