"""What is given, at the states in the data: whether it can be right, and the units that it implies."""

import dataclasses
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.blocks import with_parameters
from symoden.known import PARTS, KnownParts
from symoden.spaces import Space

from ._known import KnownBlocks, known_blocks

_STATES: Final = 512
_FAR: Final = (np.sqrt(2), 10 * np.pi / 7)  # No period that anybody writes down fits into both.
_SLACK: Final = 1e-6  # Relative: formulas may have been rounded, and run in single precision.


class KnownMagnitudes(NamedTuple):
    """Typical momenta and forces of what is given; None where nothing that is given tells.

    Attributes:
        momentum: Root mean square of M v.
        force: Root mean square of g u; without g, of ∂V/∂q; without both, of D v.
    """

    momentum: np.ndarray | None
    force: np.ndarray | None


class _Values(NamedTuple):
    """Given parts at many states; None where they are not given."""

    mass: Float[Array, "K n n"] | None
    slope: Float[Array, "K n"] | None
    inputs: Float[Array, "K n m"] | None
    friction: Float[Array, "K n n"] | None


def check_known(known: KnownParts, space: Space, inputs: int, q: np.ndarray, v: np.ndarray) -> None:
    """Refuse given parts that cannot be those of a mechanism at the states in the data.

    Parameters have their start values.

    Args:
        known: The given parts.
        space: Configuration space of n coordinates.
        inputs: Number of inputs.
        q: Coordinates (K, n).
        v: Velocities (K, n).

    Raises:
        ValueError: If a value is not finite, a matrix is not symmetric, M is not positive definite, D not positive
            semidefinite, or a part does not come back when an angle goes once round or depends on a cyclic coordinate.
    """
    blocks = known_blocks(known, space, inputs)
    q, v = _some(q), _some(v)
    values = _values(blocks, jnp.asarray(q, float), jnp.asarray(v, float))
    for name, value in zip(PARTS, values, strict=True):
        if value is not None:
            _refuse(name, np.logical_not(np.isfinite(value).reshape(len(q), -1).all(axis=1)), q, v, "finite")
    for name, matrices, definite in (
        ("mass_matrix", values.mass, "definite"),
        ("dissipation_matrix", values.friction, "semidefinite"),
    ):
        if matrices is not None:
            X = _without_units(np.asarray(matrices, float))
            _refuse(name, np.abs(X - X.swapaxes(1, 2)).max(axis=(1, 2)) > _SLACK, q, v, "symmetric")
            least = np.linalg.eigvalsh(X)[:, 0]
            _refuse(name, least <= _SLACK if definite == "definite" else least < -_SLACK, q, v, f"positive {definite}")
    for i in np.flatnonzero(space.is_angle):
        _refuse_change(blocks, values, q, v, step=2 * np.pi * np.eye(space.size)[i], what=f"a turn of q{i + 1}")
    for i in (i for i in range(space.size) if f"q{i + 1}" in known.cyclic):
        what = f"q{i + 1} has moved, which `cyclic` names"
        for far in _FAR:
            _refuse_change(blocks, values, q, v, step=far * np.eye(space.size)[i], what=what)
        if values.slope is not None:
            slope = np.abs(np.asarray(values.slope, float))
            pulls = slope[:, i] > _SLACK * slope.max(initial=0.0)
            _refuse("potential_energy", pulls, q, v, f"zero along q{i + 1}, which `cyclic` names")


def known_magnitudes(known: KnownParts, space: Space, q: np.ndarray, v: np.ndarray, us: np.ndarray) -> KnownMagnitudes:
    """Typical momenta and forces at the states in the data, which set the scale of what is learned.

    Args:
        known: The given parts.
        space: Configuration space of n coordinates.
        q: Coordinates (K, n).
        v: Velocities (K, n).
        us: Inputs (K, m).

    Returns:
        The magnitudes.
    """
    blocks = known_blocks(known, space, us.shape[1])
    q, v, us = _some(q), _some(v), _some(us)
    values = _values(blocks, jnp.asarray(q, float), jnp.asarray(v, float))
    momentum = None if values.mass is None else _rms(np.einsum("kij,kj->ki", values.mass, v))
    forces = (
        None if values.inputs is None else np.einsum("kij,kj->ki", values.inputs, us),
        values.slope,
        None if values.friction is None else np.einsum("kij,kj->ki", values.friction, v),
    )
    force = next((_rms(np.asarray(force)) for force in forces if force is not None and np.any(force)), None)
    return KnownMagnitudes(momentum if momentum is not None and np.all(momentum > 0) else None, force)


def parameter_units(
    known: KnownParts,
    space: Space,
    q: np.ndarray,
    v: np.ndarray,
    us: np.ndarray,
    *,
    acceleration: np.ndarray,
    force: np.ndarray,
) -> dict[str, float]:
    """Natural units of the parameters that start at 0: values that change forces by typical ones.

    Of a part that a parameter stands in, the force is ∂V/∂q, g u, D v, or M times the typical acceleration.

    Args:
        known: The given parts.
        space: Configuration space of n coordinates.
        q: Coordinates (K, n).
        v: Velocities (K, n).
        us: Inputs (K, m).
        acceleration: Typical accelerations (n,).
        force: Typical forces (n,).

    Returns:
        The units by name; 1 where no force depends on the parameter at first order.
    """
    absent = [name for name, start in known.parameters.items() if start == 0]
    if not absent:
        return {}
    blocks = known_blocks(known, space, us.shape[1])
    q, v, us = _some(q), _some(v), _some(us)
    slopes = _slopes(blocks, *(jnp.asarray(rows, float) for rows in (q, v, us, acceleration)))
    changes = np.concatenate([np.asarray(slope, float) for slope in slopes]) / force[:, None]
    sizes = np.sqrt(np.sum(np.mean(changes**2, axis=1), axis=(0, 1)))
    named = dict(zip(known.parameters, sizes.tolist(), strict=True))
    return {name: 1 / named[name] if 0 < named[name] < np.inf else 1.0 for name in absent}


def _some(rows: np.ndarray) -> np.ndarray:
    """Rows from all over the data, at most so many."""
    return rows[:: -(-len(rows) // _STATES)]


def _rms(samples: np.ndarray) -> np.ndarray:
    """Root mean square of every column."""
    return np.sqrt(np.mean(samples**2, axis=0))


def _without_units(matrices: Float[np.ndarray, "K n n"]) -> Float[np.ndarray, "K n n"]:
    """Matrices whose diagonals are ±1 or 0: 200 kg beside 1e-4 kg m² is as definite as in any other units."""
    scale = np.sqrt(np.abs(np.diagonal(matrices, axis1=1, axis2=2)))
    # Beside a zero on the diagonal of a semidefinite matrix there are zeros: what is not counts as large.
    rows, largest = np.abs(matrices).max(axis=2), scale.max(axis=1, keepdims=True)
    others = rows / np.where(largest > 0, largest, np.sqrt(np.maximum(rows.max(axis=1, keepdims=True), 1e-300)))
    scale = np.where(scale > 0, scale, np.where(others > 0, others, 1.0))
    return matrices / scale[:, :, None] / scale[:, None, :]


@eqx.filter_jit
def _values(blocks: KnownBlocks, q: Float[Array, "K n"], v: Float[Array, "K n"]) -> _Values:
    """Given parts at many states."""
    mass, potential, actuation = (
        with_parameters(block, blocks.parameters) for block in (blocks.mass, blocks.potential, blocks.actuation)
    )
    friction = with_parameters(blocks.friction, blocks.parameters)
    return _Values(
        mass=None if mass is None else jax.vmap(mass)(q),
        slope=None if potential is None else jax.vmap(jax.grad(potential))(q),
        inputs=None if actuation is None else jax.vmap(actuation)(q),
        friction=None if friction is None else jax.vmap(friction)(q, v),
    )


@eqx.filter_jit
def _slopes(
    blocks: KnownBlocks,
    q: Float[Array, "K n"],
    v: Float[Array, "K n"],
    us: Float[Array, "K m"],
    acceleration: Float[Array, " n"],
) -> list[Float[Array, "_ K n k"]]:
    """Derivatives of the forces of each part by the k parameters, one by one where signs beside each other are open."""
    parameters = blocks.parameters
    if parameters is None:
        return []

    def forces(theta: Float[Array, " k"]) -> list[Float[Array, "_ K n"]]:
        values = _values(blocks._replace(parameters=dataclasses.replace(parameters, theta=theta)), q, v)
        found = []
        if values.mass is not None:
            found.append(jnp.einsum("kij,j->jki", values.mass, acceleration))
        if values.slope is not None:
            found.append(values.slope[None])
        if values.inputs is not None:
            found.append(jnp.einsum("kij,kj->ki", values.inputs, us)[None])
        if values.friction is not None:
            found.append(jnp.einsum("kij,kj->ki", values.friction, v)[None])
        return found

    return jax.jacfwd(forces)(parameters.theta)


def _refuse_change(
    blocks: KnownBlocks, values: _Values, q: np.ndarray, v: np.ndarray, *, step: np.ndarray, what: str
) -> None:
    """Refuse a part that is not the same some way on."""
    moved = _values(blocks, jnp.asarray(q + step, float), jnp.asarray(v, float))
    for name, here, there in zip(PARTS, values, moved, strict=True):
        if here is not None and there is not None:
            one, other = (np.asarray(x, float).reshape(len(q), -1) for x in (here, there))
            tolerance = 1e-3 * np.abs(one).max() + 1e-300
            _refuse(name, np.abs(one - other).max(axis=1) > tolerance, q, v, f"the same after {what}")


def _refuse(name: str, unfit: np.ndarray, q: np.ndarray, v: np.ndarray, what: str) -> None:
    """Refuse a part that is not what it must be at some states."""
    if unfit.any():
        k = int(np.argmax(unfit))
        at = f"q = {np.round(q[k], 4).tolist()}, v = {np.round(v[k], 4).tolist()}"
        what = f"have a slope that is {what}" if name == "potential_energy" else f"be {what}"
        hint = "Correct the formulas, the constants or the start values of the parameters"
        if "turn" in what:
            hint = "Give it with a period of 2π, or the space of a length instead of the angle"
        if "cyclic" in what:
            hint = "Leave the coordinate out of `cyclic`, or correct what is given"
        raise ValueError(f"The given `{name}` must {what} at every state in the data; at {at} it is not so. {hint}.")
