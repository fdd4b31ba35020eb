"""What users may set: numbers checked and brought to the shape that is needed."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float64

Bounds: TypeAlias = Sequence[tuple[float, float]]
Vector: TypeAlias = Float64[np.ndarray, " k"]


def vector(name: str, values: object, size: int, *, positive: bool = False) -> Vector:
    """Numbers as a vector of a given size, one number standing for all.

    Args:
        name: Name in messages.
        values: The numbers.
        size: How many there must be.
        positive: Whether they must be greater than 0.

    Returns:
        The vector, a copy.

    Raises:
        ValueError: If these are no such numbers.
    """
    try:
        numbers = np.array(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"`{name}` must be {size} numbers; got {values!r}.") from error
    if numbers.shape not in ((), (size,)):
        raise ValueError(f"`{name}` must be {size} numbers; got {values!r}, of shape {numbers.shape}.")
    if np.isnan(numbers).any():
        raise ValueError(f"`{name}` must be {size} numbers; got {values!r}, with NaN in it.")
    if positive and not (numbers > 0).all():
        raise ValueError(f"`{name}` must be {size} positive numbers; got {values!r}.")
    return np.broadcast_to(numbers, (size,)).copy()


def bounds(name: str, values: Bounds, size: int) -> Float64[np.ndarray, "k 2"]:
    """Lowest and highest value of each coordinate.

    Args:
        name: Name in messages.
        values: The pairs.
        size: How many there must be.

    Returns:
        The pairs as rows.

    Raises:
        ValueError: If these are no such pairs.
    """
    pairs = np.array(values, np.float64)
    if pairs.shape != (size, 2) or not (np.isfinite(pairs).all() and (pairs[:, 0] <= pairs[:, 1]).all()):
        raise ValueError(f"`{name}` must be {size} pairs of a lowest and a highest number; got {values!r}.")
    return pairs


def start_of(
    options: Mapping[str, Any], ranges: Float64[np.ndarray, "k 2"], names: Sequence[str], generator: np.random.Generator
) -> Vector:
    """Coordinates and rates at the start of an episode: drawn uniformly, but for those that are given.

    Args:
        options: What is given, by name.
        ranges: Lowest and highest value of each coordinate, then of each rate.
        names: Names of the coordinates and of the rates.
        generator: Source of the others.

    Returns:
        Coordinates, then rates.

    Raises:
        ValueError: If an option has another name, or does not fit.
    """
    unknown = [name for name in options if name not in names]
    if unknown:
        raise ValueError(f"`options` may name {' and '.join(map(repr, names))}; got {unknown[0]!r}.")
    drawn = np.split(generator.uniform(*ranges.T), 2)
    given = [
        vector(name, options[name], len(x)) if name in options else x for name, x in zip(names, drawn, strict=True)
    ]
    start = np.concatenate(given)
    if not np.isfinite(start).all():
        raise ValueError(f"An episode must start at finite numbers; got {dict(options)!r}.")
    return start
