"""Finds the layout of a text table: its line of names, separator, decimal sign and rows. Also reads times in cells.

It recognizes lines before the names, a line of units below them, comments and a spreadsheet's `sep=`. It compares the
number of cells with the number of names.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import DAY_S

SEPARATORS = ("\t", ";", ",")  # tables with one of the first two separators may have decimal commas
DECIMAL_COMMA, DECIMAL_POINT = re.compile(r"[+-]?\d+,\d+"), re.compile(r"[+-]?\d*\.\d+")
NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)
DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}\.?")
TIME_OF_DAY = re.compile(
    r"(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}\.?[ T,]+)?(\d{1,2}):(\d\d)(?::(\d\d(?:[.,:]\d+)?))?\s*([AaPp])?\.?[Mm]?\.?Z?"
)


class Layout(NamedTuple):
    """names : unique names of the columns     rows : lines of cells     decimal : decimal sign in numbers"""

    names: tuple[str, ...]
    rows: Sequence[str]
    separator: str
    decimal: str


def layout_of(text: str) -> Layout | None:
    """Return the layout of a table; None if the text, or its first lines, cannot be a table.

    Raises InputError, without the file's name, if the numbers of names and cells disagree.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    separators: Sequence[str] = SEPARATORS
    if lines and (match := re.fullmatch(r"\"?sep=(.)\"?", lines[0].strip())):
        separators, lines = (match[1],), lines[1:]
    for separator in separators:
        layout = _layout(lines, separator)
        if layout is not None:
            return layout
    return None


def _layout(lines: Sequence[str], separator: str) -> Layout | None:
    """Return the layout with this separator; None if it does not split most lines into the same number of cells."""
    middle = max(0, len(lines) // 2 - 100)
    sample = [_cells(line, separator) for line in lines[middle : middle + 200]]
    if len(lines) < 3:
        return None
    (usual, times), *_ = Counter(map(len, sample)).most_common(1)
    if usual < 2 or times < 0.5 * len(sample):
        return None
    first = next((i for i in range(1, len(lines)) if _begins_rows(lines, i, separator, usual)), None)
    if first is None:
        return None
    head = _cells(lines[first - 1], separator)
    if first > 1 and len({cell.strip() for cell in head}) == 1:  # all cells are equal: a line of marks below the names
        head = _cells(lines[first - 2], separator)
    elif first > 1 and _is_units(above := _cells(lines[first - 2], separator), head):
        head = [
            f"{name} [{unit.strip('[]() ')}]" if unit.strip() else name for name, unit in zip(above, head, strict=True)
        ]
    if any(NUMBER.fullmatch(cell.strip()) for cell in head) or not any(cell.strip() for cell in head):
        return None
    rows = [line for line in lines[first:] if line != lines[first - 1]]
    decimal = "," if separator != "," and _has_decimal_comma(sample) else "."
    return Layout(_unique(_counted(head, rows, separator)), rows, separator, decimal)


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)


def _begins_rows(lines: Sequence[str], first: int, separator: str, usual: int) -> bool:
    """Return whether lines of numbers or times begin here, each with the usual number of cells."""
    for line in lines[first : first + 3]:
        cells = _cells(line, separator)
        if len(cells) != usual or not any(_is_value(cell) for cell in cells):
            return False
    return len(lines) >= first + 2 and not any(_is_value(cell) for cell in _cells(lines[first - 1], separator))


def _is_value(cell: str) -> bool:
    cell = cell.strip()
    return bool(NUMBER.fullmatch(cell) or TIME_OF_DAY.fullmatch(cell) or DATE.fullmatch(cell))


def _is_units(above: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether a line has the units of the names above it: the same number of cells, all short."""
    return len(above) == len(below) and all(cell.strip() for cell in above) and max(map(len, below)) <= 8


def _has_decimal_comma(sample: Sequence[Sequence[str]]) -> bool:
    cells = [cell.strip() for row in sample for cell in row]
    return sum(map(bool, map(DECIMAL_COMMA.fullmatch, cells))) > sum(map(bool, map(DECIMAL_POINT.fullmatch, cells)))


def _counted(head: Sequence[str], rows: Sequence[str], separator: str) -> list[str]:
    """Return the names, plus empty names for empty cells beyond them. Raises InputError if names and cells disagree."""
    names = list(head)
    counts = [len(_cells(row, separator)) if '"' in row else row.count(separator) + 1 for row in rows]
    for row, count in zip(rows, counts, strict=True):
        if count > len(head) and any(cell.strip() for cell in _cells(row, separator)[len(head) :]):
            raise InputError(
                f"has {len(head)} names for {count} cells in a row ({sum(n == count for n in counts)} of {len(rows)}"
                " rows have that many), so that it is not known which cell is which: complete its line of names"
            )
    usual = Counter(counts).most_common(1)[0][0]
    if usual < len(head):
        raise InputError(
            f"has {len(head)} names for {usual} cells in most rows, so that it is not known which cell is which:"
            " correct its line of names"
        )
    return names + [""] * (max(counts) - len(names))


def _unique(names: Sequence[str]) -> tuple[str, ...]:
    """Return names without surrounding spaces; repeated names get a number, an empty name the number of its column."""
    seen: Counter[str] = Counter()
    unique = []
    for i, name in enumerate(names):
        plain = name.strip() or f"column {i + 1}"
        seen[plain] += 1
        unique.append(plain if seen[plain] == 1 else f"{plain} number {seen[plain]}")
    return tuple(unique)


def seconds_of_times(cells: Any) -> Array | None:
    """Return seconds since the first cell (n,). Cells are dates with times, or times of day, which may pass midnight.

    None if fewer than half can be read. cells : pandas.Series of texts
    """
    dates = pd.to_datetime(cells, errors="coerce", utc=True, format="ISO8601")
    if dates.notna().mean() >= 0.5 * cells.notna().mean():
        return np.asarray((dates - dates.min()).dt.total_seconds(), dtype=np.float64)
    times = [TIME_OF_DAY.fullmatch(cell.strip()) if isinstance(cell, str) else None for cell in cells]
    if sum(time is not None for time in times) < 0.5 * len(times):
        return None
    seconds = np.array([np.nan if time is None else _since_midnight_s(time) for time in times])
    finite = np.flatnonzero(np.isfinite(seconds))
    midnights = np.cumsum(np.append(0, np.diff(seconds[finite]) < -DAY_S / 2))
    seconds[finite] += DAY_S * midnights
    return np.asarray(seconds - seconds[finite[0]])


def _since_midnight_s(time: re.Match[str]) -> float:
    hour, minute, second, half = time.groups()
    hours = int(hour) % 12 + 12 * (half in "Pp") if half else int(hour)
    return 3600.0 * hours + 60.0 * int(minute) + float((second or "0").replace(",", ".").replace(":", "."))


def positions_of(cells: Any) -> tuple[Array, Array] | None:
    """Return latitude and longitude in degrees, (n,) each, from cells with both, as radios write; None for other cells.

    cells : pandas.Series of texts
    """
    parts = cells.astype(str).str.extract(r"^\s*([NS+-]?\d+\.\d+)[NS]?[ ,;]+([EW+-]?\d+\.\d+)[EW]?\s*$")
    if parts[0].notna().mean() < 0.5 * cells.notna().mean():
        return None
    return tuple(
        parts[i].str.replace(r"^[NE]", "", regex=True).str.replace(r"^[SW]", "-", regex=True).astype(float).to_numpy()
        for i in (0, 1)
    )
