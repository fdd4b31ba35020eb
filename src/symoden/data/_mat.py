"""Reading MATLAB files of version 5, as `save` writes them by default.

SciPy's reader ends the whole process on some damaged files; this one only knows arrays of real numbers, and checks
every length before it reads.
"""

import math
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from ._errors import DataError, missing
from ._limits import LARGEST, refuse_large

_HEADER = 128  # bytes of text, version and byte order
_MATRIX, _COMPRESSED = 14, 15
_START = 512  # bytes of a compressed variable that hold its sizes and its name
_COMPLEX = 0x800
_NUMBERS: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES: Final = {1: "a cell", 2: "a struct", 3: "an object", 4: "text", 5: "a sparse matrix", 16: "a function"}
_REAL_CLASSES = range(6, 16)


def read_mat5(path: Path, names: Collection[str]) -> Mapping[str, np.ndarray]:
    """Read variables of a MATLAB file of version 5.

    Args:
        path: File.
        names: The variables.

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
    found: dict[str, memoryview] = {}
    for kind, body in _elements(contents[_HEADER:], order):
        name = _name(_matrix(kind, body, order, _START), order)
        found[name] = _matrix(kind, body, order, LARGEST) if name in names else body[:0]
    for name in names:
        if name not in found:
            raise DataError(missing(path, name, filter(None, found), kind="variable"))
    return {name: _array(path, name, found[name], order) for name in names}


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
    """Name of a variable, its third element."""
    elements = list(zip(range(3), _elements(matrix, order, complete=False), strict=False))
    return bytes(elements[2][1][1]).decode("latin1") if len(elements) > 2 else ""


def _array(path: Path, name: str, matrix: memoryview, order: str) -> np.ndarray:
    """Numbers of a variable."""
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
