"""Columns that a description makes of others: a thrust of the square of a speed, an angle beside another one."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from symoden.known import Expression

from ._readers import Rows, Selector, read_rows

_NUMPY: Final[Mapping[str, Callable[[np.ndarray], np.ndarray]]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs")},
    **{f"a{name}": getattr(np, f"arc{name}") for name in ("sin", "cos", "tan")},
}


def read_columns(
    path: Path,
    selectors: Mapping[str, Selector],
    rows: slice,
    *,
    recording: str | None,
    formulas: Mapping[str, Expression],
) -> Rows:
    """Read columns of a file, and make those that are formulas of others.

    A formula takes the numbers as the file has them; where it has no finite value, a number is missing.

    Args:
        path: File of a known format.
        selectors: What to read, by role.
        rows: Rows to keep.
        recording: Column that tells recordings apart, if there is one.
        formulas: Formulas by the name of the column that they make.

    Returns:
        The numbers that were asked for.

    Raises:
        DataError: If the file cannot be read, lacks something, or has anything but numbers there.
    """
    listed = {role: _names(chosen) for role, chosen in selectors.items() if set(_names(chosen)) & set(formulas)}
    plain = {role: tuple(name for name in chosen if name not in formulas) for role, chosen in listed.items()}
    used = {name: formulas[name] for chosen in listed.values() for name in chosen if name in formulas}
    parts = {_parts(name): tuple(sorted(formula.names)) for name, formula in used.items()}
    found = read_rows(path, {**selectors, **plain, **parts}, rows, recording)
    made = {
        name: _value(formula, dict(zip(parts[_parts(name)], found.signals[_parts(name)].T, strict=True)))
        for name, formula in used.items()
    }
    signals = {role: found.signals[role] for role in selectors}
    for role, chosen in listed.items():
        columns = dict(zip(plain[role], found.signals[role].T, strict=True)) | made
        signals[role] = np.stack([columns[name] for name in chosen], axis=1)
    names = {role: listed.get(role, found.names[role]) for role in selectors}
    return dataclasses.replace(found, signals=signals, names=names)


def _names(chosen: Selector) -> tuple[str, ...]:
    """Names of a selector."""
    return (chosen,) if isinstance(chosen, str) else chosen


def _parts(name: str) -> str:
    """Role of the columns that a formula is made of."""
    return f"parts of {name}"


def _value(formula: Expression, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The formula in each row."""
    with np.errstate(all="ignore"):
        value = formula.evaluate(columns, number=np.float64, functions=_NUMPY)
    return np.where(np.isfinite(value), value, np.nan)
