"""Parts of a mechanism that are given: formulas, numbers or functions for M, V, g and D."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import numpy as np

from ._expressions import Expression
from ._functions import code_of, without_addresses
from ._grammar import FUNCTIONS
from ._robot import Robot

PARTS: Final = ("mass_matrix", "potential_energy", "input_matrix", "dissipation_matrix")
"""Parts of a mechanism that may be given as formulas."""

Entry: TypeAlias = str | float | int
Scalar: TypeAlias = Entry | Callable[..., Any]
Matrix: TypeAlias = Sequence[Sequence[Entry]] | np.ndarray | Callable[..., Any]

_OF_ROBOTS: Final = ("mass_matrix", "potential_energy")
_COORDINATE: Final = re.compile(r"q[1-9][0-9]?")
_VELOCITY: Final = re.compile(r"v[1-9][0-9]?")


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownParts:
    """What is known of a mechanism; the rest is learned.

    A part is a matrix of numbers and formulas, row by row (the potential energy is one formula), or a Python function
    of q, for the dissipation matrix of (q, v). In formulas, `q1`, `q2`, … are the coordinates [m or rad], `v1`, `v2`, …
    the velocities (in the dissipation matrix alone), and other names are constants or parameters. A model with
    formulas can be saved; one with Python functions cannot, since model files hold no code. Numbers that a function
    holds, such as the arrays of an Equinox module, stay as they are: what is learned of a part are the `parameters` of
    its formulas, and what `correct` adds.

    Attributes:
        mass_matrix: M(q), symmetric positive definite.
        potential_energy: V(q) [J].
        input_matrix: g(q), coordinates × inputs.
        dissipation_matrix: D(q, v), symmetric positive semidefinite, the friction force being D v.
        robot: Rigid bodies on joints, which give M(q) and V(q) up to what the bodies weigh; see `read_urdf`.
        constants: Values of names that stay as they are.
        parameters: Start values of names that are learned. A parameter keeps the sign of its start value, so that a
            mass stays a mass; one that starts at 0 may take any sign.
        correct: Names of the parts that are only nearly right: a network corrects them, zero at the start and frozen
            until validation data ask for it. It adds to V and g, and multiplies M and D from both sides.
        cyclic: Names of the coordinates, such as "q1", that neither M, V, g nor D depend on, as they do not depend on
            the angle about an upright axis: what is learned is a function of the others alone.

    Raises:
        ValueError: If a part is no matrix of formulas, a name is unknown, unused or taken, or a value is no number.

    Example:
        >>> known = KnownParts(
        ...     mass_matrix=[["m*l**2"]],
        ...     potential_energy="-m*9.81*l*cos(q1)",
        ...     constants={"l": 0.5},
        ...     parameters={"m": 1.0},
        ... )
        >>> known.given
        ('mass_matrix', 'potential_energy')
    """

    mass_matrix: Matrix | None = None
    potential_energy: Scalar | None = None
    input_matrix: Matrix | None = None
    dissipation_matrix: Matrix | None = None
    robot: Robot | None = None
    constants: Mapping[str, float | int] = field(default_factory=dict)
    parameters: Mapping[str, float | int] = field(default_factory=dict)
    correct: tuple[str, ...] = ()
    cyclic: tuple[str, ...] = field(default=(), repr=False)  # Fingerprints without any stay what they were.

    def __post_init__(self) -> None:
        """Bring every formula into one form, and refuse what cannot be meant."""
        for name in PARTS:
            part = getattr(self, name)
            if part is not None and self.robot is not None and name in _OF_ROBOTS:
                raise ValueError(f"`{name}` must be given once; a robot gives it too. Remove one of them.")
            if part is not None and not callable(part):
                rows = (
                    _text(part, name)
                    if name == "potential_energy"
                    else tuple(tuple(_text(entry, name) for entry in row) for row in _rows(part, name))
                )
                object.__setattr__(self, name, rows)
        _refuse_values(self)
        for table in ("constants", "parameters"):
            values = {name: float(value) for name, value in getattr(self, table).items()}
            object.__setattr__(self, table, values)
        _refuse_names(self)
        for listed in ("correct", "cyclic"):
            if isinstance(told := getattr(self, listed), str):
                raise ValueError(f'`{listed}` must be a list of names; got the text {told!r}. Write ["{told}"].')
        for name in self.correct:
            if name not in self.given:
                raise ValueError(
                    f"`correct` must name parts that are given, of {', '.join(self.given) or 'which there are none'}; "
                    f"got `{name}`. Give it, or leave it to be learned."
                )
        _refuse_cyclic(self)

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the parts that are given."""
        by_robot = () if self.robot is None else _OF_ROBOTS
        return tuple(name for name in PARTS if getattr(self, name) is not None or name in by_robot)

    @property
    def fixed(self) -> tuple[str, ...]:
        """Names of the parts of which nothing is learned."""
        learned = {*self.correct, *(() if self.robot is None else _OF_ROBOTS)}
        learned |= {part for part, name in _used_names(self) if name in self.parameters}
        return tuple(name for name in self.given if name not in learned)

    @property
    def fingerprint(self) -> str:
        """Text that tells these parts from others, and is the same in every process, also where parts are functions."""
        functions = [part for part in (getattr(self, name) for name in PARTS) if callable(part)]
        told = "".join([without_addresses(self), *map(code_of, functions)]) if functions else repr(self)
        return f"{told} cyclic: {', '.join(self.cyclic)}" if self.cyclic else told

    def formulas(self, name: str) -> tuple[str, ...] | None:
        """Formulas of a part, row by row; None where it is a Python function, a robot's or not given.

        Args:
            name: One of `PARTS`.

        Returns:
            The formulas.
        """
        part = getattr(self, name)
        if part is None or callable(part):
            return None
        return (part,) if isinstance(part, str) else tuple(entry for row in part for entry in row)


def _rows(part: Matrix, name: str) -> list[list[Entry]]:
    """Rows of a matrix, all of one length."""
    rows = part.tolist() if isinstance(part, np.ndarray) else part
    if isinstance(rows, str) or not isinstance(rows, Sequence) or not rows:
        raise ValueError(f"`{name}` must be a list of rows, such as [[1, 0], [0, 1]]; got {part!r}.")
    if any(isinstance(row, str) or not isinstance(row, Sequence) for row in rows):
        raise ValueError(f"`{name}` must be a list of rows, such as [[1, 0], [0, 1]]; got {part!r}.")
    if len({len(row) for row in rows}) > 1:
        raise ValueError(f"`{name}` must have rows of equal length; got {[len(row) for row in rows]}.")
    return [list(row) for row in rows]


def _text(entry: object, name: str) -> str:
    """A formula, which may be a number."""
    if isinstance(entry, str):
        try:
            Expression(entry)
        except ValueError as error:
            raise ValueError(f"`{name}`: {error}") from None
        return entry
    if isinstance(entry, int | float) and not isinstance(entry, bool) and math.isfinite(entry):
        return repr(float(entry))
    raise ValueError(f"`{name}`: an entry must be a formula (a text) or a finite number; got {entry!r}.")


def _refuse_values(known: KnownParts) -> None:
    """Refuse constants and parameters whose names or values are unfit."""
    for table in ("constants", "parameters"):
        for name, value in getattr(known, table).items():
            if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
                raise ValueError(f"`{table}`: `{name}` must be a finite number; got {value!r}.")
            taken = name in FUNCTIONS or name == "pi" or _COORDINATE.fullmatch(name) or _VELOCITY.fullmatch(name)
            if taken or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
                raise ValueError(
                    f"`{table}`: `{name}` must be a name of letters, digits and _ that means nothing else (q1 and v1 "
                    "are coordinates and velocities). Choose another name."
                )
    for name in known.parameters:
        if name in known.constants:
            raise ValueError(f"`{name}` must be a constant or a parameter; got both. Remove one of them.")


def _refuse_names(known: KnownParts) -> None:
    """Refuse names without a meaning, and parameters that stand nowhere."""
    used: set[str] = set()
    for part, name in _used_names(known):
        used.add(name)
        moves = _COORDINATE.fullmatch(name) or (part == "dissipation_matrix" and _VELOCITY.fullmatch(name))
        if not moves and name not in known.constants and name not in known.parameters:
            velocity = "a velocity v1, v2, …, " if part == "dissipation_matrix" else ""
            hint = "velocities stand in the dissipation matrix alone" if _VELOCITY.fullmatch(name) else "give its value"
            raise ValueError(
                f"`{part}`: every name must be a coordinate q1, q2, …, {velocity}a constant or a parameter; got "
                f"`{name}`: {hint}."
            )
    for name in known.parameters:
        if name not in used:
            raise ValueError(f"`parameters`: `{name}` must stand in a formula; it stands in none. Remove it.")


def _refuse_cyclic(known: KnownParts) -> None:
    """Refuse cyclic coordinates that are none, or that a formula has."""
    for name in known.cyclic:
        if not _COORDINATE.fullmatch(name):
            raise ValueError(
                "`cyclic` must name coordinates by their number, q1, q2, …, or in a description by their column; got "
                f"`{name}`."
            )
        part = next((part for part, used in _used_names(known) if used == name), None)
        if part is not None:
            raise ValueError(
                f"`cyclic` must name coordinates that no formula depends on; `{name}` stands in `{part}`. Remove it "
                "from one of them."
            )


def _used_names(known: KnownParts) -> Iterator[tuple[str, str]]:
    """Every name in a formula, with the name of its part."""
    for part in known.given:
        for text in known.formulas(part) or ():
            for name in sorted(Expression(text).names):
                yield part, name
