"""Reads numeric columns from a CSV, Parquet or .mat file, recognized by its content rather than its suffix."""

import gzip
import io
import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.jeti import read_jeti
from flightpower.analysis.sources.mat_file import read_mat
from flightpower.analysis.sources.recording import without_damage
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.formats import (
    BYTE_ORDER_MARKS,
    GZIP_MAGIC,
    Format,
    first_bytes,
    format_of,
    refusal,
    text_of,
    unpacked_start,
)

Columns = Mapping[str, Array]
CLOCK = re.compile(r"(times?|timestamp|t|time_?stamp|t(ime)?_(s|sec|ms|us))", re.IGNORECASE)  # a clock in a .mat
NO_LINES_OF_CELLS = (Format.PARQUET, Format.MAT, Format.MAT_7_3, Format.JETI)


class Table(NamedTuple):
    """columns : by name, (n,) each, NaN where a cell has no number     left_out : sentences on data left out"""

    columns: Columns
    left_out: tuple[str, ...] = ()


def table_kind(path: Path) -> Format | None:
    """Return the format of a table (TEXT for CSV); None for other files. Raises InputError if it cannot be read."""
    file_format = format_of(path)
    if file_format is not Format.TEXT:
        return file_format if file_format in NO_LINES_OF_CELLS else None
    from flightpower.analysis.sources.table_text import layout_of  # loads pandas

    start = first_bytes(path)
    start = unpacked_start(path) if start.startswith(GZIP_MAGIC) else start
    try:
        return Format.TEXT if layout_of((text_of(start) or "").rpartition("\n")[0]) else None
    except InputError:  # its names are wrong, but it is a table
        return Format.TEXT


def read_columns(path: Path) -> Columns:
    """Return the columns from `read_table`."""
    return read_table(path).columns


def read_table(path: Path) -> Table:
    """Return numeric columns, and times as seconds since the first; names from a .mat structure include all its levels.

    Raises InputError, with a one-line message, if the file cannot be read.
    """
    kind = format_of(path)
    try:
        if kind is Format.TEXT:
            return Table(_csv(path))
        if kind is Format.PARQUET:
            import pandas as pd

            return Table(_numbers(pd.read_parquet(path)))
        if kind is Format.MAT:
            return _mat(path)
        if kind is Format.JETI:
            columns = read_jeti(_decoded(path.read_bytes()))
            return Table({name: x for name, x in columns.items() if np.isfinite(x).sum() >= READABLE.fewest_samples})
    except InputError:
        raise
    except Exception as error:  # damaged files lead to errors of many kinds
        cause = str(error).partition("\n")[0]
        raise InputError(f"{path}: cannot be read as {kind} ({type(error).__name__}: {cause})") from None
    raise refusal(path, "a table (CSV, Parquet or .mat)")


def _csv(path: Path) -> Columns:
    import pandas as pd

    from flightpower.analysis.sources.table_text import layout_of

    data = path.read_bytes()
    data = gzip.decompress(data) if data.startswith(GZIP_MAGIC) else data
    try:
        layout = layout_of(_decoded(data))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if layout is None:
        raise refusal(path)
    table = pd.read_csv(
        io.StringIO("\n".join(layout.rows)), sep=layout.separator, decimal=layout.decimal, header=None,
        names=list(layout.names), low_memory=False, index_col=False, skipinitialspace=True,
    )  # fmt: skip
    return _numbers(table)


def _decoded(data: bytes) -> str:
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _numbers(table: Any) -> Columns:
    """Return numeric columns, times as seconds since the first, and latitude and longitude from cells with both."""
    import pandas as pd

    from flightpower.analysis.sources.table_text import positions_of, seconds_of_times

    columns: dict[str, Any] = {}
    for name in map(str, table):
        column = table[name]
        if pd.api.types.is_datetime64_any_dtype(column):
            columns[name] = (column - column.min()).dt.total_seconds().to_numpy(dtype=np.float64)
        elif pd.api.types.is_numeric_dtype(column):
            columns[name] = column.to_numpy(dtype=np.float64, na_value=np.nan)
        else:
            numbers = pd.to_numeric(column, errors="coerce")
            if numbers.notna().mean() >= 0.5 * column.notna().mean():
                columns[name] = numbers.to_numpy(dtype=np.float64)
            elif (seconds := seconds_of_times(column)) is not None:
                columns[name] = seconds
            elif (positions := positions_of(column)) is not None:
                columns |= {f"{name} latitude": positions[0], f"{name} longitude": positions[1]}
    cleaned = {name: without_damage(x) for name, x in columns.items()}
    return {name: x for name, x in cleaned.items() if np.isfinite(x).sum() >= READABLE.fewest_samples}


def _mat(path: Path) -> Table:
    """Return vectors, and columns or rows of matrices. Structures with a clock each are put on the times of all clocks.

    With a single clock, columns of the most common length are used, and the others are named as left out.
    """
    vectors: dict[str, Array] = {}
    matrices: dict[str, Array] = {}
    others: list[str] = []

    def add(name: str, value: Any) -> None:
        if isinstance(value, dict):
            for field, inside in value.items():
                add(f"{name}.{field}", inside)
        elif isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number):
            if value.ndim == 1 and len(value) >= READABLE.fewest_samples:
                vectors[name] = without_damage(value)
            elif value.ndim == 2 and max(value.shape) >= READABLE.fewest_samples > min(value.shape):
                matrices[name] = without_damage(value)
            elif value.size >= READABLE.fewest_samples:
                others.append(f"{name} ({' x '.join(map(str, value.shape))})")

    variables = read_mat(path.read_bytes())
    if any("_mavlink_" in name for name in variables):
        raise InputError(
            f"{path}: telemetry that Mission Planner has written with times of its own for each field, which is not"
            " read: analyze the .tlog that it was made from"
        )
    for name, value in variables.items():
        add(name, value)
    for name, matrix in matrices.items():
        columns = matrix.T if len(matrix) == max(matrix.shape) else matrix
        vectors |= {f"{name}({i + 1})": column for i, column in enumerate(columns)}
    few = [name for name, value in vectors.items() if np.isfinite(value).sum() < READABLE.fewest_samples]
    others += [f"{name} (of {len(vectors.pop(name))} values too few are numbers)" for name in few]
    if not vectors:
        raise InputError(f"{path}: holds no vector of {READABLE.fewest_samples} numbers or more")
    if (merged := _at_times_of_all(vectors)) is not None:
        at_all_times, without_clock = merged
        others += [f"{name} ({len(vectors[name])} values)" for name in without_clock]
        left_out = (f"Left out, since they have no clock of their own: {', '.join(others)}",) if others else ()
        return Table(at_all_times, left_out)
    length = Counter(map(len, vectors.values())).most_common(1)[0][0]
    others += [f"{name} ({len(value)} values)" for name, value in vectors.items() if len(value) != length]
    left_out = (f"Left out, since they are no vectors of {length} values: {', '.join(others)}",) if others else ()
    return Table({name: value for name, value in vectors.items() if len(value) == length}, left_out)


def _at_times_of_all(vectors: Mapping[str, Array]) -> tuple[Columns, list[str]] | None:
    """Return vectors from structures with a clock each, at the times of all clocks; NaN except at their own times.

    Also return the names of vectors without a clock. Returns None unless two or more clocks of one name all overlap.
    """
    structures: dict[tuple[str, int], str] = {}
    for name, value in vectors.items():
        parent, _, leaf = name.rpartition(".")
        if CLOCK.fullmatch(leaf) and np.isfinite(value).all() and np.all(np.diff(value) > 0):
            structures.setdefault((parent, len(value)), name)
    leaves = Counter(name.rpartition(".")[2] for name in structures.values())
    leaf, count = leaves.most_common(1)[0] if leaves else ("", 0)
    clocks = {key: vectors[name] for key, name in structures.items() if name.rpartition(".")[2] == leaf}
    if count < 2 or max(clock[0] for clock in clocks.values()) >= min(clock[-1] for clock in clocks.values()):
        return None
    tick = 1e-3 * min(
        float(np.median(np.diff(clock))) for clock in clocks.values()
    )  # times that differ by less are the same time
    first = min(float(clock[0]) for clock in clocks.values())
    places = {key: np.round((clock - first) / tick) for key, clock in clocks.items()}
    at_all = np.unique(np.concatenate(list(places.values())))
    columns = {leaf: first + tick * at_all}
    without = []
    for name, value in vectors.items():
        key = (name.rpartition(".")[0], len(value))
        if key not in clocks:
            without.append(name)
        elif name != structures[key]:
            columns[name] = np.full(len(at_all), np.nan)
            columns[name][np.searchsorted(at_all, places[key])] = value
    return columns, without
