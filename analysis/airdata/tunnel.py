"""The measurements of a wind-tunnel calibration of a five-port probe, and the CSV file that holds them."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight.atmosphere import density
from flight.errors import InputError
from flight.unit_columns import csv_rows, si_column

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TunnelData:
    """Measurements of a tunnel calibration in SI units, arrays (n,).

    dp_alpha_Pa : lower minus upper port     dp_beta_Pa : right minus left port     q_c_Pa : centre minus static
    """

    speed_mps: Array
    alpha_rad: Array
    beta_rad: Array
    dp_alpha_Pa: Array
    dp_beta_Pa: Array
    q_c_Pa: Array
    static_Pa: Array
    temperature_K: Array

    @property
    def C_alpha(self) -> Array:
        """dp_alpha/q_c [-], (n,)."""
        return self.dp_alpha_Pa / self.q_c_Pa

    @property
    def C_beta(self) -> Array:
        """dp_beta/q_c [-], (n,)."""
        return self.dp_beta_Pa / self.q_c_Pa


# Column of the file: (field, unit).
_COLUMNS = {
    "speed": ("speed_mps", "m/s"),
    "alpha": ("alpha_rad", "rad"),
    "beta": ("beta_rad", "rad"),
    "dp_alpha": ("dp_alpha_Pa", "Pa"),
    "dp_beta": ("dp_beta_Pa", "Pa"),
    "q_c": ("q_c_Pa", "Pa"),
    "static": ("static_Pa", "Pa"),
    "temperature": ("temperature_K", "K"),
}


def read_tunnel(path: str | Path) -> TunnelData:
    """The measurements in a CSV file whose header names each column with its unit, `alpha [deg]`.

    Raises InputError naming file and cause.
    """
    path = Path(path)
    rows = csv_rows(path)
    if len(rows) < 2:
        raise InputError(f"{path}: holds no measurements")
    header, *lines = rows
    values: dict[str, Array] = {}
    for i, title in enumerate(header):
        match = re.fullmatch(r"\s*(\w+)\s*\[(.+)\]\s*", title)
        if match is None or match[1] not in _COLUMNS:
            raise InputError(f"{path}: column {title!r}: must be one of {', '.join(_COLUMNS)}, followed by its [unit]")
        name, unit = _COLUMNS[match[1]]
        values[name] = si_column(lines, i, match[2], unit, f"{path}: {title}")
        wrong = ~np.isfinite(values[name])
        if wrong.any():
            first = ",".join(lines[int(wrong.argmax())])
            raise InputError(f"{path}: column {title!r}: not a number in every line; the first without: {first}")
    missing = [title for title, (name, _) in _COLUMNS.items() if name not in values]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}")
    return TunnelData(**values)


def dynamic_pressure(tunnel: TunnelData) -> Array:
    """Dynamic pressure of the free stream from speed and density [Pa], (n,)."""
    return np.asarray(density(tunnel.static_Pa, tunnel.temperature_K) * tunnel.speed_mps**2 / 2)
