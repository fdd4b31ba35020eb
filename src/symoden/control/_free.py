"""Targets that leave coordinates free, such as the angle of a reaction wheel: NaN where nothing is to be kept."""

from typing import Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, potential
from symoden.shapes import Coordinates, InputMatrix
from symoden.spaces import Space

from ._scales import configurations

_FLAT: Final = 0.02
_ALIKE: Final = 0.1
_POINTS: Final = 128


def free_of(target: Coordinates) -> Bool[np.ndarray, " n"]:
    """Which coordinates a target leaves free.

    Args:
        target: Configuration, NaN along those.

    Returns:
        A flag for each.
    """
    return np.isnan(np.asarray(target))


def kept_states(target: Coordinates) -> Bool[np.ndarray, " s"]:
    """Which of (e, v) a target asks something of: all but the places of free coordinates.

    Args:
        target: Configuration, NaN along those.

    Returns:
        A flag for each, places first.
    """
    free = free_of(target)
    return np.concatenate([~free, np.ones_like(free)])


def anchored(target: Coordinates) -> Coordinates:
    """A configuration at the target, zero along what is free: nothing may depend on that (`check_free`).

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
    """Along which coordinates the potential energy hardly changes.

    Args:
        model: System or model.
        target: Configuration, NaN along what is free; lengths are taken within 1 m of it.

    Returns:
        A flag for each: whether the largest slope along it is at most a fiftieth of the largest along any.
    """
    slopes = jax.vmap(jax.grad(potential, argnums=1), (None, 0))(model, _around(model, target))
    largest = np.abs(np.asarray(slopes)).max(axis=0)
    return largest <= _FLAT * largest.max()


def indifferent(model: AbstractPortHamiltonian, target: Coordinates) -> Bool[np.ndarray, " n"]:
    """Along which coordinates neither weight nor what inputs do changes much, such that a target may leave them free.

    Args:
        model: System or model.
        target: Configuration, NaN along what is free; lengths are taken within 1 m of it.

    Returns:
        A flag for each: whether V hardly changes along it, and M⁻¹ g in 1 rad or m by less than a tenth of its largest.
    """

    def effect(q: Coordinates) -> InputMatrix:
        return model.inverse_mass_matrix(q) @ model.input_matrix(q)

    q = _around(model, target)
    slopes = np.abs(np.asarray(jax.vmap(jax.jacfwd(effect))(q))).max(axis=(0, 1, 2), initial=0.0)
    largest = np.abs(np.asarray(jax.vmap(effect)(q))).max(initial=0.0)
    return weightless(model, target) & (slopes <= _ALIKE * largest)


def _around(model: AbstractPortHamiltonian, target: Coordinates) -> Float[Array, "k n"]:
    """Configurations with angles anywhere, and lengths within 1 m of the target."""
    q = configurations(model, anchored(target), count=_POINTS)
    lengths = np.random.default_rng(0).uniform(-1, 1, q.shape) * ~np.asarray(model.space.is_angle)
    return q + jnp.asarray(lengths, q.dtype)


def check_free(model: AbstractDynamics, target: Coordinates) -> None:
    """Refuse targets that leave free what something depends on, or everything.

    Args:
        model: System or model; of one without energy nothing of this is known.
        target: Configuration, NaN along what is free.

    Raises:
        ValueError: If V or M⁻¹ g depends on a free coordinate, or no coordinate has a target.
    """
    free = free_of(target)
    if free.all():
        raise ValueError("A target must name a place for at least one coordinate; all were left free.")
    if not free.any() or not isinstance(model, AbstractPortHamiltonian):
        return
    held = np.flatnonzero(free & ~indifferent(model, target))
    if held.size:
        raise ValueError(
            f"What a target leaves free must be what nothing depends on; the model's weight, or what its inputs do, "
            f"depends on coordinate {held[0] + 1}. Give it a place; or, if nothing of the machine does, name it by "
            "`cyclic` under `[known]`, and train anew."
        )


def told(target: Coordinates) -> str:
    """A target in words.

    Args:
        target: Configuration, NaN along what is free.

    Returns:
        Its numbers in brackets, - for what is free.
    """
    return f"[{', '.join('-' if np.isnan(place) else str(place) for place in np.asarray(target).tolist())}]"
