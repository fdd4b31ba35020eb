"""Residuals of rollouts and their Jacobian, by sensitivities beside the state."""

from collections.abc import Callable
from functools import partial
from typing import TypeAlias, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.integrate import RK4, AbstractSolver, LinearField, Stages, sensitivity_step
from symoden.mechanics import AbstractDynamics
from symoden.models import Lagrangian, Tangent, lagrangian, pull_back
from symoden.shapes import Inputs, Observation, Scalar, State

from ._objective import Batch, Objective
from ._starts import project_out

Parameters: TypeAlias = Float[Array, " P"]
Sensitivity: TypeAlias = Float[Array, "s P"]
Pair: TypeAlias = tuple[State, Sensitivity]


def linearize_rollout(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, objective: Objective, window: Batch
) -> tuple[Float[Array, " r"], Float[Array, "r P"]]:
    """Residuals of one window and their Jacobian, by integrating the sensitivity S = ∂x/∂θ beside the state.

    Ṡ = (∂f/∂x) S + ∂f/∂θ is integrated by the solver of the state, which gives the exact derivative of a Runge-Kutta
    rollout. Its cost grows linearly with the horizon, where one reverse pass per residual grows quadratically.
    Where starts are free, they follow the parameters.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        window: One window.

    Returns:
        Residuals, sample by sample, and their derivatives by the parameters.
    """
    dynamics = restore(theta)
    advance, observe = _advancing(restore, theta, objective.solver), _observing(restore, theta)
    rows = objective.row_weights(window.ts.shape[0]).astype(theta.dtype)

    def step(pair: Pair, sample: tuple) -> tuple:
        *between, weights = sample
        after = advance(pair, *between)
        # Weighted at once: a pass over what thousands of parameters make takes as long as a step.
        return after, (dynamics.observe(after[0]), observe(*after, weights))

    def encode(theta: Parameters, start: Array) -> State:
        return restore(theta).encode(*jnp.split(start, 2))

    first = encode(theta, window.start)
    by_theta, by_start = jax.jacrev(encode, argnums=(0, 1))(theta, window.start)
    freed = by_start if objective.frees_starts else by_start[:, :0]  # More columns of the sensitivity.
    start = (first, jnp.concatenate([by_theta, freed], axis=1))
    samples = window.ts[:-1], window.ts[1:], *objective.hold(window.us), rows[-len(window.ts) + 1 :]
    _, (observations, jacobian) = jax.lax.scan(step, start, samples)
    observations = jnp.concatenate([dynamics.observe(first)[None], observations])
    residuals = objective.compare(dynamics, observations, window)
    if objective.frees_starts:
        jacobian = jnp.concatenate([observe(*start, rows[0])[None], jacobian])
    jacobian = objective.whitened(jacobian).reshape(residuals.size, -1)
    if objective.frees_starts:
        jacobian = project_out(jacobian[:, theta.size :], jacobian[:, : theta.size])
    return residuals.ravel(), jacobian


def _padded(derivative: Float[Array, "... P"], columns: int) -> Float[Array, "... Q"]:
    """A derivative by the parameters as one by these and the start, on which it does not depend."""
    return jnp.pad(derivative, [(0, 0)] * (derivative.ndim - 1) + [(0, columns)])


def _advancing(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, solver: AbstractSolver
) -> Callable[..., Pair]:
    """What advances a state and its sensitivity from sample to sample."""
    dynamics = lagrangian(restore(theta))
    if isinstance(dynamics, Lagrangian) and isinstance(solver, RK4):
        restored = cast("Callable[[Parameters], Lagrangian]", lambda theta: lagrangian(restore(theta)))
        return partial(sensitivity_step, solver, _linear(restored, theta))

    def field(t: Scalar, pair: Pair, u: Inputs) -> Pair:
        state, sensitivity = pair

        def derivative(state: State, theta: Parameters) -> State:
            return restore(theta).derivative(t, state, u)

        rate, pullback = jax.vjp(derivative, state, theta)
        by_state, by_theta = jax.vmap(pullback)(jnp.eye(state.shape[0], dtype=state.dtype))
        return rate, by_state @ sensitivity + _padded(by_theta, sensitivity.shape[1] - by_theta.shape[1])

    return partial(solver.step, field)


def _observing(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters
) -> Callable[[State, Sensitivity, Observation], Float[Array, "o P"]]:
    """What makes the sensitivity of a state that of what is observed of it, times weights."""
    dynamics = lagrangian(restore(theta))
    if isinstance(dynamics, Lagrangian) and not dynamics.momenta:
        restored = cast("Callable[[Parameters], Lagrangian]", lambda theta: lagrangian(restore(theta)))
        return _observing_velocities(restored, theta)

    def observe(state: State, theta: Parameters) -> Observation:
        return restore(theta).observe(state)

    def observed(state: State, sensitivity: Sensitivity, weights: Observation) -> Float[Array, "o P"]:
        by_state, by_theta = jax.jacrev(observe, argnums=(0, 1))(state, theta)
        sensitivity = by_state @ sensitivity + _padded(by_theta, sensitivity.shape[1] - theta.size)
        return weights[:, None] * sensitivity

    return observed


def _observing_velocities(
    restore: Callable[[Parameters], Lagrangian], theta: Parameters
) -> Callable[[State, Sensitivity, Observation], Float[Array, "o P"]]:
    """The same where velocities are observed: the first half of the equations of motion."""
    dynamics = restore(theta)
    n = dynamics.space.size
    still = jnp.zeros((1, dynamics.inputs), theta.dtype)

    def observed(state: State, sensitivity: Sensitivity, weights: Observation) -> Float[Array, "o P"]:
        by_state, found = dynamics.linearize(state, still[0])
        embedded = weights[:-n, None] * jax.jacfwd(dynamics.space.embed)(state[:n])
        by_state = jnp.concatenate([jnp.pad(embedded, ((0, 0), (0, n))), weights[-n:, None] * by_state[:n]])
        chosen = jnp.pad(jnp.diag(weights[-n:]), ((0, 0), (0, n)))  # The rows of q̇.
        alone = jax.tree.map(lambda x: x[None], (state, found, chosen))
        by_theta = pull_back(restore, theta, alone[0], still, *alone[1:])
        by_theta = jnp.pad(by_theta, ((len(embedded), 0), (0, sensitivity.shape[1] - theta.size)))
        return by_state @ sensitivity + by_theta

    return observed


def _linear(restore: Callable[[Parameters], Lagrangian], theta: Parameters) -> LinearField:
    """Equations of motion and their derivatives."""
    dynamics = restore(theta)

    def by_state(t: Scalar, state: State, u: Inputs) -> tuple:
        del t
        return dynamics.linearize(state, u)

    def pulled(stages: Stages, found: Tangent, weights: Float[Array, "4 s s"]) -> Sensitivity:
        return pull_back(restore, theta, stages.states, stages.us, found, weights)

    return LinearField(dynamics.derivative, by_state, pulled)
