"""What `results.json` holds of a flight for the joint estimate of several flights (docs/understand/pooling.md)."""

import hashlib

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.flight_data import Calibrations
from analysis.drag.dynamic import DynamicEstimate
from analysis.results.settings import RESULTS
from analysis.schema import PoolingStatistics, PriorMeasurementStatistics
from flight.aircraft import Aircraft
from flight.log_reader import Log
from flight.propeller import Propeller


def pooling_statistics(
    estimate: DynamicEstimate,
    flown_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    calibrations: Calibrations,
) -> PoolingStatistics | None:
    """None for an estimate by another method than the dynamic one, which has no sensor errors beside it."""
    joint = estimate.joint
    if joint is None:
        return None
    return PoolingStatistics(
        names=list(joint.names),
        values=joint.values.tolist(),
        covariance=_lower_triangle(joint.covariance),
        weighting_covariance=_lower_triangle(joint.weighting_covariance),
        prior_mean=joint.prior_mean.tolist(),
        prior_sigma=[float(sigma) if np.isfinite(sigma) else None for sigma in joint.prior_sigma],
        prior_measurements=[
            PriorMeasurementStatistics(
                name=one.name, coefficients=dict(one.coefficients), value=one.value, sigma=one.sigma
            )
            for one in joint.prior_measurements
        ]
        or msgspec.UNSET,
        changes={name: change.tolist() for name, change in joint.changes.items() if np.any(change)},
        polar_covariance=estimate.polar.covariance.tolist(),
        flown_CL=flown_CL,
        installation=aircraft.installation.name,
        propeller_table=_fingerprint(
            repr((propeller.diameter_m, propeller.beyond_zero_thrust, propeller.rows)).encode()
        ),
        probe_calibration=_fingerprint(
            msgspec.json.encode(calibrations.probe)
            + (msgspec.json.encode(calibrations.transducers) if calibrations.transducers else b"")
        ),
    )


def start_unix_s(log: Log) -> float | None:
    """Time of the first message; None where the clock had not been set."""
    start_s = min(entries[0].time_ns for entries in log.entries.values() if entries) / 1e9
    return start_s if start_s > RESULTS.clock_set_unix_s else None


def mean_battery_V(rows_flown: pd.DataFrame) -> float | None:
    """Mean voltage of the battery over the runs; None where it was not measured. rows_flown: of `air_data`."""
    if "battery_V" not in rows_flown or rows_flown["battery_V"].isna().all():
        return None
    return float(rows_flown["battery_V"].mean())


def _lower_triangle(matrix: NDArray[np.float64]) -> list[list[float]]:
    return [row[: i + 1] for i, row in enumerate(matrix.tolist())]


def _fingerprint(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]
