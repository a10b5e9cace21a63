"""Columns of the methods' table over single runs."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers.kinds import Maneuver
from flight.errors import InputError

Array = NDArray[np.float64]

SHORTEST = 10  # blocks of a run


class RunData(NamedTuple):
    """A run, its times (n,) [s], and columns of the table over it by name, each (n,)."""

    run: Maneuver
    t_s: Array
    columns: dict[str, Array]


def run_data(table: pd.DataFrame, runs: list[Maneuver], columns: tuple[str, ...]) -> list[RunData]:
    """The columns over each run, gaps interpolated. Raises InputError when no run has all columns."""
    t, values = table.index.to_numpy(), np.stack([table[name].to_numpy() for name in columns], axis=1)
    found = []
    for run in runs:
        rows = slice(*np.searchsorted(t, (run.start_s, np.nextafter(run.end_s, np.inf))))
        data = values[rows]
        if not np.isfinite(data).all():
            data = pd.DataFrame(data).interpolate(limit_direction="both").to_numpy()
        if len(data) >= SHORTEST and np.isfinite(data).all():
            found.append(RunData(run, t[rows], dict(zip(columns, data.T, strict=True))))
    if not found:
        raise InputError("no run has all the required data")
    return found
