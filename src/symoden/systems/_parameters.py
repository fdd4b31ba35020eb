"""Physical parameters of the analytic systems: what they may be, and what they must not be."""

from collections.abc import Sequence
from typing import TypeAlias

import jax

from symoden.shapes import Scalar

Parameter: TypeAlias = float | int | Scalar


def require_positive(**parameters: Parameter) -> None:
    """Refuse plain numbers that are not positive; arrays may be traced, and are the caller's.

    Args:
        **parameters: Parameters by the names that their class gives them.

    Raises:
        ValueError: If a plain number is zero, negative or not a number.
    """
    for name, value in parameters.items():
        if not isinstance(value, jax.Array) and not value > 0:
            raise ValueError(f"`{name}` must be positive; got {value}. Give it in SI units.")


def require_non_negative(**parameters: Parameter) -> None:
    """Refuse plain numbers that are negative; arrays may be traced, and are the caller's.

    Args:
        **parameters: Parameters by the names that their class gives them.

    Raises:
        ValueError: If a plain number is negative or not a number.
    """
    for name, value in parameters.items():
        if not isinstance(value, jax.Array) and not value >= 0:
            raise ValueError(f"`{name}` must be at least 0; got {value}. Negative friction would add energy.")


def require_count(count: int, **groups: Sequence[Parameter | bool]) -> None:
    """Refuse groups of parameters that have not one entry for each link or joint.

    Args:
        count: Number of links.
        **groups: Groups by the names that their class gives them.

    Raises:
        ValueError: If a group has another length.
    """
    for name, values in groups.items():
        if len(values) != count:
            raise ValueError(f"`{name}` must have one entry for each of the {count} links; got {len(values)}.")
