"""Physical names for the shapes of arrays, equal axis names meaning equal lengths within one call; their checks."""

from typing import TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

Scalar: TypeAlias = Float[Array, ""]
Coordinates: TypeAlias = Float[Array, " n"]
Velocities: TypeAlias = Float[Array, " n"]
Momenta: TypeAlias = Float[Array, " n"]
Rates: TypeAlias = Float[Array, " n"]  # velocities or momenta, as the data state it
Inputs: TypeAlias = Float[Array, " m"]
Embedding: TypeAlias = Float[Array, " e"]
State: TypeAlias = Float[Array, " s"]
Observation: TypeAlias = Float[Array, " o"]
SquareMatrix: TypeAlias = Float[Array, "n n"]
InputMatrix: TypeAlias = Float[Array, "n m"]
DissipationMatrix: TypeAlias = Float[Array, "d d"]  # d = n (on momenta) or 2n (the paper's full D)
Times: TypeAlias = Float[Array, " T"]
Flag: TypeAlias = Bool[Array, ""]


def floats(values: object, name: str) -> jax.Array:
    """Make an array of floating-point numbers of anything that is one, such as a list.

    Args:
        values: The values; an array of JAX may be traced.
        name: What they are, for the message.

    Returns:
        The array; one of JAX that holds no whole numbers is returned as it is.

    Raises:
        ValueError: If they are no array of numbers.
    """
    try:
        array = values if isinstance(values, jax.Array) else jnp.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of numbers; got {values!r}. Give one by `jnp.array`.") from error
    whole = jnp.issubdtype(array.dtype, jnp.integer) or array.dtype == bool
    return array.astype(float) if whole else array


def vector(values: object, size: int, name: str, per: str) -> jax.Array:
    """Make a vector of what must have so many numbers. Only the shape is looked at: compiled code does not know of it.

    Args:
        values: The values; an array of JAX may be traced.
        size: How many there must be.
        name: What they are, for the message.
        per: What there is a number for, for the message.

    Returns:
        The vector.

    Raises:
        ValueError: If they have another shape, or are no numbers.

    Example:
        >>> vector([0, 1], 2, "`q`", "coordinate").tolist()
        [0.0, 1.0]
    """
    array = floats(values, name)
    if array.shape != (size,):
        raise ValueError(
            f"{name} must have the shape ({size},), one number per {per}; got {array.shape}. Functions take one "
            "state; `jax.vmap` makes them take many."
        )
    return array
