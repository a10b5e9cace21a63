"""Reads the variables of a .mat file of version 5 to 7, even a damaged one.

The format is MathWorks' "MAT-File Format": elements with a type and a length, nested in one another. SciPy's reader
is not used because some damaged files crash it with a segmentation fault.
"""

import struct
import zlib
from collections.abc import Iterator
from enum import IntEnum
from math import prod
from typing import Any

import numpy as np

from flightpower.flight.log_chunk import allowed_bytes

HEADER = struct.Struct("<124xH2s")  # version, and byte order


class Kind(IntEnum):
    """Types of elements in the file."""

    INT8 = 1
    UINT8 = 2
    INT16 = 3
    UINT16 = 4
    INT32 = 5
    UINT32 = 6
    SINGLE = 7
    DOUBLE = 9
    INT64 = 12
    UINT64 = 13
    MATRIX = 14
    COMPRESSED = 15
    UTF8 = 16
    UTF16 = 17
    UTF32 = 18


class Class(IntEnum):
    """The content of a matrix. Sparse matrices, objects and functions are not read."""

    CELL = 1
    STRUCT = 2
    CHAR = 4
    FIRST_NUMBER = 6
    LAST_NUMBER = 15


class Flag(IntEnum):
    """Flags of a matrix."""

    COMPLEX = 0x0800


NUMBERS = {
    Kind.INT8: "i1", Kind.UINT8: "u1", Kind.INT16: "i2", Kind.UINT16: "u2", Kind.INT32: "i4", Kind.UINT32: "u4",
    Kind.SINGLE: "f4", Kind.DOUBLE: "f8", Kind.INT64: "i8", Kind.UINT64: "u8",
}  # fmt: skip
TEXTS = {  # {}: l or b, for the byte order
    Kind.INT8: "latin-1", Kind.UINT8: "latin-1", Kind.UINT16: "utf-16-{}e", Kind.UTF8: "utf-8",
    Kind.UTF16: "utf-16-{}e", Kind.UTF32: "utf-32-{}e",
}  # fmt: skip


def read_mat(data: bytes) -> dict[str, Any]:
    """Return the variables by name: arrays of numbers without axes of length 1, texts, structures as dictionaries,
    and cells as arrays of objects. Everything else is left out.

    Raises ValueError if an element does not end within the file; other damage may raise any exception.
    """
    version, order = HEADER.unpack_from(data)
    end = "<" if order == b"IM" else ">"
    if order not in (b"IM", b"MI") or version not in (0x0100, 0x0001):
        raise ValueError("no .mat file of version 5")
    limit = allowed_bytes(len(data))
    variables: dict[str, Any] = {}
    for kind, content in _elements(memoryview(data)[HEADER.size :], end):
        if kind == Kind.COMPRESSED:
            unpacked = zlib.decompressobj().decompress(content, limit)
            kind, content = next(_elements(memoryview(unpacked), end))
        if kind == Kind.MATRIX:
            name, value = _matrix(content, end)
            if value is not None:
                variables[name] = value
    return variables


def _elements(data: memoryview, end: str) -> Iterator[tuple[int, memoryview]]:
    """Yield each element's type and content. Raises ValueError for an element that is longer than the data left."""
    offset = 0
    while offset + 8 <= len(data):
        kind, length = struct.unpack_from(f"{end}II", data, offset)
        start = offset + 8
        if kind >> 16:  # a small element, whose content is within its header
            kind, length, start = kind & 0xFFFF, kind >> 16, offset + 4
        if start + length > len(data) or (start == offset + 4 and length > 4):
            raise ValueError(f"an element of {length} bytes is longer than what is left of it")
        yield kind, data[start : start + length]
        offset = start + length
        offset += 0 if kind == Kind.COMPRESSED else -offset % 8


def _matrix(content: memoryview, end: str) -> tuple[str, Any]:
    """Return the name and the value of a matrix; the value is None if it is of a kind that is not read."""
    parts = _elements(content, end)
    flags = next(parts, None)
    if flags is None:
        return "", np.zeros(0)
    (word,) = struct.unpack_from(f"{end}I", flags[1])
    shape = tuple(np.frombuffer(next(parts)[1], f"{end}i4").tolist())
    name = bytes(next(parts)[1]).decode("latin-1").rstrip("\0")
    count, kind = prod(shape), word & 0xFF
    if min(shape, default=0) < 0:
        raise ValueError(f"a matrix of shape {shape}")
    if kind == Class.CELL:
        if count > len(content):
            raise ValueError(f"{count} cells in {len(content)} bytes")
        cells = np.empty(count, dtype=object)
        for i in range(count):
            cells[i] = _matrix(next(parts)[1], end)[1]
        return name, np.squeeze(cells.reshape(shape, order="F"))
    if kind == Class.STRUCT:
        (length,) = struct.unpack_from(f"{end}i", next(parts)[1])
        names = bytes(next(parts)[1])
        fields = [
            names[start : start + length].split(b"\0")[0].decode("latin-1") for start in range(0, len(names), length)
        ]
        return name, {field: _matrix(next(parts)[1], end)[1] for field in fields} if count == 1 else None
    if kind == Class.CHAR:
        data_type, text = next(parts, (1, memoryview(b"")))
        return name, _text(bytes(text), TEXTS[Kind(data_type)], end, shape)
    if not Class.FIRST_NUMBER <= kind <= Class.LAST_NUMBER or word & Flag.COMPLEX:
        return name, None
    data_type, numbers = next(parts, (9, memoryview(b"")))
    return name, np.squeeze(np.frombuffer(numbers, end + NUMBERS[Kind(data_type)]).reshape(shape, order="F"))


def _text(packed: bytes, encoding: str, end: str, shape: tuple[int, ...]) -> Any:
    """Return one text, or for a matrix of characters an array with the text in each row."""
    text = packed.decode(encoding.format("l" if end == "<" else "b"), "replace")
    rows = shape[0] if shape else 1
    if rows <= 1:
        return text
    if rows > len(text):
        raise ValueError(f"{rows} rows of {len(text)} characters")
    return np.array([text[i::rows].rstrip() for i in range(rows)], dtype=object)
