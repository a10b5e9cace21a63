"""Does the power of the flights change with date, temperature or battery voltage?"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from analysis.pooling.flight_statistics import FlightStatistics

Array = NDArray[np.float64]

FEWEST_FLIGHTS = 4
DAY_S = 86400.0


class Trend(NamedTuple):
    """Change of power per unit of a quantity, in percent, with its standard error.

    p : probability of a slope this far from zero without a trend     flights : with this quantity
    """

    quantity: str
    unit: str
    slope_percent: float
    standard_error_percent: float
    p: float
    flights: int


def trends(flights: Sequence[FlightStatistics], deviations_percent: Array, covariance: Array) -> list[Trend]:
    """By generalized least squares. deviations_percent (n,): of each flight from a common curve, covariance (n, n).

    Quantities that fewer than FEWEST_FLIGHTS have, or that are the same in all, are left out.
    """
    found = []
    for quantity, unit, values in (
        ("date", "day", [_number(f.results["pooling"].get("start_unix_s")) / DAY_S for f in flights]),
        ("air temperature", "K", [_number(f.results.get("air_temperature_K")) for f in flights]),
        ("battery voltage", "V", [_number(f.results["pooling"].get("battery_V")) for f in flights]),
    ):
        x = np.array(values)
        known = np.isfinite(x)
        if known.sum() < FEWEST_FLIGHTS or np.ptp(x[known]) < 1e-9 * np.abs(x[known]).max():
            continue
        X = np.stack([np.ones(known.sum()), x[known] - x[known].mean()], axis=1)
        weights = np.linalg.inv(covariance[np.ix_(known, known)])
        C = np.linalg.inv(X.T @ weights @ X)
        slope, error = float((C @ X.T @ weights @ deviations_percent[known])[1]), float(np.sqrt(C[1, 1]))
        found.append(Trend(quantity, unit, slope, error, float(2 * norm.sf(abs(slope / error))), int(known.sum())))
    return found


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
