"""Aircraft models for tests and benchmarks of the estimators: with elevator inputs, or pitch angle from the gyro."""

from typing import Any

import numpy as np

from flightpower.analysis.estimation.model import Model, NamedValues, Parameter
from flightpower.analysis.methods.aircraft_models import (
    CLq_with_prior,
    Constants,
    Flow,
    Priors,
    aerodynamic_parameters,
    climb_rate,
    gyro_bias,
    level_flight_state,
    measured_air_data,
    measured_specific_force,
    reduced_pitch_rate,
    sensor_parameters,
    thrust_parameters,
    wind_axis_derivative,
)
from flightpower.flight import motion
from flightpower.flight.aerodynamics import lift_slope
from flightpower.flight.aircraft import Aircraft


def longitudinal(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """Return a model with the states V, alpha, theta, q, h and the outputs V, alpha, q, ax, az, h.

    It has the pitching moments Cm0, Cma, Cmq and Cmde, and CLq. CLde is free without a prior, because an elevator input
    separates the effects of elevator and angle of attack. The aircraft file must have moments of inertia.
    """
    c = Constants.of(aircraft, J_ref)
    mass = aircraft.mass
    inertia = motion.Inertia(mass.Ix_kgm2, mass.Iy_kgm2, mass.Iz_kgm2, mass.Ixz_kgm2)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        Vdot, alphadot = wind_axis_derivative(c, Flow(x.V, x.alpha, x.q), x.theta, u, p)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, x.q, u.r)
        Cm = p.Cm0 + p.Cma * x.alpha + p.Cmq * reduced_pitch_rate(c, x.q, x.V) + p.Cmde * u.elevator
        M = u.rho * x.V**2 / 2 * c.S * c.chord * Cm
        _, qdot, _ = motion.rate_derivative((u.p, x.q, u.r), (0.0, M, 0.0), inertia)
        return Vdot, alphadot, thetadot, qdot, climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return (
            *measured_air_data(x, p),
            x.q + p.q_bias,
            *measured_specific_force(c, Flow(x.V, x.alpha, x.q), u, p),
            x.h,
        )

    return Model(
        name="longitudinal",
        states=("V", "alpha", "theta", "q", "h"),
        inputs=("thrust", "J", "elevator", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "q", "ax", "az", "h"),
        parameters=(
            *aerodynamic_parameters(c),
            # These values are typical of model aircraft and light singles with a static margin of 15 %.
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


def pitch_and_height(
    aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5, with_climb_rate: bool = False
) -> Model:
    """Return a model with the states V, alpha, theta, h; theta is the integral of the gyro, which has a free bias.

    Height, an output, determines the bias of alpha and the pitch angle, so no attitude filter is needed. CLq has a
    prior, because level runs contain little information about it.
    with_climb_rate : adds the output hdot
    """
    c = Constants.of(aircraft, J_ref)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        q = u.q - p.q_bias
        Vdot, alphadot = wind_axis_derivative(c, Flow(x.V, x.alpha, q), x.theta, u, p)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, q, u.r)
        return Vdot, alphadot, thetadot, climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        y = (
            *measured_air_data(x, p),
            *measured_specific_force(c, Flow(x.V, x.alpha, u.q - p.q_bias), u, p),
            x.h,
        )
        return (*y, climb_rate(x.V, x.alpha, x.theta, u)) if with_climb_rate else y

    return Model(
        name="pitch_and_height",
        states=("V", "alpha", "theta", "h"),
        inputs=("thrust", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az", "h", *(("hdot",) if with_climb_rate else ())),
        parameters=(
            *aerodynamic_parameters(c),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=False),
            gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=level_flight_state,
    ).changed(CLq=CLq_with_prior())
