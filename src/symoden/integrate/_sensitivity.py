"""Derivatives of Runge-Kutta steps, of all four stages at once."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from symoden.shapes import Inputs, Scalar, State

from ._solvers import OFFSETS, RK4, WEIGHTS, Field, Stages

Sensitivity: TypeAlias = Float[Array, "s P"]
Pair: TypeAlias = tuple[State, Sensitivity]


class LinearField(NamedTuple):
    """A right-hand side f(t, x, u; θ) and its derivatives.

    Attributes:
        slope: f.
        by_state: ∂f/∂x, and anything that `pull_back` needs of it.
        pull_back: Σ Wᵢ ∂f/∂θ over stages, from these, what `by_state` found at each of them, and the matrices W.
    """

    slope: Field
    by_state: Callable[[Scalar, State, Inputs], tuple[Float[Array, "s s"], PyTree]]
    pull_back: Callable[[Stages, PyTree, Float[Array, "4 s s"]], Sensitivity]


def sensitivity_step(
    solver: RK4, field: LinearField, pair: Pair, t0: Scalar, t1: Scalar, u0: Inputs, u1: Inputs
) -> Pair:
    """State and sensitivity S = ∂x/∂θ at `t1`: the derivative of `solver.step`, to rounding.

    A step's derivative is S ↦ T S + Σ Wᵢ ∂f/∂θ with small matrices T and Wᵢ = ∂(after) / ∂kᵢ, where k are its slopes.
    So the parameters, which may be thousands, come in once in a step, not in every stage.

    Args:
        solver: How many steps there are in the interval.
        field: Right-hand side.
        pair: State and sensitivity at `t0`.
        t0: Time of the sample before.
        t1: Time of the sample after.
        u0: Input at the one.
        u1: Input at the other.

    Returns:
        Both.
    """
    h = (t1 - t0) / jnp.asarray(solver.substeps, t0.dtype)

    def one(pair: Pair, start: Scalar) -> Pair:
        state, sensitivity = pair
        after, stages = solver.substep(field.slope, state, start, t0, t1, u0, u1)
        by_state, found = jax.vmap(field.by_state)(*stages)
        transition, weights = _derivatives(by_state, h)
        entering = field.pull_back(stages, found, weights)
        # Further columns, if any, are those of the start, which comes in nowhere else.
        further = sensitivity.shape[1] - entering.shape[1]
        return after, transition @ sensitivity + jnp.pad(entering, ((0, 0), (0, further)))

    return jax.lax.fori_loop(0, solver.substeps, lambda i, pair: one(pair, i.astype(t0.dtype)), pair)


def _derivatives(by_state: Float[Array, "4 s s"], h: Scalar) -> tuple[Float[Array, "s s"], Float[Array, "4 s s"]]:
    """Derivatives T of a step by the state before it, and W by its slopes."""
    one = jnp.eye(by_state.shape[1], dtype=by_state.dtype)
    weights = [WEIGHTS[-1] * h * one]
    for k in (2, 1, 0):  # Every slope moves what comes next, and the place of the one after it.
        weights.append(WEIGHTS[k] * h * one + OFFSETS[k + 1] * h * weights[-1] @ by_state[k + 1])
    W = jnp.stack(weights[::-1])
    return one + jnp.einsum("kab,kbc->ac", W, by_state), W
