"""Scales of a model that controllers take their defaults from; none of them depends on the unit of momentum."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian
from symoden.shapes import Coordinates

from ._motion import gradient, potential

_LEAST = 1.0
_POINTS = 512


def configurations(model: AbstractPortHamiltonian, around: Coordinates, *, count: int = _POINTS) -> Float[Array, "k n"]:
    """Configurations with all angles anywhere and all lengths where the target has them.

    Args:
        model: System or model.
        around: The target.
        count: How many.

    Returns:
        A grid for one angle, random ones for more, always the same.
    """
    angles = model.space.angles
    grid = np.linspace(-np.pi, np.pi, count, endpoint=False)[:, None]
    draw = grid if len(angles) == 1 else np.random.default_rng(0).uniform(-np.pi, np.pi, (count, len(angles)))
    q = np.tile(np.asarray(around), (count, 1))
    q[:, angles] = draw
    return jnp.asarray(q, around.dtype)


def bandwidth(model: AbstractPortHamiltonian, target: Coordinates) -> float:
    """Fastest rate at which the potential energy moves the system near the target, a natural speed for its control.

    Args:
        model: System or model.
        target: Configuration.

    Returns:
        √max |λ(M⁻¹ ∇²V)| [rad/s], at least 1.
    """
    hessian = np.asarray(jax.hessian(potential, argnums=1)(model, target))
    rates = np.linalg.eigvals(np.linalg.solve(np.asarray(model.mass_matrix(target)), hessian))
    return max(_LEAST, float(np.sqrt(np.abs(rates).max())))


def static_load(model: AbstractPortHamiltonian, target: Coordinates) -> Float[np.ndarray, " m"]:
    """Largest inputs that holding the system still can need, over all angles.

    Args:
        model: System or model.
        target: Where lengths are.

    Returns:
        One magnitude for each input, by least squares where there are fewer inputs than coordinates.
    """

    def load(q: Coordinates) -> Float[Array, " m"]:
        return jnp.abs(jnp.linalg.lstsq(model.input_matrix(q), gradient(model, q))[0])

    return np.asarray(_largest(load, configurations(model, target)))


def energy_range(model: AbstractPortHamiltonian, target: Coordinates) -> float:
    """Difference of the potential energies of the highest and the lowest configuration.

    Args:
        model: System or model.
        target: Where lengths are.

    Returns:
        The range, in the model's unit.
    """
    q = configurations(model, target)
    return float(_largest(lambda q: potential(model, q), q) + _largest(lambda q: -potential(model, q), q))


@eqx.filter_jit
def _largest(function: Callable, q: Float[Array, "k n"]) -> Array:
    """Largest values of a function."""
    return jax.vmap(function)(q).max(axis=0)
