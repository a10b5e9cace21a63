"""Finds messages in a log in ArduPilot's dataflash format (.BIN), even a damaged one, and unpacks those of one name.

A message consists of 0xA3 0x95, the number of its kind, and packed fields. Messages of kind 0x80 (FMT) define kinds:
number, length, name, and the codes and names of the fields.
"""

import itertools
import struct
from array import array
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.errors import InputError

START, DEFINITION = b"\xa3\x95", ord(b"\x80")
FORMAT = struct.Struct("<BB4s16s64s")
HEADER_BYTES = struct.calcsize("2sB")  # START, number of the kind
# NumPy types for the codes of packed fields. Fields with codes cCeE are in hundredths, those with L in 1e-7 degrees.
PACKED = {"a": "(32,)<i2", "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4",
          "d": "<f8", "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4",
          "L": "<i4", "q": "<i8", "Q": "<u8"}  # fmt: skip


class Form(NamedTuple):
    """The number of a kind of message, its fields, and a code for each."""

    number: int
    fields: tuple[str, ...]
    codes: str

    def whole_numbers(self) -> list[str]:
        """Return the integer fields whose code implies no scale."""
        return [field for field, code in zip(self.fields, self.codes, strict=False) if code in "bBhHiIqQ"]


class _Kind(NamedTuple):
    name: str
    codes: str
    fields: tuple[str, ...]
    dtype: np.dtype[np.void]


def _read(stream: BinaryIO, size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise InputError(f"{stream.name}: became shorter while it was read; copy the log, then analyze the copy")
    return data


class DataflashLog:
    """The messages of a file by kind. One block of the file at a time is in memory.

    The file is read rather than memory-mapped: pulling the card of a mapped file ends the process without a message.

    Raises OSError if the file cannot be read at first, InputError if it cannot be read later or has become shorter.
    """

    notes = ()
    BLOCK_BYTES: ClassVar[int] = 1 << 23

    def __init__(self, source: bytes | Path):
        self._source = source
        self._bytes = len(source) if isinstance(source, bytes) else source.stat().st_size
        self._kinds: dict[int, _Kind] = {}
        lengths = [0] * 256
        lengths[DEFINITION] = HEADER_BYTES + FORMAT.size
        self._offsets = [array("Q") for _ in range(256)]
        begin, data = 0, b""
        for block in self._blocks():
            data += block
            offset, find, last = 0, data.find, begin + len(data) == self._bytes
            while 0 <= (offset := find(START, offset)) <= len(data) - HEADER_BYTES:
                number = data[offset + 2]
                length = lengths[number]
                if offset + length > len(data) and not last:
                    break
                if not length or offset + length > len(data):
                    offset += 1
                    continue
                self._offsets[number].append(begin + offset)
                if number == DEFINITION and (defined := self._define(data, offset)) is not None:
                    lengths[defined] = HEADER_BYTES + self._kinds[defined].dtype.itemsize
                offset += length
            rest = offset if offset >= 0 else len(data) - 1  # the last byte may be the first byte of START
            begin, data = begin + rest, data[rest:]

    def _blocks(self) -> Iterator[bytes]:
        if isinstance(self._source, bytes):
            yield self._source
            return
        with self._source.open("rb") as stream:
            for begin in range(0, self._bytes, self.BLOCK_BYTES):
                yield _read(stream, min(self.BLOCK_BYTES, self._bytes - begin))

    def _slice(self, begin: int, end: int) -> bytes:
        if isinstance(self._source, bytes):
            return self._source[begin:end]
        try:
            with self._source.open("rb") as stream:
                stream.seek(begin)
                return _read(stream, end - begin)
        except OSError as error:
            raise InputError(f"{self._source}: cannot be read any longer ({error.strerror or error})") from None

    def _define(self, data: bytes, offset: int) -> int | None:
        """Store and return the number of the kind that a format message defines; None if damaged or already defined."""
        number, length, *texts = FORMAT.unpack_from(data, offset + HEADER_BYTES)
        name, codes, listed = (text.rstrip(b"\0").decode("ascii", "replace") for text in texts)
        fields = tuple(listed.split(","))
        defined = number in self._kinds or number == DEFINITION
        named = len(set(fields)) == len(fields) == len(codes) and all(fields)
        if defined or not named or not set(codes) <= set(PACKED):
            return None
        dtype = np.dtype([(field, PACKED[code]) for field, code in zip(fields, codes, strict=True)])
        if length != HEADER_BYTES + dtype.itemsize:
            return None
        self._kinds[number] = _Kind(name, codes, fields, dtype)
        return int(number)

    def names(self) -> list[str]:
        """Return the kinds of message that the log holds, in order of their numbers."""
        return [kind.name for number, kind in sorted(self._kinds.items()) if len(self._offsets[number])]

    def form(self, name: str) -> Form | None:
        """Return how messages of a name are packed; None if the log has none."""
        numbered = next(((number, kind) for number, kind in self._kinds.items() if kind.name == name), None)
        return None if numbered is None else Form(numbered[0], numbered[1].fields, numbered[1].codes)

    def columns(self, name: str, wanted: Collection[str] = ()) -> dict[str, NDArray[Any]]:
        """Return the fields of all messages of a name, (n,): numbers as float64, texts as bytes; arrays are left out.

        wanted: the fields to read, if not all.
        """
        numbers = [number for number, kind in self._kinds.items() if kind.name == name]
        if not numbers:
            return {}
        kind, offsets = self._kinds[numbers[0]], np.frombuffer(self._offsets[numbers[0]], dtype=np.uint64)
        out: dict[str, NDArray[Any]] = {}
        for field, code in zip(kind.fields, kind.codes, strict=True):
            if code != "a" and (not wanted or field in wanted):
                text = code in "nNZ"
                out[field] = np.empty(len(offsets), dtype=kind.dtype[field] if text else np.float64)
        step = self.BLOCK_BYTES
        ends = np.searchsorted(offsets, np.arange(step, self._bytes + step, step)).tolist()
        for first, last in itertools.pairwise([0, *ends]):
            self._fill(kind, offsets[first:last], {field: column[first:last] for field, column in out.items()})
        for field, code in zip(kind.fields, kind.codes, strict=True):
            if code in "cCeEL" and field in out:
                out[field] *= 1e-7 if code == "L" else 0.01
        return out

    def _fill(self, kind: _Kind, offsets: NDArray[np.uint64], out: dict[str, NDArray[Any]]) -> None:
        """Fill `out`, fields (n,), from the messages at these offsets (n,), which are all within one block."""
        if not len(offsets):
            return
        begin, end = int(offsets[0]) + HEADER_BYTES, int(offsets[-1]) + HEADER_BYTES + kind.dtype.itemsize
        block = np.frombuffer(self._slice(begin, end), dtype=np.uint8)
        starts = offsets.astype(np.int64) + HEADER_BYTES - begin
        rows = block[starts[:, None] + np.arange(kind.dtype.itemsize)].view(kind.dtype).reshape(-1)
        with np.errstate(invalid="ignore"):
            for field, column in out.items():
                column[:] = rows[field]
