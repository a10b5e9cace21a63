"""Do the estimated sensor errors fit their priors? Where they do not, the priors are too narrow, and so are intervals.

All errors here are in prior standard deviations, so that the prior's information is 1 in every direction. In a
direction in which the data have the information j, the data alone would give x = y (1 + j)/j in place of the estimate
y. If the prior is right, x is normal with variance 1 + 1/j. If all sensor errors are larger than their priors by the
same factor s, the variance is s^2 + 1/j; s is estimated by maximum likelihood (empirical Bayes; Box 1980, J. R. Stat.
Soc. A 143, 383, for the test).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.observability import TITLES
from analysis.trajectory.priors import PRIOR_MEAN
from analysis.trajectory.reconstruction import Trajectory
from analysis.trajectory.smoother import StatesGivenErrors

Array = NDArray[np.float64]

CONFLICT = 2.5  # prior standard deviations
FALSE_ALARM_RATE = 0.01  # of the test of all sensor errors together
LEAST_INFORMATION = 0.1  # of the data in a direction, over the prior's (j): below it the direction is not tested
FACTORS = np.linspace(1.0, 6.0, 501)
LARGEST_RMS = 1.5  # of residuals, in standard deviations: 1.0 to 1.1 in calm air on the study's budget, less in gusts
MISFIT = {
    "V": "airspeed",
    "alpha": "angle of attack",
    "beta": "sideslip",
    "height": "height",
    "gps_north": "GPS north",
    "gps_east": "GPS east",
}


class PriorConflict(NamedTuple):
    """factor : (m,) on the prior standard deviations, order of SENSOR_ERRORS; 1 where there is no conflict

    beyond : by sensor error, the estimate less the prior's mean in prior standard deviations, where beyond CONFLICT
    together : factor by which all of them are larger than their priors; 1 where there is no conflict
    """

    factor: Array
    beyond: dict[str, float]
    together: float

    @property
    def found(self) -> bool:
        return bool(np.any(self.factor > 1))


def prior_conflict(trajectory: Trajectory) -> PriorConflict:
    """The conflict of a trajectory's sensor errors with their priors."""
    sigma = trajectory.prior_sigma
    y = (trajectory.sensor_errors - [PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS]) / sigma
    posterior, directions = np.linalg.eigh(trajectory.covariance / np.outer(sigma, sigma))
    j = 1 / np.clip(posterior, 1e-12, 1.0) - 1
    known = j > LEAST_INFORMATION
    variance, x_squared = 1 / j[known], ((directions.T @ y)[known] * (1 + 1 / j[known])) ** 2
    beyond = {name: float(value) for name, value in zip(SENSOR_ERRORS, y, strict=True) if abs(value) > CONFLICT}
    together = 1.0
    if beyond or np.sum(x_squared / (1 + variance)) > special.chdtri(max(known.sum(), 1), FALSE_ALARM_RATE):
        total = FACTORS[:, None] ** 2 + variance
        together = float(FACTORS[np.argmin(np.sum(np.log(total) + x_squared / total, axis=1))])
    factor = np.maximum(together, np.where(np.abs(y) > CONFLICT, np.abs(y), 1.0))
    return PriorConflict(factor, beyond, together)


def conflict_notes(conflict: PriorConflict, trajectory: Trajectory) -> list[str]:
    """What conflicts, for the reader. trajectory: the one that the conflict was found in."""
    if not conflict.found:
        return []
    named = [
        f"the {title} is {value:+.1f} standard deviations ({factor * trajectory.prior_standard_error(name):.2g} {unit})"
        for name, value in conflict.beyond.items()
        for title, factor, unit in [TITLES[name]]
    ]
    what = "; ".join(named) or f"by a factor of {conflict.together:.1f} in all"
    return [
        f"The sensor errors are larger than assumed before the flight: {what}. The estimate was repeated with larger"
        " standard deviations, and the interval is wider. Check probe, tubes, tray, and the files that describe them."
    ]


def misfit(trajectory: Trajectory) -> dict[str, float]:
    """By measurement, rms of its residuals in standard deviations where it is beyond LARGEST_RMS."""
    return {name: rms for name, rms in trajectory.residuals.items() if name in MISFIT and rms > LARGEST_RMS}


def with_misfit(trajectory: Trajectory) -> tuple[Trajectory, list[str]]:
    """The trajectory, less certain where residuals are larger than noise and gusts allow, and a warning of it."""
    beyond = misfit(trajectory)
    if not beyond:
        return trajectory, []
    worst = max(beyond.values())
    wider = replace(
        trajectory,
        covariance=trajectory.covariance * worst**2,
        prior_sigma=trajectory.prior_sigma * worst,  # so that the prior's information remains a part of the estimate's
        draws=trajectory.draws * worst,
        states_given_errors=StatesGivenErrors(trajectory.states_given_errors.factor / worst),
    )
    named = "; ".join(f"{MISFIT[name]} by {rms:.1f}" for name, rms in beyond.items())
    return wider, [
        f"Residuals of the flight path are larger than noise and gusts allow: {named}. The interval is wider by that"
        " factor. Check the sensor, its line and its calibration."
    ]
