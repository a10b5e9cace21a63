"""Tables as CSV, Parquet and MATLAB files."""

import re
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from analysis.files import write_file
from flight.errors import InputError

LONGEST_NAME = 63  # of a variable or field in MATLAB
INDEX = "t_s"


def write_csv(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """One CSV file a table, `folder`/NAME.csv. Raises InputError when the folder cannot be written."""
    for name, table in tables.items():
        text = _flat(table).to_csv(index=False, float_format="%.9g", lineterminator="\n")
        write_file(folder / f"{name}.csv", text)


def write_parquet(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """One Parquet file a table, `folder`/NAME.parquet. Raises InputError when it cannot be written."""
    try:
        import pyarrow  # noqa: F401
    except ModuleNotFoundError:
        raise InputError('Parquet needs pyarrow; run: pip install pyarrow, or export with "--to csv"') from None
    for name, table in tables.items():
        stream = BytesIO()
        _flat(table).to_parquet(stream, index=False)
        write_file(folder / f"{name}.parquet", stream.getvalue())


def write_mat(tables: Mapping[str, pd.DataFrame], path: Path) -> None:
    """A MATLAB file (version 5) with a struct a table, whose fields are column vectors.

    Texts are cell arrays; Boolean values are 0 and 1. Raises InputError when the file cannot be written.
    """
    from scipy.io import savemat

    structs = {
        name: {matlab_name(column): _column(values) for column, values in _flat(table).items()}
        for name, table in tables.items()
    }
    stream = BytesIO()
    savemat(cast(Any, stream), structs, long_field_names=True, oned_as="column", do_compression=True)
    write_file(path, stream.getvalue())


def matlab_name(column: Any) -> str:
    """The name of a column as MATLAB permits it: letters, digits and underscores."""
    return re.sub(r"\W", "_", str(column))[:LONGEST_NAME]


def _column(values: pd.Series) -> np.ndarray:
    if values.dtype == bool:
        return values.to_numpy(dtype=np.uint8)
    return values.to_numpy(dtype=float) if pd.api.types.is_numeric_dtype(values) else values.to_numpy(dtype=object)


def _flat(table: pd.DataFrame) -> pd.DataFrame:
    """The table with its time, if it has one, as the first column."""
    return table.reset_index() if table.index.name == INDEX else table


WRITERS: dict[str, Callable[[Mapping[str, pd.DataFrame], Path], None]] = {
    "csv": write_csv,
    "parquet": write_parquet,
    "mat": write_mat,
}
