"""Reads a Jeti radio's telemetry log (.log) as a table: each line has the values of one device's sensors at one time.

000000000;4309320782;0;MUI-50;          time [ms]; device; 0; its name
000000000;4309320782;2;Current;A        time; device; sensor; name; unit
000450158;4309320782;2;1;1;17           time; device; then for each sensor: number; type; decimals; value
"""

from collections import Counter, defaultdict
from enum import IntEnum

import numpy as np

from flightpower.flight.arrays import Array

TIME = "Time [s]"
VALUE = ("number", "type", "decimals", "value")  # cells that make up each sensor's value


class Type(IntEnum):
    """Types of numeric values; the other types are times and dates."""

    BITS_6 = 0
    BITS_14 = 1
    BITS_22 = 4
    BITS_30 = 8
    POSITION = 9


def read_jeti(text: str) -> dict[str, Array]:
    """Return the time since the first value [s] and each sensor's values at all times, (n,) each; NaN without a value.

    A column is named after device and sensor, with the unit in brackets. Damaged lines are left out.
    """
    devices: dict[str, str] = {}
    names: dict[tuple[str, str], str] = {}
    values: dict[tuple[str, str], dict[int, float]] = defaultdict(dict)
    for line in text.splitlines():
        cells = line.split(";")
        if line.startswith("#") or len(cells) < len(VALUE) or not cells[0].isascii() or not cells[0].isdigit():
            continue
        time_ms, device = int(cells[0]), cells[1]
        if not time_ms and len(cells) <= len(VALUE) + 1:
            if cells[2] == "0":
                devices[device] = cells[3].strip()
            else:
                unit = cells[4].strip() if len(cells) > len(VALUE) else ""
                names[device, cells[2]] = f"{cells[3].strip()} [{unit}]" if unit else cells[3].strip()
            continue
        for first_cell in range(2, len(cells) - len(VALUE) + 1, len(VALUE)):
            number, kind, decimals, value = cells[first_cell : first_cell + len(VALUE)]
            if (decoded := _value(kind, decimals, value)) is not None:
                values[device, number][time_ms] = decoded
                if kind == str(Type.POSITION.value) and "[" not in names.get((device, number), "["):
                    names[device, number] += " [°]"
    times_ms = np.array(sorted({first_cell for at_times in values.values() for first_cell in at_times}), dtype=float)
    columns: dict[str, Array] = {TIME: 1e-3 * (times_ms - times_ms[:1])}
    seen: Counter[str] = Counter()
    for (device, number), at_times in values.items():
        name = f"{devices.get(device, device)} {names.get((device, number), number)}"
        seen[name] += 1
        column = np.full(len(times_ms), np.nan)
        column[np.searchsorted(times_ms, list(at_times))] = list(at_times.values())
        columns[name if seen[name] == 1 else f"{name} number {seen[name]}"] = column
    return columns


def _value(kind: str, decimals: str, value: str) -> float | None:
    """Return the number, in degrees for a position; None for a time, a date or a damaged value."""
    try:
        value_type, digits, number = Type(int(kind)), int(decimals), int(value)
    except ValueError:
        return None
    if value_type is Type.POSITION:  # thousandths of a minute, degrees; the cell of decimals marks South and West
        return ((number >> 16 & 0xFF) + (number & 0xFFFF) / 60_000) * (-1 if digits & 2 else 1)
    return number / 10**digits if 0 <= digits <= 8 and abs(number) < 2**31 else None
