"""Airspeed, angle of attack, pitch angle and height: the pitch angle comes from the gyro and the height."""

from typing import Any

from analysis.estimation.aircraft_models.forces import (
    CLq_with_prior,
    Constants,
    Priors,
    aerodynamic_parameters,
    climb_rate,
    gyro_bias,
    measured_air_data,
    measured_specific_force,
    sensor_parameters,
    thrust_parameters,
    wind_axis_derivative,
)
from analysis.estimation.aircraft_models.level_run import level_flight_state
from analysis.estimation.model import Model, NamedValues
from flight import motion
from flight.aircraft import Aircraft


def pitch_and_height(
    aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5, with_climb_rate: bool = False
) -> Model:
    """States V, alpha, theta, h: theta is the integral of the gyro with a free bias, and h is an output.

    Height determines the bias of alpha and the pitch angle, so that no attitude filter is needed. CLq has a prior,
    because level runs contain little information about it.
    with_climb_rate : hdot is an output too
    """
    c = Constants.of(aircraft)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        q = u.q - p.q_bias
        Vdot, alphadot = wind_axis_derivative(c, x.V, x.alpha, x.theta, q, u, p, J_ref)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, q, u.r)
        return Vdot, alphadot, thetadot, climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        y = (
            *measured_air_data(x, p),
            *measured_specific_force(c, x.V, x.alpha, u.q - p.q_bias, u, p, J_ref),
            x.h,
        )
        return (*y, climb_rate(x.V, x.alpha, x.theta, u)) if with_climb_rate else y

    return Model(
        name="pitch_and_height",
        states=("V", "alpha", "theta", "h"),
        inputs=("thrust", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az", "h", *(("hdot",) if with_climb_rate else ())),
        parameters=(
            *aerodynamic_parameters(c, priors),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=False),
            gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=level_flight_state,
    ).changed(CLq=CLq_with_prior(priors))
