"""Columns that a description makes of others: a thrust of the square of a speed, an angle beside another one."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from symoden.data._errors import AbsentError, DataError, cut
from symoden.data.files import OddNumbers, Rows, Selector, Table, read_rows, variable_of
from symoden.known import Expression, Grammar

from ._impossible import odd_numbers

COLUMNS: Final = Grammar(more=("sign(x)", "min(a, b)", "max(a, b)", "clip(x, low, high)"), quotes=True)
"""What formulas of columns may contain: nobody differentiates them, and a file may name its columns as it likes."""
_NUMPY: Final[Mapping[str, Callable[..., np.ndarray]]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs")},
    **{f"a{name}": getattr(np, f"arc{name}") for name in ("sin", "cos", "tan")},
    "sign": np.sign,
    "min": np.minimum,
    "max": np.maximum,
    "clip": lambda x, low, high: np.where(low <= high, np.clip(x, low, high), np.nan),
}


def read_columns(
    path: Path,
    selectors: Mapping[str, Selector],
    rows: slice,
    *,
    recording: str | None,
    formulas: Mapping[str, Expression],
    table: Table | None = None,
) -> Rows:
    """Read columns of a file, and make those that are formulas of others.

    A formula takes the numbers as the file has them; where it has no finite value, a number is missing, and likewise
    where one of those is what no machine has, or a logger writes for a missing one.

    Args:
        path: File of a known format; of a table in memory, what messages call it.
        selectors: What to read, by role.
        rows: Rows to keep.
        recording: Column that tells recordings apart, if there is one.
        formulas: Formulas by the name of the column that they make.
        table: The table, where it is in memory.

    Returns:
        The numbers that were asked for.

    Raises:
        DataError: If the file cannot be read, lacks something, or has anything but numbers there.
    """
    listed = {role: _names(chosen) for role, chosen in selectors.items() if set(_names(chosen)) & set(formulas)}
    plain = {role: tuple(name for name in chosen if name not in formulas) for role, chosen in listed.items()}
    used = {name: formulas[name] for chosen in listed.values() for name in chosen if name in formulas}
    parts = {_parts(name): tuple(sorted(formula.names)) for name, formula in used.items()}
    try:
        found = read_rows(path, {**selectors, **plain, **parts}, rows, recording, table=table)
    except AbsentError as error:
        raise DataError(f"{error}{_of_formulas(error, used)}") from error
    raw = {
        part: column
        for role, chosen in parts.items()
        for part, column in zip(chosen, found.signals[role].T, strict=True)
    }
    timed = _names(selectors.get("time", ()))
    odd = _odd_parts(raw, {name: formula for name, formula in used.items() if name not in timed})
    possible = raw | {each.name: np.where(np.isfinite(each.values), np.nan, raw[each.name]) for each in odd}
    made = {name: _value(formula, possible) for name, formula in used.items()}
    signals = {role: found.signals[role] for role in selectors}
    for role, chosen in listed.items():
        columns = dict(zip(plain[role], found.signals[role].T, strict=True)) | made
        signals[role] = np.stack([columns[name] for name in chosen], axis=1)
    names = {role: listed.get(role, found.names[role]) for role in selectors}
    return dataclasses.replace(found, signals=signals, names=names, odd=odd)


def crosses_limits(formula: Expression) -> bool:
    """Whether a formula clips something between two numbers of which the lower one is said last.

    Args:
        formula: The formula.

    Returns:
        Whether it does.

    Example:
        >>> [crosses_limits(Expression(text, COLUMNS)) for text in ("2*clip(u, 3, -3)", "clip(u, 3, v)")]
        [True, False]
    """
    return any(low > high for low, high in _limits(formula.tree))


def _limits(tree: tuple[Any, ...]) -> Iterator[tuple[float, float]]:
    """Limits of all that is clipped between plain numbers."""
    match tree:
        case ("call", "clip", _, low, high):
            lower, upper = _number(low), _number(high)
            if lower is not None and upper is not None:
                yield lower, upper
    for inner in tree:
        if isinstance(inner, tuple):
            yield from _limits(inner)


def _number(tree: tuple[Any, ...]) -> float | None:
    """The number that a part of a formula is, if it is a plain one."""
    match tree:
        case ("number", value):
            return value
        case ("-", ("number", 0.0), ("number", value)):
            return -value
    return None


def _odd_parts(raw: Mapping[str, np.ndarray], formulas: Mapping[str, Expression]) -> tuple[OddNumbers, ...]:
    """Numbers that no machine has in columns that formulas are made of, whatever these make of them."""
    made = {part: tuple(name for name, formula in formulas.items() if part in formula.names) for part in raw}
    odd = (OddNumbers(part, made[part], odd_numbers(column, column)) for part, column in raw.items() if made[part])
    return tuple(each for each in odd if np.isfinite(each.values).any())


def _names(chosen: Selector) -> tuple[str, ...]:
    """Names of a selector."""
    return (chosen,) if isinstance(chosen, str) else chosen


def _parts(name: str) -> str:
    """Role of the columns that a formula is made of."""
    return f"parts of {name}"


def _of_formulas(error: AbsentError, formulas: Mapping[str, Expression]) -> str:
    """Which formula names what a file does not have, and the name in it that perhaps is to stand in backticks."""
    for made, formula in formulas.items():
        if error.name in {each for name in formula.names for each in (name, variable_of(name))}:
            text = "".join(formula.text.split())
            odd = [name for name in error.found if name not in formula.names and error.name in name]
            meant = max((name for name in odd if "".join(name.split()) in text), key=len, default="")
            quoted = f" Write `{meant}` in backticks there, if it is meant." if meant else ""
            return f" `formulas` of `{made}` names it: {cut(formula.text)!r}.{quoted}"
    return ""


def _value(formula: Expression, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The formula in each row."""
    with np.errstate(all="ignore"):
        value = formula.evaluate(columns, number=np.float64, functions=_NUMPY)
    return np.where(np.isfinite(value), value, np.nan)
