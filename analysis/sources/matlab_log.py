"""Reads an ArduPilot log that Mission Planner or mavlogdump.py has converted to a .mat file.

Mission Planner writes a matrix for each kind of message, its column names in a cell array called the same plus
`_label`, and the parameters in a cell array of two columns. mavlogdump.py writes a structure of vectors for each kind.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources.mat_file import read_mat
from flightpower.flight.units import number_or_nan

CLOCKS = ("TimeUS", "TimeMS", "T")  # fields with a message's time; having one distinguishes a log from other structures
LABEL = "_label"


def is_matlab_log(path: Path) -> bool:
    """Return whether a .mat file has the messages of a log; False if it cannot be read."""
    return bool(_messages(path, ("ARSP", "BARO", "BAT", "CURR", "GPS", "IMU")))


class MatlabLog:
    """The messages of a file by kind, as `dataflash.DataflashLog` gives them. kinds : to read; empty means all."""

    notes = ("The log was converted to a .mat file, which drops part of the log: analyze the .BIN to see all of it.",)

    def __init__(self, path: Path, kinds: tuple[str, ...]):
        self._messages = _messages(path, kinds)

    def form(self, name: str) -> None:
        """Return nothing: messages in a .mat file are not packed and need no scaling."""

    def names(self) -> list[str]:
        """Return the kinds of message that the file holds."""
        return list(self._messages)

    def columns(self, name: str) -> dict[str, NDArray[Any]]:
        """Return the fields of all messages of a name, (n,): numbers as float64, texts as bytes."""
        return self._messages.get(name, {})


def _messages(path: Path, kinds: tuple[str, ...]) -> dict[str, dict[str, NDArray[Any]]]:
    try:
        variables = read_mat(path.read_bytes())
    except Exception:  # damaged files lead to errors of many kinds
        return {}
    kinds = kinds or tuple(name for name in variables if not name.startswith("__") and not name.endswith(LABEL))
    messages = {kind: _columns(variables[kind], variables.get(kind + LABEL)) for kind in kinds if kind in variables}
    return {kind: columns for kind, columns in messages.items() if columns}


def _columns(value: Any, labels: Any) -> dict[str, NDArray[Any]]:
    """Return the columns of a labeled matrix, a structure, or the list of parameters; empty for any other value."""
    if isinstance(value, np.ndarray) and value.ndim == 1 and (value.dtype == object or labels is not None):
        value = value[None]  # only one message, or one parameter
    if isinstance(value, np.ndarray) and value.dtype == object and value.ndim == 2 and value.shape[1] == 2:
        return {"Name": _texts(value[:, 0]), "Value": np.array([number_or_nan(x) for x in value[:, 1]])}
    if isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiu" and labels is not None:
        label_array = np.atleast_1d(labels)
        names = [_text(name).strip() for name in label_array] if label_array.shape == value.shape[1:] else []
        if len(set(names)) == value.shape[1]:
            return _timed(dict(zip(names, value.T.astype(np.float64), strict=True)))
    if isinstance(value, dict):
        fields = {name: np.atleast_1d(inside) for name, inside in value.items() if inside is not None}
        vectors = {name: x if x.dtype.kind in "fiu" else _texts(x) for name, x in fields.items() if x.ndim == 1}
        return _timed({name: x if x.dtype.kind == "S" else x.astype(np.float64) for name, x in vectors.items()})
    return {}


def _timed(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns if they include a clock and all have its length; otherwise none."""
    clock = next((columns[name] for name in CLOCKS if name in columns), np.zeros(0))
    return columns if len(clock) and all(len(x) == len(clock) for x in columns.values()) else {}


def _texts(values: Any) -> NDArray[np.bytes_]:
    return np.array([_text(x).rstrip().encode("ascii", "replace") for x in values])


def _text(value: Any) -> str:
    """Return a text; empty for the cells and matrices of a damaged file, which NumPy takes long to print."""
    return str(value) if isinstance(value, str | int | float) else ""
