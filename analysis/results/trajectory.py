"""The trajectory and the sensor errors in the form of `results.json`."""

import numpy as np

from analysis.schema import Check, ConsistencyCheck, PathResult, SensorError
from analysis.trajectory.consistency import ANGLES, SPEED, Consistency, difference_statistics
from analysis.trajectory.observability import SensorErrorEstimate
from analysis.trajectory.reconstruction import Trajectory

_CHECKS = (
    (ANGLES, "pitch attitude less angle of attack less climb angle, wings level", float(np.degrees(1.0)), "deg"),
    (SPEED, "airspeed less GPS ground speed with the wind taken out", 1.0, "m/s"),
)


def trajectory_result(trajectory: Trajectory, agreement: Consistency, errors: list[SensorErrorEstimate]) -> PathResult:
    """Quality of the trajectory, agreement of channels and sensor errors."""
    checks = []
    for column, title, factor, unit in _CHECKS:
        both = [difference_statistics(factor * differences[column]) for differences in agreement]
        measured_checks = [
            Check(title=title, unit=unit, mean=s.mean, mean_standard_error=s.standard_error, sigma=s.sigma)
            for s in both
            if s is not None
        ]
        if len(measured_checks) == len(both):
            checks.append(ConsistencyCheck(before=measured_checks[0], after=measured_checks[1]))
    return PathResult(
        converged=trajectory.converged,
        gust_mps=trajectory.gust_mps,
        residuals=trajectory.residuals,
        checks=checks,
        sensor_errors=[
            SensorError(
                name=e.name, title=e.title, value=e.value, standard_error=e.standard_error, assumed_sigma=e.prior_sigma,
                unit=e.unit, determined=e.determined, missing=list(e.missing),
            )
            for e in errors
        ],
    )  # fmt: skip
