"""CSV files whose header names each column with its unit."""

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import to_si


def csv_rows(path: Path) -> list[list[str]]:
    """The lines of a CSV file that are not empty, split. Raises InputError naming the file."""
    try:
        return [row for row in csv.reader(read_text(path).splitlines()) if row]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error})") from None


def si_column(lines: list[list[str]], column: int, given: str, unit: str, where: str) -> NDArray[np.float64]:
    """A column (n,) in the SI unit `unit` from numbers in the unit `given`; NaN where a line has no number there.

    Raises InputError naming `where` for a unit that is none, or that of another quantity.
    """
    zero, unity = (to_si(f"{x} {given}", unit, where) for x in (0, 1))
    return zero + (unity - zero) * np.array([_number(line, column) for line in lines])


def _number(line: list[str], column: int) -> float:
    try:
        return float(line[column])
    except (ValueError, IndexError):
        return math.nan
