"""What inputs do where the inertia and the potential energy are given: a linear regression, before all learning."""

import dataclasses
from collections.abc import Callable
from typing import Final, TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import lsq_linear

from symoden.blocks import Constant, Known, KnownFriction, MatrixBlock, Sum
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel, given_parts
from symoden.shapes import Coordinates, DissipationMatrix, Velocities

from ._data import Data
from ._gauss_newton import linearize
from ._objective import Batch

_KNEE: Final = 0.03  # Of the typical velocity: where dry friction sets in.
_RIDGE: Final = 1e-3  # Beside what the best determined direction is known to: holds what nothing tells at zero.
_WINDOWS: Final = 16  # At a time.


def knows_energies(model: AbstractDynamics) -> bool:
    """Whether M and V are given, at least up to something.

    Args:
        model: Any model.

    Returns:
        Whether they are.
    """
    return {"mass_matrix", "potential_energy"} <= set(given_parts(model))


def learns_inputs(model: AbstractDynamics) -> TypeGuard[StructuredModel]:
    """Whether a model knows its energies, and has a g to learn that is constant at first.

    Args:
        model: An untrained model.

    Returns:
        Whether it is so.
    """
    if not isinstance(model, StructuredModel) or model.momenta or not model.inputs:
        return False
    function = model.actuation.function if isinstance(model.actuation, MatrixBlock) else None
    first = function.terms[0] if isinstance(function, Sum) else function
    return isinstance(first, Constant) and knows_energies(model)


def regress_inputs(model: StructuredModel, data: Data) -> Float[np.ndarray, "n m"]:
    """Find the g that explains the recordings best with M and V as they are given.

    In weak form the equations of motion are linear in g, and in viscous and dry friction, which are found beside it
    unless they are given. Where M and V are known up to their weights, and nothing fixes the unit of these (currents
    for inputs), it is that of the weights they begin with.

    Args:
        model: Model that `learns_inputs`, in double precision.
        data: Windows for the weak form.

    Returns:
        The matrix, in physical units.
    """
    n, m = model.space.size, model.inputs
    rubs = "dissipation_matrix" not in given_parts(model)
    speed = np.sqrt(np.mean(np.asarray(data.train.rates) ** 2, axis=(0, 1)))
    knee = _KNEE * np.maximum(speed, 1e-300)

    def restore(x: Float[Array, " c"]) -> StructuredModel:
        def friction(q: Coordinates, v: Velocities) -> DissipationMatrix:
            del q
            viscous, dry = x[n * m : n * m + n], x[n * m + n :]
            return jnp.diag(viscous + dry / jnp.sqrt(v**2 + knee**2))

        unit = MatrixBlock(Constant(x[: n * m]), Known.of(np.ones((n, m))))
        return dataclasses.replace(model, actuation=unit, friction=KnownFriction(friction) if rubs else model.friction)

    left, columns = _linear(restore, jnp.zeros(n * m + 2 * n * rubs, float), data)
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    rows = np.concatenate([columns / size, _RIDGE * np.eye(len(size))])
    least = np.concatenate([np.full(n * m, -np.inf), np.zeros(len(size) - n * m)])
    found = lsq_linear(rows, -np.concatenate([left, np.zeros(len(size))]), bounds=(least, np.inf)).x / size
    return found[: n * m].reshape(n, m)


def with_inputs(model: AbstractDynamics, matrix: Float[np.ndarray, "n m"]) -> AbstractDynamics:
    """Let a model begin with a constant g.

    Args:
        model: Model that `learns_inputs`.
        matrix: The g.

    Returns:
        The model.
    """

    def begun(node: object) -> object:
        if not isinstance(node, MatrixBlock):
            return node
        values = (matrix / np.asarray(node.scale.array)).ravel()
        first, *others = node.function.terms if isinstance(node.function, Sum) else (node.function,)
        first = Constant(jnp.asarray(values, float))
        return MatrixBlock(Sum((first, *others)) if others else first, node.scale)

    return eqx.tree_at(lambda model: model.actuation, model, replace_fn=begun)


def _linear(
    restore: Callable[[Float[Array, " c"]], StructuredModel], zero: Float[Array, " c"], data: Data
) -> tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r c"]]:
    """Residuals of all windows without inputs and friction, and their derivatives by these."""

    @jax.jit
    def all_of(zero: Float[Array, " c"], windows: Batch) -> tuple[Array, Array]:
        return jax.lax.map(
            lambda window: linearize(restore, zero, data.objective, window), windows, batch_size=_WINDOWS
        )

    residuals, jacobians = all_of(zero, data.train)
    return np.asarray(residuals, float).ravel(), np.asarray(jacobians, float).reshape(-1, len(zero))
