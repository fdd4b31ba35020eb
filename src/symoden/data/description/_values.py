"""Values of a description's keys, each of which must be fit by itself."""

import sys
from collections.abc import Callable, Set
from functools import partial
from typing import Any, Final, NamedTuple, NoReturn, TypeAlias

from symoden.data._errors import cut
from symoden.data.files import Selector, label
from symoden.known import Expression

from ._formulas import COLUMNS, crosses_limits
from ._units import factor_of

Check: TypeAlias = Callable[[object], object]


class VelocityEstimates(NamedTuple):
    """What is known of velocities that were estimated from the positions, as `Trajectory` has it.

    Attributes:
        noise_gain: Standard deviation of their noise over that of the positions' [1/s], for each coordinate.
        one_sided: Time at either end of a recording in which they had samples on one side alone [s].
    """

    noise_gain: tuple[float, ...]
    one_sided: float


PARTS: Final = ("train", "test", "validation")
"""Tables of a description that name files."""
_ENDS: Final = 2  # Of an interval.
_SEVERAL: Final = 2  # Files, at least, that are joined.


def _fail(what: str) -> NoReturn:
    """Say what a value must be."""
    raise ValueError(f"must be {what}")


def _text(value: object) -> str:
    """A name."""
    return value if isinstance(value, str) and value else _fail("a text")


def _texts(value: object, *, of: str = "column") -> tuple[str, ...]:
    """A list of names, at least one."""
    if value == []:
        raise ValueError(f"must name at least one {of}")
    if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
        _fail('a list of texts in brackets, such as ["a", "b"]')
    return tuple(value)


def _files(value: object) -> tuple[str | dict[str, str], ...]:
    """A list of names of files or of patterns, or of tables of them that are joined; at least one."""
    items = value if isinstance(value, list) else []
    joined = [dict(_joined(item)) for item in items if isinstance(item, dict)]
    if joined and len(joined) == len(items):
        return tuple(joined)
    if joined:
        _fail("a list of texts, or of tables of files that are joined; not of both, for their columns have other names")
    return _texts(value, of="file")


def _joined(value: dict[Any, Any]) -> dict[str, str]:
    """Names or patterns of files that are joined, by what they are called."""
    if len(value) < _SEVERAL or not all(isinstance(file, str) and file for file in value.values()):
        _fail('of two files or more that are joined, such as {q = "q_*.csv", tau = "tau_*.csv"}')
    if not all(name.isidentifier() for name in value):  # A point is between it and the name of a column.
        _fail("of files that are joined by names of letters, digits and underscores, such as q")
    return value


def _labels(value: object) -> tuple[str, ...]:
    """A list of numbers or texts, at least one, as texts."""
    if not isinstance(value, list) or not value or not all(isinstance(x, str) or _is_number(x) for x in value):
        _fail('a list of numbers or texts, such as [3, 7] or ["monday"]')
    return tuple(str(item) if isinstance(item, int) else label(item) for item in value)


def _selector(value: object) -> Selector:
    """A list of names, or the name of a 2-D variable."""
    names = value if isinstance(value, str) and value else _texts(value)
    if isinstance(names, tuple) and len(set(names)) < len(names):
        _fail("names that differ from each other")
    return names


def _inputs(value: object) -> Selector:
    """A list of names, which may be empty, or the name of a 2-D variable."""
    return () if value == [] else _selector(value)


def _is_number(value: object) -> bool:
    """Whether a value is a finite number; true and false are none, nor is an integer that no float can be."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _flag(value: object) -> bool:
    """True or false."""
    return value if isinstance(value, bool) else _fail("true or false")


def _positive(value: object) -> float:
    """A positive number of seconds."""
    if not isinstance(value, int | float) or not _is_number(value) or value <= 0:
        _fail("a positive number of seconds")
    return float(value)


def _count(value: object) -> int:
    """A whole number from 1 on."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        _fail("a whole number, at least 1")
    return value


def _hold(value: object) -> object:
    """A kind of hold."""
    return value if value in ("zero", "linear") else _fail('"zero" or "linear"')


def _units(value: object) -> dict[str, float]:
    """Factors by column."""
    if not isinstance(value, dict):
        _fail('a table of columns, such as {q = "deg", tau = 0.062}')
    factors = {}
    for column, unit in value.items():
        if isinstance(unit, dict):
            _fail(f'a table of columns; a name with dots stands in quotes, such as "{column}.{next(iter(unit), "x")}"')
        try:
            factors[column] = factor_of(unit)
        except ValueError as error:
            what, advice = error.args
            raise ValueError(f"of `{column}` {what}", unit, advice) from error
    return factors


def _formulas(value: object) -> dict[str, Expression]:
    """Formulas by the column that they make."""
    if not isinstance(value, dict) or not value:
        _fail('a table of names and formulas of columns, such as {thrust = "speed**2"}')
    made = {}
    for column, text in value.items():
        got = cut(text) if isinstance(text, str) else text
        try:
            made[column] = Expression(text if isinstance(text, str) else _fail("a text"), COLUMNS)
        except ValueError as error:
            raise ValueError(f"of `{column}` must be a formula of columns", got, f" {error}") from error
        unfit = _unfit(made[column], set(value))
        if unfit is not None:
            what, advice = unfit
            raise ValueError(f"of `{column}` must {what}", got, advice)
    return made


def _unfit(formula: Expression, made: Set[str]) -> tuple[str, str] | None:
    """What a formula must do that it does not, and what to do about it."""
    if not formula.names:
        return "name a column at least", ' One that has a number for its name stands in backticks, such as "`2`".'
    if own := sorted(formula.names & made):
        other = f" Call what is made otherwise than `{own[0]}`"
        odd = any(sign in formula.text for sign in "-/")
        quoted = '; a name with signs in it stands in backticks, such as "`u-cmd`"' if odd else ""
        return "name columns of the files, not what formulas make", f"{other}{quoted}."
    if crosses_limits(formula):
        return "clip between a lower number and a higher one", " Exchange them."
    return None


def _estimates(value: object) -> VelocityEstimates:
    """What is known of velocities that were estimated."""
    keys = set(VelocityEstimates._fields)
    gains = value.get("noise_gain") if isinstance(value, dict) and set(value) == keys else None
    if not isinstance(value, dict) or not isinstance(gains, list) or not gains:
        _fail("a table of both noise_gain and one_sided, such as {noise_gain = [17.5], one_sided = 0.02}")
    if not all(_is_number(gain) and gain > 0 for gain in gains):
        _fail("a table whose noise_gain is a list of positive numbers [1/s], one per position")
    if not _is_number(value["one_sided"]) or value["one_sided"] < 0:
        _fail("a table whose one_sided is a number of seconds, at least 0")
    return VelocityEstimates(tuple(map(float, gains)), float(value["one_sided"]))


def _zeros(value: object) -> dict[str, float]:
    """Numbers by column."""
    if not isinstance(value, dict) or not all(map(_is_number, value.values())):
        _fail("a table of columns and finite numbers, such as {q = 180.0, tau = 0.02}")
    return {column: float(number) for column, number in value.items()}


def _blind(value: object) -> dict[str, tuple[tuple[float, float], ...]]:
    """Intervals by column."""
    if not isinstance(value, dict) or not all(map(_are_intervals, value.values())):
        _fail("a table of columns and lists of intervals, from less to more, such as {q = [[0.9, 1.4]]}, or {q = []}")
    return {column: tuple((float(a), float(b)) for a, b in intervals) for column, intervals in value.items()}


def _are_intervals(value: object) -> bool:
    """Whether a value is a list of pairs of numbers, the second one the larger."""
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == _ENDS and all(map(_is_number, pair)) and pair[0] < pair[1]
        for pair in value
    )


def _delays(value: object) -> tuple[float, ...]:
    """Seconds, one number or several."""
    items = value if isinstance(value, list) else [value]
    seconds = [float(item) for item in items if isinstance(item, int | float) and _is_number(item)]
    if not seconds or len(seconds) != len(items):
        _fail("a number of seconds, or a list of one each; below zero where inputs act before their row")
    return tuple(seconds)


def _lags(value: object, *, hint: str = "") -> tuple[float, ...]:
    """Seconds from 0 on, one number or several."""
    seconds = _delays(value) if isinstance(value, list | int | float) else ()
    if not seconds or min(seconds) < 0:
        _fail(f"a number of seconds, at least 0, or a list of one each{hint}")
    return seconds


def _matrix(value: object) -> tuple[tuple[float, ...], ...]:
    """Rows of numbers, all of one length."""
    rows = value if isinstance(value, list) else []
    if not rows or not all(isinstance(row, list) and row and all(map(_is_number, row)) for row in rows):
        _fail("a list of rows of numbers, such as [[1, 0], [0, 1]]; formulas stand under [known]")
    if len({len(row) for row in rows}) > 1:
        _fail("rows of equal length")
    return tuple(tuple(float(item) for item in row) for row in rows)


def _rows(value: object) -> dict[str, tuple[tuple[int, int | None], ...]]:
    """Intervals of rows by names of files; those of all files without."""
    if isinstance(value, dict):
        return {str(name): _intervals_of_rows(each) for name, each in value.items()}
    return {"*": _intervals_of_rows(value)}


def _intervals_of_rows(value: object) -> tuple[tuple[int, int | None], ...]:
    """Of one interval of rows or more the first row, and the row after the last one or nothing."""
    items = value if isinstance(value, list) else []
    several = bool(items) and all(isinstance(item, list) for item in items)
    return tuple(map(_interval_of_rows, items if several else [value]))


def _interval_of_rows(value: object) -> tuple[int, int | None]:
    """First row, and the row after the last one or nothing."""
    numbers = value if isinstance(value, list) else []
    if len(numbers) not in (1, 2) or not all(isinstance(item, int) and not isinstance(item, bool) for item in numbers):
        _fail(
            "[start, stop), two whole numbers, or [start] for all rows from there on, or a list of these, or a table "
            "of these by file"
        )
    return numbers[0], numbers[1] if len(numbers) > 1 else None


PART_KEYS: Final[dict[str, Check]] = {
    "files": _files,
    "rows": _rows,
    "recordings": _labels,
    "split_every": _positive,
}
KEYS: Final[dict[str, Check]] = {
    "space": _text,
    "time": _text,
    "dt": _positive,
    "recording": _text,
    "positions": _selector,
    "velocities": _selector,
    "trust_velocities": _flag,
    "estimated_velocities": _estimates,
    "momenta": _selector,
    "inputs": _inputs,
    "formulas": _formulas,
    "units": _units,
    "zeros": _zeros,
    "blind": _blind,
    "hold": _hold,
    "input_delay": _delays,
    "input_lag": _lags,
    "position_delay": partial(_lags, hint="; where inputs are late: `input_delay` below zero"),
    "resample": _positive,
    "input_matrix": _matrix,
    "initial_samples": _count,
}


def misplaced(key: str) -> str:
    """What to say of a key that stands in a table and belongs above all of them.

    Args:
        key: The key.

    Returns:
        The words; none of any other key.
    """
    return f" `{key}` is a key of the whole description: it must stand above all tables. Move it there." * (key in KEYS)
