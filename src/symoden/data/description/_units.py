"""Units that a description may name, as factors to SI and rad."""

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, TypeVar

import numpy as np

from symoden.data._errors import DataError, listing, nearest
from symoden.data.files import Rows, Selector, names_in, variable_of
from symoden.wording import quoted

T = TypeVar("T")

_BY_SI: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "rad": {"rad": 1.0, "deg": math.pi / 180, "rev": 2 * math.pi},
        "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180, "rev/s": 2 * math.pi, "rpm": 2 * math.pi / 60},
        "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
        "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
        "N": {"N": 1.0, "kN": 1e3},
        "N m": {"Nm": 1.0, "Ncm": 1e-2, "mNm": 1e-3},
        "A": {"A": 1.0, "mA": 1e-3},
        "V": {"V": 1.0, "mV": 1e-3},
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    }
)
UNITS: Final[Mapping[str, float]] = MappingProxyType(
    {unit: factor for units in _BY_SI.values() for unit, factor in units.items()}
)

_BRACKETS: Final = re.compile(r"\s*(?P<name>.*\S)\s*(?:\[(?P<square>[^\[\]]+)\]|\((?P<round>[^()]+)\))\s*")

_ENDINGS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "deg": "deg",
        "degree": "deg",
        "degrees": "deg",
        "mm": "mm",
        "rpm": "rpm",
        "deg_s": "deg/s",
        "deg_per_s": "deg/s",
        "dps": "deg/s",
        "mm_s": "mm/s",
    }
)
_ENDING: Final = re.compile(rf"(?P<name>.*[^_])_(?P<unit>{'|'.join(_ENDINGS)})")


def factor_of(unit: object) -> float:
    """Factor that brings numbers in a unit to SI or rad.

    Args:
        unit: Name of a unit, or the factor itself, which may be negative: it turns a direction round.

    Returns:
        The factor.

    Raises:
        ValueError: If it is neither; with what it must be, after the name of a column, and what to do.
    """
    if isinstance(unit, str):
        plain = _plain(unit)
        if plain not in UNITS:
            known = "; ".join(", ".join(units) for units in _BY_SI.values())
            raise ValueError(
                f"must be a factor or one of the units `{known}`",
                f"{nearest(unit, UNITS)} For another unit write the factor to SI, such as 0.0254 for inches. What an "
                "input in percent or counts does is learned, or told by `input_matrix`.",
            )
        return UNITS[plain]
    if isinstance(unit, int | float) and not isinstance(unit, bool) and math.isfinite(unit) and unit != 0:
        return float(unit)
    raise ValueError("must be the name of a unit, or a factor: a finite number other than 0", "")


def si_of(unit: object) -> str | None:
    """SI unit, or rad, that a unit is brought to.

    Args:
        unit: Name of a unit that `factor_of` takes, or a factor.

    Returns:
        Its name; None of a factor, which says nothing of it.

    Example:
        >>> si_of("mm"), si_of(0.001)
        ('m', None)
    """
    if not isinstance(unit, str):
        return None
    return next(si for si, units in _BY_SI.items() if _plain(unit) in units)


def unit_of(word: str) -> str:
    """The unit that a word is.

    Args:
        word: Whatever stands where a unit may.

    Returns:
        The unit as `factor_of` takes it; nothing where it is none.

    Example:
        >>> unit_of("[deg]"), unit_of("°/s"), unit_of("-")
        ('deg', 'deg/s', '')
    """
    unit = _plain(word.strip().strip("[]()"))
    return unit if unit in UNITS else ""


def split_unit(name: str) -> tuple[str, str]:
    """Take the unit off a column's name that has one in brackets, or a common one as its ending.

    Args:
        name: Name of a column.

    Returns:
        The name without it, and the unit as `factor_of` takes it; the name as it is and nothing where it has none.

    Example:
        >>> split_unit("pos [mm]"), split_unit("theta(°)"), split_unit("q[0]"), split_unit("theta_deg")
        (('pos', 'mm'), ('theta', 'deg'), ('q[0]', ''), ('theta', 'deg'))
    """
    if ended := _ENDING.fullmatch(name):
        return ended["name"], _ENDINGS[ended["unit"]]
    found = _BRACKETS.fullmatch(name)
    if found is None or (unit := _plain(found["square"] or found["round"])) not in UNITS:
        return name, ""
    return found["name"], unit


def unit_said(name: str, below: Mapping[str, str]) -> str:
    """The unit that a column's name says, or else a line under the names.

    Args:
        name: Name of the column.
        below: What such a line says of columns, as it is written.

    Returns:
        The unit as `factor_of` takes it; nothing where neither says one.

    Example:
        >>> unit_said("pos [mm]", {}), unit_said("theta", {"theta": "[deg]"}), unit_said("u", {"u": "-"})
        ('mm', 'deg', '')
    """
    return split_unit(name)[1] or unit_of(below.get(name, ""))


def units_of(si: Iterable[str]) -> list[str]:
    """Units that are brought to one of some SI units, or rad.

    Args:
        si: The SI units.

    Returns:
        Their names.

    Example:
        >>> units_of(["m", "s"])
        ['m', 'cm', 'mm', 's', 'ms', 'us', 'ns']
    """
    return [unit for each in si for unit in _BY_SI[each]]


def _plain(unit: str) -> str:
    """Name of a unit as the table has it."""
    return unit.replace(" ", "").replace("·", "").replace("*", "").replace("°", "deg").replace("µ", "u")


def entry(columns: Mapping[str, str | float], given: Mapping[str, float]) -> str:
    """Words for what to write so that columns get units, which change those that they may have already.

    Args:
        columns: Unit or factor by column.
        given: Factors that `units` of the description has.

    Returns:
        What to write, and where.

    Example:
        >>> entry({"q": "deg"}, {}), entry({"q": "deg"}, {"v": 2.0})
        ('`units = {q = "deg"}` into the description', '`q = "deg"` into `units`')
        >>> entry({"v": -1.0}, {"v": 2.0})
        '`v = -2` into `units` (for what it says of `v` now)'
    """
    units = {name: unit if name not in given else given[name] * factor_of(unit) for name, unit in columns.items()}
    values = {name: f'"{unit}"' if isinstance(unit, str) else f"{unit:.6g}" for name, unit in units.items()}
    keys = ", ".join(f"{key(name)} = {value}" for name, value in values.items())
    if not given:
        return f"`units = {{{keys}}}` into the description"
    changed = [name for name in columns if name in given]  # A key of TOML stands once.
    return f"`{keys}` into `units`" + (f" (for what it says of {listing(changed)} now)" if changed else "")


def key(name: str) -> str:
    """The name as a key of TOML.

    Args:
        name: Name of a column.

    Returns:
        It, in quotes where TOML wants them.

    Example:
        >>> key("q1"), key("pos [mm]")
        ('q1', '"pos [mm]"')
    """
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else quoted(name)


def is_named(column: str, selectors: Mapping[str, Selector]) -> bool:
    """Whether a key of `units` or `zeros` stands for something that is read.

    Args:
        column: The key: a column, a variable, or `variable[column]`.
        selectors: What is read, by role.

    Returns:
        Whether it does.
    """
    names = names_in(selectors)
    return column in names or variable_of(column) in names or column in {variable_of(name) for name in names}


def in_si(rows: Rows, units: Mapping[str, float], zeros: Mapping[str, float]) -> Rows:
    """Subtract from what was read what its columns show at zero, and multiply it by their factors.

    Args:
        rows: Rows as they are in the file.
        units: Factors by the name of a column, or by the name of a variable for all its columns; a column's own wins.
        zeros: What columns show at zero, likewise.

    Returns:
        The rows in SI and rad.

    Raises:
        DataError: If a column is named that its variable does not have.
    """
    if not units and not zeros:
        return rows
    _refuse_absent(rows, "units", units)
    _refuse_absent(rows, "zeros", zeros)
    with np.errstate(over="ignore"):  # What becomes infinite is no number of a machine, and is left out as such.
        signals = {
            role: (signal - _each(rows.names[role], zeros, 0.0)) * _each(rows.names[role], units, 1.0)
            for role, signal in rows.signals.items()
        }
    return dataclasses.replace(rows, signals=signals)


def of_column(name: str, units: Mapping[str, T]) -> T | None:
    """What a table of the description says of a column: its own entry, or that of its variable.

    Args:
        name: The column.
        units: Anything by the name of a column or variable.

    Returns:
        The entry; None if there is none.

    Example:
        >>> of_column("q[1]", {"q": 0.1}), of_column("q", {"q[0]": 0.1}), of_column("q", {"v": 0.1})
        (0.1, 0.1, None)
    """
    only = f"{name}[0]"  # Of a variable of one column.
    return units.get(name, units.get(variable_of(name), units.get(only)))


def number_of(name: str, given: Mapping[str, float], default: float) -> float:
    """Number that a table of the description gives a column.

    Args:
        name: The column.
        given: Numbers by the name of a column or variable.
        default: Of a column that has none there.

    Returns:
        The number.
    """
    number = of_column(name, given)
    return default if number is None else number


def _refuse_absent(rows: Rows, key: str, given: Iterable[str]) -> None:
    """Refuse to say something of columns that a variable does not have, as of `q[2]` where `q` has two."""
    names = [name for every in rows.names.values() for name in every]
    for column in given:
        if not any(of_column(name, {column: True}) for name in names):
            raise DataError(
                f"`{rows.path}`: `{key}` must name columns that are read, {listing(names)}; got `{column}`. "
                "Columns are counted from 0."
            )


def _each(names: tuple[str, ...], given: Mapping[str, float], default: float) -> np.ndarray:
    """Number of each column."""
    return np.array([number_of(name, given, default) for name in names])
