"""Reading MATLAB files of version 5, as `save` writes them by default.

SciPy's reader ends the whole process on some damaged files; this one only knows arrays of real numbers and structs of
these, and checks every length before it reads.
"""

import itertools
import math
import re
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from symoden.data._errors import AbsentError, DataError, listing

from ._limits import LARGEST, refuse_large

_HEADER = 128  # bytes of text, version and byte order
_MATRIX, _COMPRESSED = 14, 15
_START = 512  # bytes of a compressed variable that hold its sizes and its name
_COMPLEX = 0x800
_NUMBERS: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES: Final = {1: "a cell", 2: "a struct", 3: "an object", 4: "text", 5: "a sparse matrix", 16: "a function"} | {
    17: "an object, such as a `timeseries`: save its numbers (`ts.Time`, `ts.Data`)"
}
_STRUCT, _OPAQUE = 2, 17
_REAL_CLASSES = range(6, 16)
_STEP: Final = re.compile(r"(?P<name>\w+)(\((?P<number>\d+)\))?")  # On the way through structs.
_DEPTH = 4  # Of structs in structs whose fields messages list.
_LISTED = 8  # Elements of an array of structs whose fields they list.
_MOST_FIELDS = 100_000  # Of an array of structs: each takes 40 times as much memory as in the file.


def read_mat5(path: Path, names: Collection[str]) -> Mapping[str, np.ndarray]:
    """Read variables of a MATLAB file of version 5.

    Args:
        path: File.
        names: The variables; fields of structs as MATLAB writes them, `log.signals(2).values`.

    Returns:
        The variables by name.

    Raises:
        DataError: If a variable is absent, too large or not numeric.
        ValueError: If the file is broken.

    References:
        The MathWorks, *MAT-File Format*, "Level 5 MAT-Files".
    """
    refuse_large(path, path.stat().st_size, "the file")
    contents = memoryview(path.read_bytes())
    order = {b"IM": "<", b"MI": ">"}.get(bytes(contents[_HEADER - 2 : _HEADER]))
    if order is None:
        raise ValueError("the header is none of version 5 or 7.3")
    wanted = {re.split(r"[.(]", name)[0] for name in names}
    found: dict[str, memoryview] = {}
    for kind, body in _elements(contents[_HEADER:], order):
        name = _name(_matrix(kind, body, order, _START), order)
        if name:
            found[name] = _matrix(kind, body, order, LARGEST) if name in wanted else body[:0]
    return {name: _array(path, name, _inside(path, name, found, order), order) for name in names}


def _inside(path: Path, name: str, found: Mapping[str, memoryview], order: str) -> memoryview:
    """What a name leads to, through structs if it has points."""
    at, steps = found, name.split(".")
    for k, each in enumerate(steps, start=1):
        step = _STEP.fullmatch(each)
        if step is None or step["name"] not in at:
            raise AbsentError(path, name, _leaves(found, order), kind="variable")
        body, sofar = at[step["name"]], ".".join([*steps[: k - 1], step["name"]])
        parts = _structs(body, order)
        if k == len(steps) and step["number"] is None and not parts:
            return body
        number = int(step["number"] or 1)
        if not parts:
            raise DataError(f"`{path}`: `{name}` leads nowhere: `{sofar}` is no struct that has fields.")
        if not 0 < number <= len(parts) or (step["number"] is None and len(parts) > 1):
            every = listing(_leaves({sofar: body}, order))
            raise DataError(
                f"`{path}`: `{name}` leads nowhere: `{sofar}` is an array of {len(parts)} structs. It holds {every}."
            )
        at = parts[number - 1]
    every = listing(f"{name}.{field}" for field in _leaves(at, order))
    raise DataError(f"`{path}`: variable `{name}` must hold real numbers; got a struct that holds {every}. Name one.")


def _class(matrix: memoryview, order: str) -> int:
    """What a variable is: 2 for a struct, 6 and more for numbers; 0 where nothing of it was read."""
    first = next(_elements(matrix, order, complete=False), None)
    return struct.unpack_from(f"{order}I", first[1])[0] & 0xFF if first else 0


def _structs(matrix: memoryview, order: str) -> list[dict[str, memoryview]]:
    """Fields of every element of an array of structs; none of anything else."""
    if _class(matrix, order) != _STRUCT:
        return []
    elements = _elements(matrix, order)
    _, (_, shape), _, (_, length), (_, text) = itertools.islice(elements, 5)
    size, count = struct.unpack_from(f"{order}i", length)[0], math.prod(np.frombuffer(shape, f"{order}i4").tolist())
    if size <= 0 or count < 0 or len(text) % size or count * (len(text) // size) > _MOST_FIELDS:
        raise ValueError(f"a struct has broken fields, or more than {_MOST_FIELDS}")
    values = list(itertools.islice(elements, count * (len(text) // size) + 1))
    if any(kind != _MATRIX for kind, _ in values):
        raise ValueError("the fields of a struct are broken")
    names = [bytes(text[i : i + size]).partition(b"\0")[0].decode("latin1") for i in range(0, len(text), size)]
    if len(values) != count * len(names):
        raise ValueError(f"a struct of {count} times {len(names)} fields has {len(values)}")
    bodies = iter([body for _, body in values])
    return [dict(zip(names, bodies, strict=False)) for _ in range(count if names else 0)]


def _leaves(found: Mapping[str, memoryview], order: str, depth: int = _DEPTH) -> list[str]:
    """Names of everything that is no struct, and of structs that are too deep."""
    names: list[str] = []
    for name, body in found.items():
        parts = _structs(body, order) if depth else []
        if not parts:
            names.append(name)
        for k, part in enumerate(parts[:_LISTED], start=1):
            before = name if len(parts) == 1 else f"{name}({k})"
            names.extend(f"{before}.{field}" for field in _leaves(part, order, depth - 1))
    return names


def _elements(contents: memoryview, order: str, *, complete: bool = True) -> Iterator[tuple[int, memoryview]]:
    """Kind and contents of elements that follow each other; the last one may be cut short on request."""
    position = 0
    while position + 8 <= len(contents):
        kind, size = struct.unpack_from(f"{order}II", contents, position)
        start = position + 8
        if kind >> 16:  # The small form: size, kind and up to 4 bytes of contents in 8 bytes.
            kind, size, start = kind & 0xFFFF, kind >> 16, position + 4
        if (complete and start + size > len(contents)) or (start == position + 4 and size > 4):
            raise ValueError(f"an element of {size} bytes is cut short")
        yield kind, contents[start : start + size]
        position = start + size
        if kind != _COMPRESSED:
            position += -position % 8


def _matrix(kind: int, body: memoryview, order: str, most: int) -> memoryview:
    """Contents of a variable, decompressed as far as wanted."""
    if kind == _COMPRESSED:
        unpacked = memoryview(zlib.decompressobj().decompress(body, most))
        if len(unpacked) < 8:
            raise ValueError("a compressed variable is cut short")
        kind, body = next(_elements(unpacked, order, complete=most == LARGEST))
    if kind != _MATRIX:
        raise ValueError(f"an element is of kind {kind} where a variable is due")
    return body


def _name(matrix: memoryview, order: str) -> str:
    """Name of a variable: its third element, and an object's second one."""
    elements = [body for _, body in itertools.islice(_elements(matrix, order, complete=False), 3)]
    place = 1 if _class(matrix, order) == _OPAQUE else 2
    return bytes(elements[place]).decode("latin1") if len(elements) > place else ""


def _array(path: Path, name: str, matrix: memoryview, order: str) -> np.ndarray:
    """Numbers of a variable."""
    if not len(matrix):
        return np.zeros((0, 0))
    (_, flags), (_, shape_bytes), _, *parts = _elements(matrix, order)
    flag = struct.unpack_from(f"{order}I", flags)[0]
    kind = flag & 0xFF
    if kind not in _REAL_CLASSES or flag & _COMPLEX:
        what = _CLASSES.get(kind, f"class {kind}") if kind not in _REAL_CLASSES else "complex numbers"
        raise DataError(f"`{path}`: variable `{name}` must hold real numbers; got {what}.")
    shape = tuple(int(axis) for axis in np.frombuffer(shape_bytes, f"{order}i4"))
    number, values = parts[0]
    array = np.frombuffer(values, f"{order}{_NUMBERS[number]}")
    if min(shape, default=0) < 0 or math.prod(shape) != array.size:
        raise ValueError(f"variable {name} of shape {shape} has {array.size} numbers")
    return array.reshape(shape, order="F")
