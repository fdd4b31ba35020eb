"""What every controller is: a pure function from a measurement to an input, within limits."""

import abc
import math
from collections.abc import Sequence
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from symoden.shapes import Coordinates, Inputs, Scalar, Velocities
from symoden.spaces import Space

Limits: TypeAlias = float | tuple[float, ...] | None
Target: TypeAlias = ArrayLike | Sequence[float]


class AbstractController(eqx.Module):
    """State feedback u(q, v), or u(q, v, t) where it follows a reference.

    Attributes:
        limits: Largest magnitude of each input; infinite where there is none.
    """

    limits: eqx.AbstractVar[Inputs]

    @property
    @abc.abstractmethod
    def space(self) -> Space:
        """Configuration space."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input for the configuration `q` and velocities `v` at time `t` [s], zero if absent; within the limits."""

    @abc.abstractmethod
    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """Function that the closed loop is to decrease: the shaped energy H_d, or the regulator's cost-to-go."""


def input_limits(limits: Limits, inputs: int) -> np.ndarray:
    """Limits as an array.

    Args:
        limits: Largest magnitude of every input, or of each; None for no limits.
        inputs: Number of inputs.

    Returns:
        One number for each input.

    Raises:
        ValueError: If there is another number of them, or one is not positive.
    """
    values = np.full(inputs, np.inf) if limits is None else np.asarray(limits, float)
    if values.size == 1:
        values = np.full(inputs, values.item())
    if values.shape != (inputs,) or not np.all(values > 0):
        raise ValueError(f"Limits must be positive, one number for all {inputs} inputs or one for each; got {limits}.")
    return values


def check_positive(**gains: float | None) -> None:
    """Refuse gains that would drive a system away from its target.

    Args:
        gains: Numbers by their names; None where one is chosen.

    Raises:
        ValueError: If one is not positive and finite.
    """
    for name, gain in gains.items():
        if gain is not None and not 0 < gain < math.inf:
            raise ValueError(f"`{name}` must be positive and finite; got {gain}.")


def saturate(u: Inputs, limits: Inputs) -> Inputs:
    """Bring every input into its limits.

    Args:
        u: Wanted inputs.
        limits: Largest magnitudes.

    Returns:
        Inputs within them.
    """
    return jnp.clip(u, -limits, limits)


def as_array(value: Target) -> Float[Array, "..."]:
    """Constant of a controller in the default precision of JAX: double where it is switched on."""
    return jnp.asarray(value, jnp.result_type(float))
