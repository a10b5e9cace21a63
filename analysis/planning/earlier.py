"""What a plan takes from earlier flights: drag, and information about the sensor errors of the installation."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.planning.questions import INSTALLATION
from analysis.results.schema import FORMAT, Results
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.observability import TITLES
from flight.errors import InputError
from flight.json_file import JsonFormat, json_object_text

Array = NDArray[np.float64]


def read_results(path: Path) -> Results:
    """A results.json. Raises InputError when it is something else."""
    of = "results of `analyze`"
    return JsonFormat(Results, (FORMAT,), of).parsed(json_object_text(path, of), str(path))


def polar(results: Sequence[Results]) -> Array | None:
    """A0, A1, A2 of the last flight that has a drag polar; None without one."""
    known = [found.drag_polar for found in results if found.drag_polar is not None]
    return np.array([known[-1].A0, known[-1].A1, known[-1].A2]) if known else None


def information(results: Sequence[Results]) -> Array | None:
    """Information (m, m) of the flights about the errors that stay with the installation; None without any.

    What each flight knew beyond the prior, each error by itself: results.json has no correlations.
    """
    total = np.zeros((len(SENSOR_ERRORS), len(SENSOR_ERRORS)))
    for found in results:
        if found.path is None:
            raise InputError(f"{found.log}: these results have no sensor errors, so a plan cannot begin with them")
        for error in found.path.sensor_errors:
            if error.name in INSTALLATION:
                i, factor = SENSOR_ERRORS.index(error.name), TITLES[error.name][1]
                gained = (factor / error.standard_error) ** 2 - (factor / error.assumed_sigma) ** 2
                total[i, i] += max(gained, 0.0)
    return total if results else None
