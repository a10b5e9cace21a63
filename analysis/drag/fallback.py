"""The power curve of a flight without accelerations and decelerations: that of another method."""

import numpy as np

from analysis.drag.direct import VARIED_LIFT
from analysis.drag.dynamic import DynamicEstimate, parameter_list
from analysis.drag.method import MethodEstimate
from analysis.drag.piw_viw import PIW_VIW_THREE
from analysis.drag.polar import Polar
from analysis.drag.thrust_prior import THRUST, thrust_prior
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError


def fallback(
    estimates: list[MethodEstimate], trajectory: Trajectory, aircraft: Aircraft, log: str
) -> tuple[DynamicEstimate, tuple[float, float]]:
    """The polar from steady points, else from roller coasters and wind-up turns, and its range of lift coefficients.

    It has the form of the dynamic method's estimate; the corrections of thrust are those of their prior.
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
    # The method's own covariance is that of independent errors of the table.
    prior = thrust_prior(aircraft)
    sensitivity = np.stack([best.sensitivities[name] for name in THRUST], axis=1)
    independent = np.diag([aircraft.uncertainty.thrust_scale_fraction**2, aircraft.uncertainty.thrust_slope**2])
    by_stand = sensitivity @ (prior.covariance - independent) @ sensitivity.T
    systematic[:3, :3] += by_stand
    systematic[3:, 3:] = prior.covariance
    systematic[:3, 3:] = sensitivity @ prior.covariance
    systematic[3:, :3] = systematic[:3, 3:].T
    polar = Polar(best.polar.A + sensitivity @ prior.mean, best.polar.covariance + by_stand)
    values = np.concatenate([polar.A, prior.mean])
    warning = f"No acceleration or deceleration was flown: the curve is from another method, {best.method.title}."
    verdict = f"by {best.method.title}" if trajectory.converged else "the trajectory did not converge"
    parameters = parameter_list(values, noise + systematic, trajectory)
    return DynamicEstimate(polar, parameters, verdict, [warning], [], values, noise, systematic), best.flown_CL
