"""Axial and vertical force coefficients as polynomials of the angle of attack (2.14), (2.15)."""

from typing import Any

from analysis.estimation.aircraft_models.equations import corrected_thrust, measured_air_data
from analysis.estimation.aircraft_models.parameters import (
    Constants,
    Priors,
    lift_slope,
    sensor_parameters,
    thrust_parameters,
)
from analysis.estimation.model import Model, NamedValues, Parameter
from flight import motion
from flight.aerodynamics import stability_axes
from flight.aircraft import Aircraft

# An elevator deflection tilts the tail's lift little, so its part of the axial force is small.
CXDE_SIGMA = 0.05


def force_coefficients(alpha: Any, elevator: Any, p: NamedValues) -> tuple[Any, Any]:
    """CX (2.14) and CZ (2.15), elementwise. alpha, elevator: [rad]."""
    CX = p.CX0 + p.CXa * alpha + p.CXa2 * alpha**2 + p.CXde * elevator
    return CX, p.CZ0 + p.CZa * alpha + p.CZa2 * alpha**2 + p.CZde * elevator


def force_models(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """States V, alpha, theta; outputs V, alpha, theta, ax, az, those of (2.17) that do not need the pitching moment.

    CX and CZ do not depend on V, as in the source's own model. Drag follows from them by (2.16).
    """
    c = Constants.of(aircraft)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        CL, CD = stability_axes(*force_coefficients(x.alpha, u.elevator, p), x.alpha)
        Vdot, alphadot, _ = motion.wind_axis_derivative(
            x.V, x.alpha, u.beta, u.phi, x.theta, u.p, u.q, u.r,
            CL=CL, CD=CD, CY=0.0, T=corrected_thrust(u, p, J_ref), m=c.m, qS=u.rho * x.V**2 / 2 * c.S,
        )  # fmt: skip
        return Vdot, alphadot, motion.attitude_derivative(u.phi, x.theta, u.p, u.q, u.r)[1]

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        CX, CZ = force_coefficients(x.alpha, u.elevator, p)
        qS = u.rho * x.V**2 / 2 * c.S
        ax = (qS * CX + corrected_thrust(u, p, J_ref)) / c.m + p.ax_bias
        return (*measured_air_data(x, p), x.theta, ax, qS * CZ / c.m + p.az_bias)

    return Model(
        name="force_models",
        states=("V", "alpha", "theta"),
        inputs=("thrust", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "theta", "ax", "az"),
        parameters=(
            Parameter(name="CX0", start=-0.04),
            Parameter(name="CXa", start=0.25, unit="1/rad"),
            Parameter(name="CXa2", start=3.0, unit="1/rad^2"),
            Parameter(name="CXde", start=0.0, prior_sigma=CXDE_SIGMA, unit="1/rad"),
            Parameter(name="CZ0", start=-0.25),
            Parameter(name="CZa", start=-lift_slope(c.aspect_ratio), unit="1/rad"),
            Parameter(name="CZa2", start=0.0, prior_sigma=2.0, unit="1/rad^2"),
            Parameter(name="CZde", start=-priors.CLde_mean, prior_sigma=priors.CLde, unit="1/rad"),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )
