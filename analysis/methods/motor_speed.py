"""Motor speed that is counted wrong, because pulses are lost above some speed or the number of poles is wrong.

The table's thrust varies as the square of motor speed. Accelerations are flown with fast motors and decelerations with
slow motors, at the same airspeeds. An error of the counter above some motor speed therefore makes a step of drag
between them, which scale and slope of thrust cannot describe. Every flight is tested for an error above each of several
motor speeds, and above zero, which means a wrong number of poles. An error that the flight shows beyond doubt is
corrected and estimated with the other parameters.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import Model, NamedValues, Parameter
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.forces import THRUST_BY_MOTOR_SPEED, FlightForces, MotorSpeedError
from flightpower.analysis.methods.settings import MOTOR_SPEED

PARAMETER = "motor_speed"


def suspect(fit: Fit, flight_forces: FlightForces) -> MotorSpeedError | None:
    """The error of motor speed that the runs show most clearly, by a linear estimate; None if none improves the fit.

    fit: fit of the drag model along the nominal forces, without such an error
    """
    forces = flight_forces.nominal
    rows = np.concatenate([np.searchsorted(forces.index, segment_fit.segment.t_s) for segment_fit in fit.segment_fits])
    n, by_speed = (np.nan_to_num(x)[rows] for x in (forces["n"].to_numpy(), flight_forces.by_motor_speed(forces)))
    sigma = float(np.sqrt(fit.noise_covariance.item()))
    residuals = (
        np.concatenate([fit.residuals[segment_fit.segment.name][:, 0] for segment_fit in fit.segment_fits]) / sigma
    )
    others, first = np.zeros((len(residuals), len(fit.names))), 0
    for segment_fit in fit.segment_fits:
        others[first : first + len(segment_fit.segment), segment_fit.columns] = segment_fit.white.S[:, 0]
        first += len(segment_fit.segment)
    best, most = None, 0.0
    for above in (0.0, *np.quantile(n, MOTOR_SPEED.tested)):
        column = np.where(np.isfinite(residuals), -by_speed * (n > above) / sigma, 0.0)
        with_others = others.T @ column
        left_information = column @ column - with_others @ fit.covariance @ with_others
        information = float(left_information) + MOTOR_SPEED.least_pole_share**-2
        score = float(column @ np.nan_to_num(residuals))
        gain, error = score**2 / information, MotorSpeedError(float(above), score / information)
        if gain > most and (error.share > 0 or error.by_poles):  # pulses are lost, not added
            best, most = error, gain
    return best


def with_motor_speed(model: Model) -> Model:
    """The drag model with the remaining error of motor speed, as a fraction of motor speed, as another parameter."""
    share = Parameter(name=PARAMETER, start=0.0, prior_sigma=MOTOR_SPEED.least_pole_share)
    return with_thrust_error(model, THRUST_BY_MOTOR_SPEED, share)


def with_thrust_error(model: Model, derivative: str, parameter: Parameter) -> Model:
    """The drag model with another error that raises thrust. derivative: the input d(thrust/mass)/d(error)"""

    def drag(x: NamedValues, u: NamedValues, p: NamedValues) -> Sequence[Any]:
        (without,) = model.output_function(x, u, p)
        return (without - getattr(u, derivative) * getattr(p, parameter.name),)

    return replace(
        model,
        name=f"{model.name}, {parameter.name.replace('_', ' ')}",
        inputs=(*model.inputs, derivative),
        output_function=drag,
        parameters=(*model.parameters, parameter),
    )


def value_and_error(fit: Fit, name: str) -> tuple[float, float]:
    """The estimate of a parameter, and its standard error by noise."""
    i = fit.names.index(name)
    return float(fit.values[i]), float(np.sqrt(covariance.of_noise(fit)[i, i]))
