"""The map of a table's columns: the quantity, unit, sign and delay of each.

    [true_airspeed]
    column = "tas_kt"
    unit = "knot"
    factor = 1        # -1 reverses the sign; 2 makes both motors of one
    offset = "0 m/s"  # added after that
    delay = "0.3 s"   # each value was measured this long before its time

A map is next to its table, named after it with .columns.toml added, or is columns.toml for all tables in a folder.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.quantities import KINDS, Quantity
from flightpower.analysis.sources.recording import Channel
from flightpower.analysis.sources.table_file import Columns
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import read_table, to_si

BESIDE = "columns.toml"
DRAFT = "flightpower new columns"
Channels = Mapping[Quantity, Channel]


@dataclass(frozen=True)
class MappedColumn:
    """One entry of a map."""

    column: str
    unit: str
    factor: float = 1.0
    offset: str = ""
    delay_s: float = 0.0

    def in_si(self, value: Array, quantity: Quantity, where: str) -> Array:
        """Return the values in SI units. Raises InputError for an unknown unit, or for a unit of another quantity."""
        unit = KINDS[quantity].unit
        zero, unity = (to_si(f"{x} {self.unit}".strip(), unit, f"{where}: {quantity}.unit") for x in (0, 1))
        added = to_si(self.offset, unit, f"{where}: {quantity}.offset") if self.offset else 0.0
        return np.asarray(self.factor * (zero + (unity - zero) * value) + added)


@dataclass(frozen=True)
class ColumnMap:
    path: Path
    columns: Mapping[Quantity, MappedColumn]

    def named(self, quantity: Quantity) -> str:
        """Return the quantity with the name of its column, for messages."""
        return f"{quantity} (column {self.columns[quantity].column})" if quantity in self.columns else quantity


def map_of(table: Path, map_file: Path | None = None) -> ColumnMap:
    """Return the column map from the option, or from the file next to the table.

    Raises InputError if there is none, or if it is wrong.
    """
    candidates = map_files(table, map_file)
    if not candidates:
        raise InputError(
            f"{table}: a table, whose columns need a map: {DRAFT} {table} -o {table.name}.{BESIDE}; look through it,"
            f" and analyze the table with --columns {table.name}.{BESIDE}"
        )
    return load_map(candidates[0])


def map_files(table: Path, map_file: Path | None) -> list[Path]:
    """Return the map file that `map_of` reads, in a list that is empty if there is none."""
    beside = [table.with_name(f"{table.name}.{BESIDE}"), table.with_name(BESIDE)]
    return [map_file] if map_file else [path for path in beside if path.is_file()][:1]


def load_map(path: Path) -> ColumnMap:
    """Load a column map. Raises InputError when the file cannot be read or has a wrong entry."""
    text = read_text(path)
    try:
        entries = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None
    if unknown := [name for name in entries if name not in list(Quantity)]:
        raise InputError(f"{path}: {unknown[0]} is not a quantity; known: {', '.join(Quantity)}")
    if Quantity.TIME not in entries:
        raise InputError(f"{path}: no [time]; it needs the column of the times")
    read = {Quantity(name): read_table(MappedColumn, entry, f"{path}: {name}") for name, entry in entries.items()}
    for quantity, column in read.items():
        column.in_si(np.zeros(1), quantity, str(path))
    return ColumnMap(path, read)


def mapped_channels(table: Path, columns: Columns, column_map: ColumnMap) -> dict[Quantity, Channel]:
    """Return the quantities of a table in SI units, each at the times when it was measured.

    Raises InputError when the table lacks a column, holds several aircraft, or its times do not ascend.
    """
    missing = [value.column for value in column_map.columns.values() if value.column not in columns]
    if missing:
        raise InputError(
            f"{table}: has no column {', '.join(missing)}, which {column_map.path} names; it has {', '.join(columns)}"
        )
    si = {
        quantity: value.in_si(columns[value.column], quantity, str(column_map.path))
        for quantity, value in column_map.columns.items()
    }
    if (number := si.pop(Quantity.AIRCRAFT, None)) is not None and len(
        seen := np.unique(number[~np.isnan(number)])
    ) > 1:
        raise InputError(
            f"{table}: holds {len(seen)} aircraft ({column_map.named(Quantity.AIRCRAFT)} is"
            f" {', '.join(f'{value:g}' for value in seen[:5])}): write a table for each"
        )
    t_s = si.pop(Quantity.TIME)
    _check_times(table, t_s, column_map)
    channels = {}
    for quantity, value in si.items():
        finite = np.isfinite(value) & np.isfinite(t_s)
        if finite.sum() < READABLE.fewest_samples:
            raise InputError(
                f"{table}: {column_map.named(quantity)} has {finite.sum()} numbers; leave it out of the map"
            )
        taken_s, first = np.unique(t_s[finite], return_index=True)
        channels[quantity] = Channel(taken_s - column_map.columns[quantity].delay_s, value[finite][first])
    return channels


def _check_times(table: Path, t_s: Array, column_map: ColumnMap) -> None:
    step = np.diff(t_s[np.isfinite(t_s)])
    name = column_map.named(Quantity.TIME)
    if not len(step) or np.mean(step < 0) > 0.001 or np.min(step) < -1.0 or not np.any(step > 0):
        back = f"goes back {np.sum(step < 0)} times" if np.any(step < 0) else "does not proceed"
        raise InputError(f"{table}: {name} {back}: is it another column, or several flights in one table?")
    interval_s, whole_s = float(np.median(step[step > 0])), float(np.sum(step))
    if interval_s > 5.0 or interval_s < 5e-5 or whole_s > 1e6:
        raise InputError(
            f"{table}: {name} has {interval_s:.3g} s between samples and {whole_s:.3g} s in all, which cannot be a"
            f" flight; is its unit not {column_map.columns[Quantity.TIME].unit}?"
        )
