"""What the aircraft models share: known constants, priors, and the parameters with their starting values.

Forces, equations of motion and measurement equations that several aircraft models share.

Arguments are floats, arrays or CasADi symbols: airspeed V [m/s], alpha and theta [rad], pitch rate q [rad/s], inputs u
and parameters p by name (see the package's docstring), advance ratio J_ref at which `thrust_slope` has no effect.

Axial and vertical force coefficients as polynomials of the angle of attack (2.14), (2.15).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.estimation.model import Model, NamedValues, Parameter
from flight import motion
from flight.aerodynamics import body_axes, stability_axes
from flight.aircraft import Aircraft
from flight.motion import Inertia

DEGREE = np.pi / 180


@dataclass(frozen=True, kw_only=True)
class Priors:
    """Standard deviations of the systematic errors before a flight, about zero or about the given mean."""

    alpha_bias_rad: float = 1 * DEGREE
    alpha_scale: float = 0.03
    accelerometer_bias_mps2: float = 0.19  # a bias of 0.17 m/s^2 and 0.5 deg of misalignment under 1 g
    gyro_bias_radps: float = 0.001  # after subtraction of the value on the ground
    V_scale: float = 0.0125
    V_bias_mps: float = 0.3
    air_data_lag_s: float = 0.01  # lag of tubes and filters that remains after the correction for the known lag
    air_data_lag_mean_s: float = 0.01
    thrust_scale: float = 0.018
    thrust_slope: float = 0.15  # error of the slope of thrust over advance ratio, relative to thrust
    CLde_mean: float = 0.4  # tail with 15 to 20 % of the wing's area
    CLde: float = 0.2
    CLq_mean: float = 5.0  # 2 a_t V_H for a tail with lift slope a_t = 4 and tail volume V_H = 0.6
    CLq: float = 3.0


@dataclass(frozen=True, kw_only=True)
class Constants:
    """What the models take as known of an aircraft."""

    m: float  # kg
    S: float  # m^2
    chord: float  # m
    aspect_ratio: float
    inertia: Inertia | None  # None where the aircraft file lacks it

    @classmethod
    def of(cls, aircraft: Aircraft) -> "Constants":
        mass = aircraft.mass
        Ix, Iy, Iz = mass.Ix_kgm2, mass.Iy_kgm2, mass.Iz_kgm2
        return cls(
            m=aircraft.mass_kg,
            S=aircraft.geometry.wing_area_m2,
            chord=aircraft.geometry.mean_chord_m,
            aspect_ratio=aircraft.aspect_ratio,
            inertia=None if Ix is None or Iy is None or Iz is None else Inertia(Ix, Iy, Iz, mass.Ixz_kgm2),
        )


def lift_slope(aspect_ratio: float) -> float:
    """Lift slope of a straight wing [1/rad]: Helmbold's equation (McCormick, Aerodynamics, 2nd ed., eq. 3.74)."""
    return float(2 * np.pi * aspect_ratio / (2 + np.sqrt(aspect_ratio**2 + 4)))


def aerodynamic_parameters(c: Constants, priors: Priors) -> tuple[Parameter, ...]:
    """Lift (3.35) and drag (3.36). CLq is fixed at zero; see `CLq_with_prior`."""
    # Starting values of a cambered wing with fuselage and landing gear; a span efficiency of 0.8 is usual.
    return (
        Parameter(name="CL0", start=0.25),
        Parameter(name="CLa", start=lift_slope(c.aspect_ratio), unit="1/rad"),
        Parameter(name="CLde", start=priors.CLde_mean, prior_sigma=priors.CLde, unit="1/rad"),
        Parameter(name="CLq", start=0.0, unit="1/rad", free=False),
        Parameter(name="A0", start=0.04),
        Parameter(name="A1", start=0.0),
        Parameter(name="A2", start=1 / (np.pi * 0.8 * c.aspect_ratio)),
    )


def CLq_with_prior(priors: Priors) -> dict[str, float | bool]:
    """Changes that free CLq with its prior, for `Model.changed`."""
    return {"free": True, "start": priors.CLq_mean, "prior_sigma": priors.CLq}


def thrust_parameters(priors: Priors) -> tuple[Parameter, ...]:
    """Relative errors of the thrust table: a scale, and a slope over advance ratio."""
    return (
        Parameter(name="thrust_scale", start=0.0, prior_sigma=priors.thrust_scale),
        Parameter(name="thrust_slope", start=0.0, prior_sigma=priors.thrust_slope),
    )


def sensor_parameters(priors: Priors, *, V_bias_free: bool) -> tuple[Parameter, ...]:
    """Scales and biases of air data and accelerometers (Table 3.1)."""
    return (
        Parameter(name="V_scale", start=0.0, prior_sigma=priors.V_scale),
        Parameter(name="V_bias", start=0.0, prior_sigma=priors.V_bias_mps, unit="m/s", free=V_bias_free),
        Parameter(name="alpha_scale", start=0.0, prior_sigma=priors.alpha_scale),
        Parameter(name="alpha_bias", start=0.0, prior_sigma=priors.alpha_bias_rad, unit="rad"),
        Parameter(name="ax_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
        Parameter(name="az_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
    )


def gyro_bias(priors: Priors, *, free: bool) -> Parameter:
    return Parameter(name="q_bias", start=0.0, prior_sigma=priors.gyro_bias_radps, unit="rad/s", free=free)


def reduced_pitch_rate(c: Constants, q: Any, V: Any) -> Any:
    """q c/(2 V)."""
    return q * c.chord / (2 * V)


def lift_and_drag(c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """CL (3.35) and CD (3.36)."""
    CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * reduced_pitch_rate(c, q, V)
    return CL, p.A0 + p.A1 * CL + p.A2 * CL**2


def corrected_thrust(u: NamedValues, p: NamedValues, J_ref: float) -> Any:
    """Thrust of the table [N] with its estimated errors."""
    return u.thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J - J_ref))


def wind_axis_derivative(
    c: Constants, V: Any, alpha: Any, theta: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """Vdot [m/s^2] and alphadot [rad/s] in still air."""
    CL, CD = lift_and_drag(c, V, alpha, q, u, p)
    Vdot, alphadot, _ = motion.wind_axis_derivative(
        (V, alpha, u.beta), u.phi, theta, (u.p, q, u.r),
        coefficients=(CL, CD, 0.0), T=corrected_thrust(u, p, J_ref), m=c.m, qS=u.rho * V**2 / 2 * c.S,
    )  # fmt: skip
    return Vdot, alphadot


def specific_force(
    c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """ax, az [m/s^2] in body axes (3.39), (3.40)."""
    CX, CZ = body_axes(*lift_and_drag(c, V, alpha, q, u, p), alpha)
    qS = u.rho * V**2 / 2 * c.S
    return (qS * CX + corrected_thrust(u, p, J_ref)) / c.m, qS * CZ / c.m


def measured_specific_force(
    c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """ax, az [m/s^2] with the biases of the accelerometers."""
    ax, az = specific_force(c, V, alpha, q, u, p, J_ref)
    return ax + p.ax_bias, az + p.az_bias


def measured_air_data(x: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """V and alpha with scale and bias (3.43)."""
    return x.V * (1 + p.V_scale) + p.V_bias, x.alpha * (1 + p.alpha_scale) + p.alpha_bias


def climb_rate(V: Any, alpha: Any, theta: Any, u: NamedValues) -> Any:
    """hdot [m/s] in still air."""
    forward, right, down = motion.velocity_of(V, alpha, u.beta)
    return -motion.earth_from_body((forward, right, down), (u.phi, theta, 0.0))[2]


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
            (x.V, x.alpha, u.beta), u.phi, x.theta, (u.p, u.q, u.r),
            coefficients=(CL, CD, 0.0), T=corrected_thrust(u, p, J_ref), m=c.m, qS=u.rho * x.V**2 / 2 * c.S,
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
