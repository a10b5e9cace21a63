"""Writes a log in ArduPilot's dataflash format (.BIN): format messages, then all messages in order of time.

A message is 0xA3 0x95, its type, and its packed fields; a format message (type 0x80) gives length, name, codes and
names of the fields of a type. Codes: Q uint64, B uint8, f float, c int16 in hundredths, N char[16], Z char[64].
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEADER, FORMAT_TYPE, FIRST_TYPE = b"\xa3\x95", 0x80, 0x81
CODES = {"Q": "<u8", "B": "<u1", "f": "<f4", "c": "<i2", "N": "S16", "Z": "S64"}


@dataclass(frozen=True)
class DataflashMessages:
    """Messages of one kind. codes: one for each of the columns, (n,), the first of which is TimeUS"""

    name: str
    codes: str
    columns: dict[str, NDArray[np.generic]]

    @property
    def time_us(self) -> NDArray[np.uint64]:
        return self.columns["TimeUS"].astype(np.uint64)

    def selected(self, kept: NDArray[np.bool_]) -> "DataflashMessages":
        return replace(self, columns={name: x[kept] for name, x in self.columns.items()})

    def at(self, time_us: NDArray[np.uint64]) -> "DataflashMessages":
        """At other times."""
        return replace(self, columns=self.columns | {"TimeUS": time_us})


def write_dataflash(path: Path, kinds: Sequence[DataflashMessages]) -> None:
    """Write a log. Kinds of the same name are instances with one format. Raises OSError where it cannot be written."""
    out = [_format(FORMAT_TYPE, 89, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))]
    types: dict[str, int] = {}
    timed: list[tuple[int, bytes]] = []
    for kind in kinds:
        rows = _rows(kind)
        if kind.name not in types:
            types[kind.name] = FIRST_TYPE + len(types)
            length = len(HEADER) + 1 + rows.dtype.itemsize
            out.append(_format(types[kind.name], length, kind.name, kind.codes, tuple(kind.columns)))
        start = HEADER + bytes([types[kind.name]])
        timed += [(int(row["TimeUS"]), start + row.tobytes()) for row in rows]
    timed.sort(key=lambda entry: entry[0])
    path.write_bytes(b"".join(out + [data for _, data in timed]))


def write_text(path: Path, kinds: Sequence[DataflashMessages]) -> None:
    """Write a log as a ground station converts it to text (.log). Raises OSError where it cannot be written."""
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    formats = {kind.name: kind for kind in kinds}
    for number, kind in enumerate(formats.values(), FIRST_TYPE):
        length = len(HEADER) + 1 + _rows(kind).dtype.itemsize
        lines.append(f"FMT, {number}, {length}, {kind.name}, {kind.codes}, {','.join(kind.columns)}")
    timed: list[tuple[int, str]] = []
    for kind in kinds:
        for time_us, *values in zip(*(column.tolist() for column in kind.columns.values()), strict=True):
            texts = [x.decode() if isinstance(x, bytes) else f"{x:.7g}" for x in values]
            timed.append((int(time_us), ", ".join([kind.name, f"{int(time_us)}", *texts])))
    timed.sort(key=lambda entry: entry[0])
    path.write_text("\n".join([*lines, *(line for _, line in timed)]) + "\n", "utf-8")


def _format(number: int, length: int, name: str, codes: str, columns: tuple[str, ...]) -> bytes:
    texts = (name.encode(), codes.encode(), ",".join(columns).encode())
    return HEADER + bytes([FORMAT_TYPE]) + struct.pack("<BB4s16s64s", number, length, *texts)


def _rows(kind: DataflashMessages) -> NDArray[np.void]:
    dtype = np.dtype([(name, CODES[code]) for name, code in zip(kind.columns, kind.codes, strict=True)])
    rows = np.zeros(len(kind.columns["TimeUS"]), dtype=dtype)
    for (name, values), code in zip(kind.columns.items(), kind.codes, strict=True):
        rows[name] = np.round(100 * values.astype(float)) if code == "c" else values
    return rows
