"""Units that follow from those of the coordinates: an angle's rad, a length's m, or none ("") where nothing tells."""

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from types import MappingProxyType
from typing import Final, Literal, TypeAlias

Quantity: TypeAlias = Literal["position", "velocity", "momentum", "force", "inertia", "friction"]
"""What may have a unit: "force" acts on a coordinate, "inertia" is an entry of M, "friction" one of D."""

_BY_ANGLES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "position": ("m", "rad"),
        "velocity": ("m/s", "rad/s"),
        "momentum": ("kg m/s", "kg m²/s"),
        "force": ("N", "N m"),
        "inertia": ("kg", "kg m", "kg m²"),
        "friction": ("N s/m", "N s", "N m s"),
    }
)


def unit_of(quantity: Quantity, *coordinates: str) -> str:
    """SI unit of a quantity, where energy is in J and time in s.

    Args:
        quantity: What it is.
        *coordinates: Unit of the coordinate that it is of, of both for an entry of a matrix. One of which nothing is
            known counts as a length.

    Returns:
        The unit.

    Example:
        >>> unit_of("force", "rad"), unit_of("inertia", "m", "rad"), unit_of("friction", "", "")
        ('N m', 'kg m', 'N s/m')
    """
    return _BY_ANGLES[quantity][coordinates.count("rad")]


def units_of_entries(quantity: Literal["inertia", "friction"], coordinates: Sequence[str]) -> tuple[str, ...]:
    """SI units of the entries of M or D.

    Args:
        quantity: Which of both.
        coordinates: Unit of each coordinate.

    Returns:
        The units, each once: those of lengths, of a length and an angle, of angles.

    Example:
        >>> units_of_entries("inertia", ("rad", "m")), units_of_entries("friction", ("rad", "rad"))
        (('kg', 'kg m', 'kg m²'), ('N m s',))
    """
    pairs = combinations_with_replacement(sorted(coordinates, key="rad".__eq__), 2)
    return tuple(dict.fromkeys(unit_of(quantity, *pair) for pair in pairs))


def titled(name: str, coordinate: str, quantity: Quantity = "position") -> str:
    """Name for a reader, with its unit where that is known.

    Args:
        name: Name of a coordinate, or of what is `quantity` of it.
        coordinate: Unit of the coordinate.
        quantity: What the name is of.

    Returns:
        The name.

    Example:
        >>> titled("theta", "rad"), titled("v", "m", "velocity"), titled("x", "")
        ('theta [rad]', 'v [m/s]', 'x')
    """
    return f"{name} [{unit_of(quantity, coordinate)}]" if coordinate else name


def position_units(is_angle: Sequence[bool], told: Sequence[str] = ()) -> tuple[str, ...]:
    """What each coordinate is measured in, as far as its space or somebody tells.

    Args:
        is_angle: For each coordinate, whether it is an angle that repeats after a turn.
        told: "rad", "m" or "" of each coordinate; nothing is told if empty.

    Returns:
        "rad" of all that repeat; of others what is told, "" where nothing is.

    Raises:
        ValueError: If that is no unit of each coordinate.

    Example:
        >>> position_units((False, True)), position_units((False, True), ("rad", ""))
        (('', 'rad'), ('rad', 'rad'))
    """
    given = tuple(told) or ("",) * len(is_angle)
    fitting = [("", "rad") if angle else ("", "rad", "m") for angle in is_angle]
    if len(given) != len(fitting) or any(unit not in units for unit, units in zip(given, fitting, strict=True)):
        raise ValueError(
            f'`position_units` must be "rad", "m" or "" (not known) for each of {len(is_angle)} coordinates, and not '
            f'"m" of an angle on T; got {told!r}.'
        )
    return tuple("rad" if angle else unit for unit, angle in zip(given, is_angle, strict=True))
