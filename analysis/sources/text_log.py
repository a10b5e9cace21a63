"""Reads an ArduPilot log that a ground station has converted to text (.log), by pymavlink."""

import contextlib
import io
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink import DFReader

from flightpower.analysis.sources.dataflash import Form
from flightpower.flight.units import number_or_nan

TEXTS, ARRAYS = "nNZ", "a"  # codes of fields that hold texts or arrays


class _Reader(DFReader.DFReader_text):  # type: ignore[misc]
    """Keeps the times of the log, because pymavlink's clock needs GPS fields that not all logs have."""

    def init_clock(self) -> None:
        self.clock = None


class TextLog:
    """The messages of a file by kind, as `dataflash.DataflashLog` gives them. kinds : to read; empty means all.

    Raises ValueError if the file has no messages.
    """

    notes = ()

    def __init__(self, path: Path, kinds: tuple[str, ...]):
        self._rows: dict[str, list[Any]] = defaultdict(list)
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                reader = _Reader(str(path))
                with reader.filehandle:
                    while (message := reader.recv_match(type=set(kinds) or None)) is not None:
                        self._rows[message.get_type()].append(message)
        except Exception as error:  # altered lines lead to errors of many kinds
            if not self._rows:
                raise ValueError(f"{type(error).__name__} in its text") from None
        self._formats = {name: rows[0].fmt for name, rows in self._rows.items()}

    def names(self) -> list[str]:
        """Return the kinds of message that the log holds."""
        return list(self._rows)

    def form(self, name: str) -> Form | None:
        """Return the fields of messages of a name; None if the log has none."""
        form = self._formats.get(name)
        return None if form is None else Form(form.type, tuple(form.columns), form.format)

    def columns(self, name: str) -> dict[str, NDArray[Any]]:
        """Return the fields of all messages of a name, (n,): numbers as float64, texts as bytes, without arrays."""
        form = self._formats.get(name)
        if form is None:
            return {}
        out: dict[str, NDArray[Any]] = {}
        for field, code in zip(form.columns, form.format, strict=False):
            values = [_value(row, field) for row in self._rows[name]]
            if code in TEXTS:
                out[field] = np.array([str(x).encode("ascii", "replace") for x in values])
            elif code not in ARRAYS:
                out[field] = np.array([number_or_nan(x) for x in values])  # a damaged definition can give texts
        return out


def _value(message: Any, field: str) -> Any:
    """Return a field's value; NaN if the line, or the definition of its message, is damaged."""
    try:
        return getattr(message, field)
    except (ValueError, AttributeError, IndexError):
        return np.nan
