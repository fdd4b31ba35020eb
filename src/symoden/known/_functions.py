"""Python functions as text that is the same in every process, which their `repr`, with an address in it, is not."""

import contextlib
import functools
import re
import types
from collections.abc import Sequence
from typing import Final

import numpy as np

_ADDRESS: Final = re.compile(r" at 0x[0-9a-fA-F]+")


def without_addresses(value: object) -> str:
    """What Python says of a value, without where it lies in memory.

    Args:
        value: Any value.

    Returns:
        Its `repr` without addresses.
    """
    return _ADDRESS.sub("", repr(value))


def code_of(value: object, above: tuple[object, ...] = ()) -> str:
    """What a function does, as far as that can be told: its code, and the values that it holds.

    What it looks up by name elsewhere does not count.

    Args:
        value: A function, or a value that one holds.
        above: Functions that hold it; one may hold itself.

    Returns:
        The text, which is the same in every process of a version of Python.
    """
    if any(value is each for each in above):
        return "itself"
    pieces = _pieces(value)
    if pieces is None:
        return without_addresses(value)
    return repr([code_of(each, (*above, value)) for each in pieces])


def _pieces(value: object) -> Sequence[object] | None:
    """What a value is made of, if it may hold functions or Python does not say all of it."""
    match value:
        case types.FunctionType():
            pieces = [value.__qualname__, value.__code__, value.__defaults__, value.__kwdefaults__, *_closure(value)]
        case types.CodeType():
            pieces = [value.co_code.hex(), value.co_names, *value.co_consts]
        case types.MethodType():
            pieces = [value.__func__, value.__self__]
        case functools.partial():
            pieces = [value.func, value.args, value.keywords]
        case np.ndarray():
            pieces = [str(value.dtype), value.shape, value.tobytes().hex()]
        case tuple() | list():
            pieces = list(value)
        case dict():
            pieces = list(value.items())
        case _:
            pieces = None
    return pieces


def _closure(function: types.FunctionType) -> list[object]:
    """Values of the variables around a function, those apart that have none yet."""
    held = []
    for cell in function.__closure__ or ():
        with contextlib.suppress(ValueError):
            held.append(cell.cell_contents)
    return held
