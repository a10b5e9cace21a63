"""Polar, thrust and sensor errors of one flight with their joint covariance: what several flights are pooled from.

Other flights of the same aircraft share some of these. Their joint estimate needs how the polar changes with the sensor
errors (`docs/understand/pooling.md`).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from analysis.drag.covariance import DENSITY
from analysis.estimation.fit import Fit
from analysis.estimation.model import PriorMeasurement
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.priors import PRIOR_MEAN
from analysis.trajectory.reconstruction import Trajectory
from flight.arrays import Array


class JointEstimate(NamedTuple):
    """The estimate of one flight before the errors that no residual shows.

    names : (m,) parameters of the drag model, then SENSOR_ERRORS
    values (m,), covariance (m, m) : estimate and its covariance by noise and sensor errors, priors included
    weighting_covariance : (k, k) of the parameters of the drag model for given sensor errors, by white residuals and
        the priors; its inverse weighs data and priors in the estimate, whatever color the residuals have
    prior_mean, prior_sigma : (m,); infinite where there is no prior
    prior_measurements : that are part of the prior, too
    changes : by error, change (m,) of the values by one standard deviation of an error that no residual shows
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    weighting_covariance: Array
    prior_mean: Array
    prior_sigma: Array
    changes: dict[str, Array]
    prior_measurements: tuple[PriorMeasurement, ...] = ()

    def with_value(self, name: str, value: float) -> "JointEstimate":
        """The same with another value of one parameter: of an error that the data were corrected for, the whole."""
        return self._replace(values=np.where(np.array(self.names) == name, value, self.values))

    def with_changes(self, changes: Mapping[str, Array]) -> "JointEstimate":
        """The same with more such errors. changes: of the first values; those of the others are zero."""
        whole = {name: np.pad(change, (0, len(self.values) - len(change))) for name, change in changes.items()}
        return self._replace(changes=self.changes | whole)

    def with_density_error(self, change: Array, airspeed_scale: float) -> "JointEstimate":
        """The same with that error of the density. change: of the first values. airspeed_scale: change of V_scale."""
        whole = np.pad(change, (0, len(self.values) - len(change)))
        whole[self.names.index("V_scale")] = airspeed_scale
        return self._replace(changes=self.changes | {DENSITY: whole})


def joint_estimate(
    fit: Fit, noise: Array, prior_sigma: Array, changes_by_sensor_errors: Array, trajectory: Trajectory
) -> JointEstimate:
    """The joint estimate of the parameters of the drag model (k,) and of the sensor errors.

    noise : (k, k) covariance of the parameters for given sensor errors     prior_sigma : (k,)
    changes_by_sensor_errors : (k, s) of the parameters along the columns of the Cholesky factor of the sensor errors'
    covariance
    """
    names, values = fit.names, fit.values
    factor = np.linalg.cholesky(trajectory.covariance)
    cross = changes_by_sensor_errors @ factor.T
    parameters = noise + changes_by_sensor_errors @ changes_by_sensor_errors.T
    return JointEstimate(
        names=(*names, *SENSOR_ERRORS),
        values=np.concatenate([values, trajectory.sensor_errors]),
        covariance=np.block([[parameters, cross], [cross.T, trajectory.covariance]]),
        weighting_covariance=fit.covariance,
        prior_mean=np.array([PRIOR_MEAN.get(name, 0.0) for name in (*names, *SENSOR_ERRORS)]),
        prior_sigma=np.concatenate([prior_sigma, trajectory.prior_sigma]),
        changes={},
    )
