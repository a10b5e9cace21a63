"""Writes a log in ArduPilot's dataflash format (.BIN): format messages, then all messages in order of time.

A message is 0xA3 0x95, its type, and its packed fields; a format message (type 0x80) gives length, name, codes and
names of the fields of a type. Codes: Q uint64, I uint32, H uint16, h int16, B uint8, b int8, M uint8 (a mode), f float,
d double; c int16, e int32, E uint32 in hundredths; N char[16], Z char[64]. FMTU and MULT give each field's SI unit.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEADER, FORMAT_TYPE, FIRST_TYPE = b"\xa3\x95", 0x80, 0x81
KNOWN_TYPES = {"CTUN": 0}  # ArduPlane's number of this type
CODES = {"Q": "<u8", "I": "<u4", "H": "<u2", "h": "<i2", "B": "<u1", "M": "<u1", "b": "<i1", "f": "<f4", "d": "<f8",
         "c": "<i2", "e": "<i4", "E": "<u4", "L": "<i4", "N": "S16", "Z": "S64"}  # fmt: skip
CLOCKS = {"TimeUS": 1, "T": 1000, "TimeMS": 1000}  # [us]; messages without a clock are the first
MULTIPLIERS = {"F": 1e-6, "C": 1e-3, "B": 1e-2, "-": 0.0}  # multiplier by letter of FMTU; 0: none


@dataclass(frozen=True)
class DataflashMessages:
    """Messages of one kind. codes: one for each of the columns (n,). Their clock is the column that CLOCKS lists."""

    name: str
    codes: str
    columns: dict[str, NDArray[np.generic]]

    @property
    def time_us(self) -> NDArray[np.uint64]:
        for name, in_us in CLOCKS.items():
            if name in self.columns:
                return in_us * self.columns[name].astype(np.uint64)
        return np.zeros(len(next(iter(self.columns.values()))), dtype=np.uint64)

    def selected(self, selection: NDArray[np.bool_]) -> "DataflashMessages":
        return replace(self, columns={name: x[selection] for name, x in self.columns.items()})

    def at(self, time_us: NDArray[np.uint64]) -> "DataflashMessages":
        """Return these messages with other times."""
        return replace(self, columns=self.columns | {"TimeUS": time_us})


def write_dataflash(path: Path, kinds: Sequence[DataflashMessages]) -> None:
    """Write a log. Kinds that share a name become instances with one format. Raises OSError if it cannot be written."""
    out = [_format(FORMAT_TYPE, 89, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))]
    types = _types([*kinds, *_units(kinds, {})])
    kinds = [*_units(kinds, types), *kinds]
    timed: list[tuple[int, bytes]] = []
    defined: set[str] = set()
    for kind in kinds:
        rows = _rows(kind)
        if kind.name not in defined:
            defined.add(kind.name)
            length = len(HEADER) + 1 + rows.dtype.itemsize
            out.append(_format(types[kind.name], length, kind.name, kind.codes, tuple(kind.columns)))
        start = HEADER + bytes([types[kind.name]])
        timed += [(time_us, start + row.tobytes()) for time_us, row in zip(kind.time_us.tolist(), rows, strict=True)]
    timed.sort(key=lambda entry: entry[0])
    path.write_bytes(b"".join(out + [data for _, data in timed]))


def _types(kinds: Sequence[DataflashMessages]) -> dict[str, int]:
    """The number of each name."""
    others = [name for name in dict.fromkeys(kind.name for kind in kinds) if name not in KNOWN_TYPES]
    return KNOWN_TYPES | {name: FIRST_TYPE + i for i, name in enumerate(others)}


def _units(kinds: Sequence[DataflashMessages], types: dict[str, int]) -> list[DataflashMessages]:
    """The messages MULT and FMTU at the log's beginning. Firmware before 2017, whose clock is in ms, writes none."""
    if not any("TimeUS" in kind.columns for kind in kinds):
        return []
    named = {kind.name: kind for kind in kinds}
    start = min((kind.time_us.min() for kind in kinds if len(kind.time_us)), default=np.uint64(0))
    letters = [
        "".join(_letter(*pair) for pair in zip(kind.columns, kind.codes, strict=True)) for kind in named.values()
    ]

    def at_start(n: int, **columns: Sequence[object]) -> dict[str, NDArray[np.generic]]:
        return {"TimeUS": np.full(n, start), **{name: np.array(x) for name, x in columns.items()}}

    texts = [text.encode() for text in letters]
    units = at_start(len(named), FmtType=[types.get(name, 0) for name in named], UnitIds=[b""] * len(named),
                    MultIds=texts)  # fmt: skip
    factors = at_start(len(MULTIPLIERS), Id=[ord(x) for x in MULTIPLIERS], Mult=[*MULTIPLIERS.values()])
    return [DataflashMessages("MULT", "Qbd", factors), DataflashMessages("FMTU", "QBNN", units)]


def _letter(field: str, code: str) -> str:
    return "F" if field == "TimeUS" else "B" if code in "ceE" else "-"


def write_text(path: Path, kinds: Sequence[DataflashMessages]) -> None:
    """Write a log as text, as a ground station converts it (.log). Raises OSError if it cannot be written."""
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    types = _types(kinds)
    for kind in {kind.name: kind for kind in kinds}.values():
        length = len(HEADER) + 1 + _rows(kind).dtype.itemsize
        lines.append(f"FMT, {types[kind.name]}, {length}, {kind.name}, {kind.codes}, {','.join(kind.columns)}")
    timed: list[tuple[int, str]] = []
    for kind in kinds:
        rows = zip(*(column.tolist() for column in kind.columns.values()), strict=True)
        for time_us, values in zip(kind.time_us.tolist(), rows, strict=True):
            texts = [_text(x, code) for x, code in zip(values, kind.codes, strict=True)]
            timed.append((time_us, ", ".join([kind.name, *texts])))
    timed.sort(key=lambda entry: entry[0])
    path.write_text("\n".join([*lines, *(line for _, line in timed)]) + "\n", "utf-8")


def _text(value: float | bytes, code: str) -> str:
    if isinstance(value, bytes):
        return value.decode()
    return f"{int(value)}" if code in "QIHhBMb" else f"{value:.7f}" if code == "L" else f"{value:.7g}"


def _format(number: int, length: int, name: str, codes: str, columns: tuple[str, ...]) -> bytes:
    texts = (name.encode(), codes.encode(), ",".join(columns).encode())
    return HEADER + bytes([FORMAT_TYPE]) + struct.pack("<BB4s16s64s", number, length, *texts)


def _rows(kind: DataflashMessages) -> NDArray[np.void]:
    dtype = np.dtype([(name, CODES[code]) for name, code in zip(kind.columns, kind.codes, strict=True)])
    rows = np.zeros(len(kind.time_us), dtype=dtype)
    for (name, values), code in zip(kind.columns.items(), kind.codes, strict=True):
        factor = 100 if code in "ceE" else 1e7 if code == "L" else None
        rows[name] = values if factor is None else np.round(factor * values.astype(float))
    return rows
