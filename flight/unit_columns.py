"""Reads CSV files whose header gives each column's name and unit, `thrust_N` or `thrust [N]`."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import number_or_nan, to_si

REVOLUTIONS = {"revps": "turn/s", "rev/s": "turn/s", "rev/min": "rpm"}  # names that pint does not know


def read_unit_columns(
    path: Path, columns: Mapping[str, tuple[str, str]], needed: Sequence[str], example: str
) -> dict[str, NDArray[np.float64]]:
    """Columns (n,) of finite numbers by name, in SI units. Lines that are empty or begin with # are skipped.

    columns : name and SI unit by title     needed : titles of columns that the file must have
    example : a header, for messages
    Raises InputError naming file and cause: no measurements, an unknown or missing column, a line without a number.
    """
    try:
        rows = [row for row in csv.reader(read_text(path).splitlines()) if row and not row[0].startswith("#")]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error})") from None
    if len(rows) < 2:
        raise InputError(f"{path}: holds no measurements; give columns such as {example}")
    header, *lines = rows
    values: dict[str, NDArray[np.float64]] = {}
    for i, title in enumerate(header):
        match = re.fullmatch(rf"\s*({'|'.join(columns)})(?:_|\s*\[)([^\]]+)\]?\s*", title)
        if match is None:
            raise InputError(f"{path}: column {title!r}: must be one of {', '.join(columns)} with its unit: {example}")
        name, unit = columns[match[1]]
        zero, unity = (to_si(f"{x} {REVOLUTIONS.get(match[2], match[2])}", unit, f"{path}: {title}") for x in (0, 1))
        numbers = np.array([number_or_nan(line[i]) if i < len(line) else np.nan for line in lines])
        values[name] = zero + (unity - zero) * numbers
        if not np.isfinite(values[name]).all():
            wrong = ",".join(lines[int(np.isfinite(values[name]).argmin())])
            raise InputError(f"{path}: column {title!r}: not a number in every line; the first without: {wrong}")
    if missing := [title for title in needed if columns[title][0] not in values]:
        raise InputError(f"{path}: no column {', '.join(missing)}; give columns such as {example}")
    return values
