"""Longitudinal motion with pitching moment, for elevator inputs such as the 3-2-1-1."""

from typing import Any

import numpy as np

from analysis.estimation.aircraft_models.forces import (
    Constants,
    Priors,
    aerodynamic_parameters,
    climb_rate,
    gyro_bias,
    lift_slope,
    measured_air_data,
    measured_specific_force,
    reduced_pitch_rate,
    sensor_parameters,
    thrust_parameters,
    wind_axis_derivative,
)
from analysis.estimation.aircraft_models.level_run import level_flight_state
from analysis.estimation.model import Model, NamedValues, Parameter
from flight import motion
from flight.aircraft import Aircraft
from flight.errors import InputError


def longitudinal(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """States V, alpha, theta, q, h; outputs V, alpha, q, ax, az, h.

    With pitching moment Cm0, Cma, Cmq, Cmde and CLq. CLde is free without a prior, because an elevator input separates
    the effects of elevator and angle of attack. Raises InputError when the aircraft file lacks the moments of inertia.
    """
    c = Constants.of(aircraft)
    inertia = c.inertia
    if inertia is None:
        raise InputError(
            f"{aircraft.name}: the model of pitching needs mass.Ix, mass.Iy and mass.Iz in the aircraft file, such as"
            ' Iy = "0.28 kg m^2"'
        )

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        Vdot, alphadot = wind_axis_derivative(c, x.V, x.alpha, x.theta, x.q, u, p, J_ref)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, x.q, u.r)
        Cm = p.Cm0 + p.Cma * x.alpha + p.Cmq * reduced_pitch_rate(c, x.q, x.V) + p.Cmde * u.elevator
        M = u.rho * x.V**2 / 2 * c.S * c.chord * Cm
        _, qdot, _ = motion.rate_derivative((u.p, x.q, u.r), (0.0, M, 0.0), inertia)
        return Vdot, alphadot, thetadot, qdot, climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return (
            *measured_air_data(x, p),
            x.q + p.q_bias,
            *measured_specific_force(c, x.V, x.alpha, x.q, u, p, J_ref),
            x.h,
        )

    return Model(
        name="longitudinal",
        states=("V", "alpha", "theta", "q", "h"),
        inputs=("thrust", "J", "elevator", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "q", "ax", "az", "h"),
        parameters=(
            *aerodynamic_parameters(c, priors),
            # Typical of model aircraft and light singles with a static margin of 15 %.
            Parameter(name="Cm0", start=0.05),
            Parameter(name="Cma", start=-0.15 * lift_slope(c.aspect_ratio), unit="1/rad"),
            Parameter(name="Cmq", start=-15.0, unit="1/rad"),
            Parameter(name="Cmde", start=-1.2, unit="1/rad"),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=False),
            gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=level_flight_state,
    ).changed(CLq={"free": True, "start": 5.0}, CLde={"prior_sigma": np.inf})
