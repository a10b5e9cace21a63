"""Reads the columns of numbers of a CSV, Parquet or .mat file, which it recognizes by its content, not its suffix."""

import csv
import gzip
import io
from collections import Counter
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sources.autopilot_settings import READABLE
from analysis.sources.recognize import GZIP_MAGIC, first_bytes
from flight.arrays import Array
from flight.errors import InputError

Columns = Mapping[str, Array]


class TableKind(StrEnum):
    CSV = "CSV"
    PARQUET = "Parquet"
    MAT = ".mat"
    MAT_7_3 = ".mat of version 7.3"


MAGIC = {b"PAR1": TableKind.PARQUET, b"MATLAB 5.0": TableKind.MAT, b"MATLAB 7.3": TableKind.MAT_7_3}
SEPARATORS = (",", ";", "\t")


def table_kind(path: Path) -> TableKind | None:
    """By the first bytes; None where the file is no table. Raises InputError when it cannot be read."""
    start = first_bytes(path, 20_000)
    for magic, kind in MAGIC.items():
        if start.startswith(magic):
            return kind
    try:
        lines = [line for line in start.decode("utf-8-sig", "strict" if len(start) < 20_000 else "ignore").splitlines()]
    except UnicodeDecodeError:
        return None
    lines = [line for line in lines if line.strip() and not line.startswith("#")]
    if b"\0" in start or len(lines) < 3:
        return None
    return TableKind.CSV if lines[0].count(_separator(lines[0])) else None


def read_columns(path: Path) -> Columns:
    """By name, (n,) each, NaN where a cell holds no number; of structures in a .mat, with the names of all levels.

    Raises InputError, in one line, when the file cannot be read.
    """
    kind = table_kind(path)
    try:
        if kind is TableKind.CSV:
            return _csv(path)
        if kind is TableKind.PARQUET:
            import pandas as pd

            return _numbers(pd.read_parquet(path))
        if kind is TableKind.MAT:
            return _mat(path)
    except InputError:
        raise
    except Exception as error:  # damaged files lead to errors of many kinds
        cause = str(error).partition("\n")[0]
        raise InputError(f"{path}: cannot be read as {kind} ({type(error).__name__}: {cause})") from None
    if kind is TableKind.MAT_7_3:
        raise InputError(
            f"{path}: a .mat file of version 7.3, which this program does not read; in MATLAB: save(file, '-v7')"
        )
    raise InputError(f"{path}: neither CSV, Parquet nor a .mat file")


def _separator(line: str) -> str:
    return max(SEPARATORS, key=line.count)


def _csv(path: Path) -> Columns:
    """A line of units below the names becomes part of the names: `airspeed [m/s]`."""
    import pandas as pd

    data = path.read_bytes()
    text = (gzip.decompress(data) if data.startswith(GZIP_MAGIC) else data).decode("utf-8-sig", "replace")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    separator = _separator(lines[0])
    names, second = (next(csv.reader([line], delimiter=separator)) for line in lines[:2])
    units = not any(_is_number(cell) for cell in second) and any(cell.strip() for cell in second)
    if units:
        names = [f"{name} [{unit.strip('[]() ')}]" for name, unit in zip(names, second, strict=False)]
    decimal = "," if separator != "," and text.count(",") > 0 and "." not in lines[-1] else "."
    table = pd.read_csv(
        io.StringIO("\n".join(lines[2 if units else 1 :])),
        sep=separator, decimal=decimal, header=None, names=[name.strip() for name in names], low_memory=False,
        index_col=False,
    )  # fmt: skip
    return _numbers(table)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(table: Any) -> Columns:
    """Columns of numbers, and those of dates as seconds since the first."""
    import pandas as pd

    out: dict[str, Array] = {}
    for name in table:
        column = table[name]
        if not pd.api.types.is_numeric_dtype(column):
            numbers = pd.to_numeric(column, errors="coerce")
            if numbers.notna().mean() < 0.5 * column.notna().mean():
                dates = pd.to_datetime(column, errors="coerce", utc=True, format="ISO8601")
                numbers = (dates - dates.min()).dt.total_seconds()
            column = numbers
        if column.notna().sum() >= READABLE.fewest_samples:
            out[str(name)] = column.to_numpy(dtype=np.float64)
    return out


def _mat(path: Path) -> Columns:
    """Vectors of the length that most have; others belong to another time base."""
    from scipy.io import loadmat

    found: dict[str, Array] = {}

    def add(name: str, value: Any) -> None:
        if hasattr(value, "_fieldnames"):
            for field in value._fieldnames:
                add(f"{name}.{field}", getattr(value, field))
        elif isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number):
            if value.ndim == 1 and len(value) >= READABLE.fewest_samples:
                found[name] = value.astype(np.float64)
            elif value.ndim == 2 and len(value) >= READABLE.fewest_samples and value.shape[1] <= 20:
                found.update({f"{name}({i + 1})": column.astype(np.float64) for i, column in enumerate(value.T)})

    for name, value in loadmat(path, squeeze_me=True, struct_as_record=False).items():
        if not name.startswith("__"):
            add(name, value)
    if not found:
        raise InputError(f"{path}: holds no vector of {READABLE.fewest_samples} numbers or more")
    length = Counter(map(len, found.values())).most_common(1)[0][0]
    return {name: value for name, value in found.items() if len(value) == length}
