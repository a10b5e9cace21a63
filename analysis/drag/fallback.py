"""The power curve of a flight without accelerations and decelerations: that of another method."""

import numpy as np

from analysis.drag.direct import VARIED_LIFT
from analysis.drag.dynamic import THRUST, DynamicEstimate, parameter_list
from analysis.drag.method import MethodEstimate
from analysis.drag.piw_viw import PIW_VIW_THREE
from analysis.drag.sensor_errors import error_prior_sigma
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Uncertainty
from flight.errors import InputError


def fallback(
    estimates: list[MethodEstimate], trajectory: Trajectory, uncertainty: Uncertainty, log: str
) -> tuple[DynamicEstimate, tuple[float, float]]:
    """The polar from steady points, else from roller coasters and wind-up turns, and its range of lift coefficients.

    It has the form of the dynamic method's estimate; the corrections of thrust are zero, with their prior covariance.
    Raises InputError, beginning with `log`, with the reasons when neither gives a polar.
    """
    by_method = {estimate.method.name: estimate for estimate in estimates}
    candidates = [by_method[PIW_VIW_THREE.name], by_method[VARIED_LIFT.name]]
    best = next((one for one in candidates if one.polar is not None and one.polar.A[2] > 0), None)
    if best is None or best.polar is None:
        reasons = "; ".join(f"{one.method.title}: {', '.join(one.notes)}" for one in candidates)
        raise InputError(
            f"{log}: no acceleration or deceleration to analyse, and no polar from other maneuvers: {reasons}"
        )
    noise, systematic = np.zeros((5, 5)), np.zeros((5, 5))
    noise[:3, :3], systematic[:3, :3] = best.noise, best.systematic
    sigma = error_prior_sigma(uncertainty)
    for i, name in enumerate(THRUST, start=3):
        variance = sigma[name] ** 2
        systematic[i, i] = variance
        systematic[:3, i] = systematic[i, :3] = best.sensitivities[name] * variance
    values = np.concatenate([best.polar.A, [0.0, 0.0]])
    warning = f"No acceleration or deceleration was flown: the curve is from another method, {best.method.title}."
    verdict = f"by {best.method.title}" if trajectory.converged else "the trajectory did not converge"
    parameters = parameter_list(values, noise + systematic, trajectory)
    return DynamicEstimate(best.polar, parameters, verdict, [warning], [], values, noise, systematic), best.flown_CL
