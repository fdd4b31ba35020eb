"""Scales of a model that controllers take their defaults from; none of them depends on the unit of momentum."""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, friction_matrix, gradient, potential
from symoden.shapes import Coordinates, Scalar, Velocities

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
    hessian, mass = map(np.asarray, _stiffness_and_mass(model, target))
    rates = np.linalg.eigvals(np.linalg.solve(mass, hessian))
    return max(_LEAST, float(np.sqrt(np.abs(rates).max())))


def static_load(model: AbstractPortHamiltonian, target: Coordinates) -> Float[np.ndarray, " m"]:
    """Largest inputs that holding the system still can need, over all angles.

    Args:
        model: System or model.
        target: Where lengths are.

    Returns:
        One magnitude for each input, by least squares where there are fewer inputs than coordinates.
    """
    return _values(_load, model, configurations(model, target)).max(axis=0)


def slow_friction(model: AbstractPortHamiltonian, q: Coordinates, speed: Scalar) -> Velocities:
    """Friction of each coordinate that moves alone and slowly: dry friction, and a little of the viscous one.

    Args:
        model: System or model.
        q: Configuration.
        speed: How slowly [rad/s or m/s].

    Returns:
        The larger of both directions' for each coordinate, in the model's unit of force.
    """
    alone = speed * jnp.eye(q.size, dtype=q.dtype)
    forces = jax.vmap(lambda v: friction_matrix(model, q, v) @ v)(jnp.concatenate([alone, -alone]))
    return jnp.abs(jnp.stack([jnp.diag(forces[: q.size]), jnp.diag(forces[q.size :])])).max(axis=0)


def energy_range(model: AbstractPortHamiltonian, target: Coordinates) -> float:
    """Difference of the potential energies of the highest and the lowest configuration.

    Args:
        model: System or model.
        target: Where lengths are.

    Returns:
        The range, in the model's unit.
    """
    return float(np.ptp(_values(potential, model, configurations(model, target))))


def _values(function: Callable, model: AbstractPortHamiltonian, q: Float[Array, "k n"]) -> np.ndarray:
    """Values of a function of the model at every configuration."""
    return np.asarray(_compiled_values(function, model, q))


@eqx.filter_jit
def _compiled_values(function: Callable, model: AbstractPortHamiltonian, q: Float[Array, "k n"]) -> Array:
    """`_values`, compiled."""
    return jax.vmap(functools.partial(function, model))(q)


def _load(model: AbstractPortHamiltonian, q: Coordinates) -> Float[Array, " m"]:
    """Inputs that hold the system still."""
    return jnp.abs(jnp.linalg.lstsq(model.input_matrix(q), gradient(model, q))[0])


@eqx.filter_jit
def _stiffness_and_mass(
    model: AbstractPortHamiltonian, q: Coordinates
) -> tuple[Float[Array, "n n"], Float[Array, "n n"]]:
    """∇²V and M."""
    return jax.hessian(potential, argnums=1)(model, q), model.mass_matrix(q)
