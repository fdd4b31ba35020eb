"""What an environment knows of its mechanism at one time, and how it gets to the next; compiled once for equal ones."""

import functools
from collections.abc import Hashable
from typing import Any, NamedTuple, TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Inputs, Rates, State

Weights: TypeAlias = list[Array | None]
Noise: TypeAlias = Float[Array, " 2*n"]
Times: TypeAlias = Float[Array, " 2"]


class Motion(NamedTuple):
    """State at one time, and what is measured of it, as NumPy's arrays.

    Attributes:
        state: State of the dynamics.
        q: Coordinates, angles as far as they have turned.
        rates: Velocities or momenta.
        away: Way from the target, angles the short way round.
        measured_q: Coordinates with noise, angles in [-π, π).
        measured_rates: Rates with noise.
        observation: Embedded coordinates and rates, as measured.
    """

    state: np.ndarray
    q: np.ndarray
    rates: np.ndarray
    away: np.ndarray
    measured_q: np.ndarray
    measured_rates: np.ndarray
    observation: np.ndarray

    @classmethod
    def of(cls, found: tuple[Array, ...]) -> "Motion":
        """Copy JAX's arrays."""
        return cls(*(np.array(each) for each in found))


@final
class Mover:
    """Dynamics and solver in double precision, whatever JAX's settings; equal ones share the compiled program.

    They are taken apart once, since `equinox.filter_jit` does so at every call, for longer than a step takes.
    """

    def __init__(self, dynamics: AbstractDynamics, solver: AbstractSolver, target: Float64[np.ndarray, " n"]) -> None:
        """Take dynamics apart.

        Args:
            dynamics: System or model, in any precision.
            solver: What advances its state.
            target: Configuration to measure the way from.
        """
        self._parts = (dynamics, solver, target)
        leaves, structure = jax.tree.flatten((dynamics, solver))
        with jax.enable_x64():
            self._weights: Weights = [_double(leaf) if _is_array(leaf) else None for leaf in leaves]
        self._fixed: Hashable = (structure, tuple(None if _is_array(leaf) else leaf for leaf in leaves))
        self._target = target

    def __reduce__(self) -> tuple[type, tuple]:
        """Copy and send it as what it was made of: the structure of a tree survives neither."""
        return type(self), self._parts

    def begin(
        self, q: Float64[np.ndarray, " n"], rates: Float64[np.ndarray, " n"], noise: Float64[np.ndarray, " 2*n"]
    ) -> Motion:
        """Place the mechanism.

        Args:
            q: Coordinates.
            rates: Velocities or momenta.
            noise: What the measurement adds to both.

        Returns:
            The motion at the start.
        """
        with jax.enable_x64():
            return Motion.of(_begin(self._fixed, self._weights, self._target, q, rates, noise))

    def advance(
        self,
        state: Float64[np.ndarray, " s"],
        ts: Float64[np.ndarray, " 2"],
        u: Float64[np.ndarray, " m"],
        noise: Float64[np.ndarray, " d"],
    ) -> Motion:
        """Let an input act from one time to the next.

        Args:
            state: State at the first time.
            ts: Both times [s].
            u: The input.
            noise: What the measurement adds to coordinates and rates.

        Returns:
            The motion at the second time.
        """
        with jax.enable_x64():
            return Motion.of(_advance(self._fixed, self._weights, self._target, state, ts, u, noise))


def _is_array(leaf: object) -> bool:
    """Whether a leaf is traced; plain numbers are part of the program."""
    return isinstance(leaf, jax.Array | np.ndarray)


def _double(leaf: Array | np.ndarray) -> Array:
    """Numbers in double precision; what counts or chooses stays as it is."""
    return jnp.asarray(leaf, np.float64 if eqx.is_inexact_array(leaf) else None)


def _together(fixed: Any, weights: Weights) -> tuple[AbstractDynamics, AbstractSolver]:  # noqa: ANN401 - a pair
    """Put dynamics and solver together again."""
    structure, others = fixed
    leaves = [other if weight is None else weight for other, weight in zip(others, weights, strict=True)]
    return jax.tree.unflatten(structure, leaves)


@functools.partial(jax.jit, static_argnums=0)
def _begin(
    fixed: Hashable, weights: Weights, target: Coordinates, q: Coordinates, rates: Rates, noise: Noise
) -> tuple[Array, ...]:
    """Encode and measure."""
    dynamics, _ = _together(fixed, weights)
    return _measure(dynamics, target, dynamics.encode(q, rates), noise)


@functools.partial(jax.jit, static_argnums=0)
def _advance(
    fixed: Hashable, weights: Weights, target: Coordinates, state: State, ts: Times, u: Inputs, noise: Noise
) -> tuple[Array, ...]:
    """Integrate and measure."""
    dynamics, solver = _together(fixed, weights)
    return _measure(dynamics, target, solver.step(dynamics.derivative, state, ts[0], ts[1], u, u), noise)


def _measure(dynamics: AbstractDynamics, target: Coordinates, state: State, noise: Noise) -> tuple[Array, ...]:
    """Fields of `Motion`: decode a state, and observe it as `dynamics.observe` does, but with noise."""
    space, (q, rates) = dynamics.space, dynamics.decode(state)
    measured_q, measured_rates = space.wrap(q + noise[: space.size]), rates + noise[space.size :]
    observation = jnp.concatenate([space.embed(measured_q), measured_rates])
    return state, q, rates, space.difference(q, target), measured_q, measured_rates, observation
