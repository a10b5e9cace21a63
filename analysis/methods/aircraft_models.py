"""Models of an aircraft with systematic sensor errors (Table 3.1) for the maximum-likelihood estimators.

Drag is C_D = A0 + A1 C_L + A2 C_L^2, the parabolic polar (3.36) rewritten to be well conditioned. Specific force is
given at the center of gravity. Starting values come from the wing's geometry and from the data, never from the
aerodynamics that the simulator uses.

Inputs by name: thrust [N], advance ratio J, elevator [rad], body rates p, q, r [rad/s] as measured by the gyro, bank
phi [rad], sideslip beta [rad], density rho [kg/m^3]. `two_state` also needs the pitch angle theta [rad]. `level_run`
needs the airspeed V_ref [m/s] at which thrust and J are given, and the slope thrust_per_speed [N s/m] at that airspeed.
Outputs by name: airspeed V [m/s], alpha [rad], specific force ax, az [m/s^2], pitch angle theta [rad], height h [m].

The functions of states x, inputs u and parameters p accept floats, arrays or CasADi symbols. J_ref is the advance ratio
at which `thrust_slope` has no effect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flightpower.analysis.curve import drag_terms
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, NamedValues, Parameter
from flightpower.analysis.methods.settings import CROSS_CHECK
from flightpower.flight import motion
from flightpower.flight.aerodynamics import body_axes, lift_slope, stability_axes
from flightpower.flight.aircraft import Aircraft, Uncertainty
from flightpower.flight.arrays import Array

STATED = Uncertainty()  # the values for an aircraft file that states no uncertainty


@dataclass(frozen=True, kw_only=True)
class Priors:
    """Prior standard deviations of the systematic errors, about zero or about the given mean."""

    alpha_bias_rad: float = STATED.angle_of_attack_offset_rad
    alpha_scale: float = STATED.angle_of_attack_slope_fraction
    accelerometer_bias_mps2: float = STATED.accelerometer_offset_mps2
    gyro_bias_radps: float = CROSS_CHECK.priors["q_bias"][1]
    V_scale: float = STATED.airspeed_scale_fraction
    V_bias_mps: float = CROSS_CHECK.priors["V_bias"][1]
    thrust_scale: float = STATED.thrust_scale_fraction
    thrust_slope: float = STATED.thrust_slope


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Constants of an aircraft that the models treat as known."""

    m: float  # kg
    S: float  # m^2
    chord: float  # m
    aspect_ratio: float
    J_ref: float

    @classmethod
    def of(cls, aircraft: Aircraft, J_ref: float = 0.5) -> "Constants":
        return cls(
            m=aircraft.mass_kg,
            S=aircraft.geometry.wing_area_m2,
            chord=aircraft.geometry.mean_chord_m,
            aspect_ratio=aircraft.aspect_ratio,
            J_ref=J_ref,
        )


def aerodynamic_parameters(c: Constants) -> tuple[Parameter, ...]:
    """Parameters of lift (3.35) and drag (3.36). CLq is fixed at zero; `CLq_with_prior` frees it."""
    CLde, CLde_sigma = CROSS_CHECK.priors["CLde"]
    # Starting values for a cambered wing with fuselage and landing gear; a span efficiency of 0.8 is usual.
    return (
        Parameter(name="CL0", start=0.25),
        Parameter(name="CLa", start=lift_slope(c.aspect_ratio), unit="1/rad"),
        Parameter(name="CLde", start=CLde, prior_sigma=CLde_sigma, unit="1/rad"),
        Parameter(name="CLq", start=0.0, unit="1/rad", free=False),
        Parameter(name="A0", start=0.04),
        Parameter(name="A1", start=0.0),
        Parameter(name="A2", start=1 / (np.pi * 0.8 * c.aspect_ratio)),
    )


def CLq_with_prior() -> dict[str, float | bool]:
    """Changes that free CLq with its prior, for `Model.changed`."""
    start, sigma = CROSS_CHECK.priors["CLq"]
    return {"free": True, "start": start, "prior_sigma": sigma}


def thrust_parameters(priors: Priors) -> tuple[Parameter, ...]:
    """Parameters for relative errors of the thrust table: a scale, and a slope over advance ratio."""
    return (
        Parameter(name="thrust_scale", start=0.0, prior_sigma=priors.thrust_scale),
        Parameter(name="thrust_slope", start=0.0, prior_sigma=priors.thrust_slope),
    )


def sensor_parameters(priors: Priors, *, V_bias_free: bool) -> tuple[Parameter, ...]:
    """Parameters for scales and biases of air data and accelerometers (Table 3.1)."""
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
    """The reduced pitch rate q c/(2 V)."""
    return q * c.chord / (2 * V)


class Flow(NamedTuple):
    """Motion of the wing through the air: airspeed V [m/s], angle of attack alpha [rad], pitch rate q [rad/s]."""

    V: Any
    alpha: Any
    q: Any


def lift_and_drag(c: Constants, flow: Flow, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """CL (3.35) and CD (3.36)."""
    CL = p.CL0 + p.CLa * flow.alpha + p.CLde * u.elevator + p.CLq * reduced_pitch_rate(c, flow.q, flow.V)
    return CL, p.A0 + p.A1 * CL + p.A2 * CL**2


def corrected_thrust(c: Constants, u: NamedValues, p: NamedValues) -> Any:
    """The table's thrust [N], corrected for its estimated errors."""
    return u.thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J - c.J_ref))


def wind_axis_derivative(c: Constants, flow: Flow, theta: Any, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """Vdot [m/s^2] and alphadot [rad/s] in still air at the pitch angle theta [rad]."""
    CL, CD = lift_and_drag(c, flow, u, p)
    Vdot, alphadot, _ = motion.wind_axis_derivative(
        (flow.V, flow.alpha, u.beta), (u.phi, theta, 0.0), (u.p, flow.q, u.r),
        coefficients=(CL, CD, 0.0), T=corrected_thrust(c, u, p), m=c.m, qS=u.rho * flow.V**2 / 2 * c.S,
    )  # fmt: skip
    return Vdot, alphadot


def measured_specific_force(c: Constants, flow: Flow, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """ax, az [m/s^2] in body axes (3.39), (3.40), with the biases of the accelerometers."""
    CX, CZ = body_axes(*lift_and_drag(c, flow, u, p), flow.alpha)
    qS = u.rho * flow.V**2 / 2 * c.S
    return (qS * CX + corrected_thrust(c, u, p)) / c.m + p.ax_bias, qS * CZ / c.m + p.az_bias


def measured_air_data(x: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """V and alpha with scale and bias (3.43)."""
    return x.V * (1 + p.V_scale) + p.V_bias, x.alpha * (1 + p.alpha_scale) + p.alpha_bias


def climb_rate(V: Any, alpha: Any, theta: Any, u: NamedValues) -> Any:
    """hdot [m/s] in still air."""
    forward, right, down = motion.velocity_of(V, alpha, u.beta)
    return -motion.earth_from_body((forward, right, down), (u.phi, theta, 0.0))[2]


def force_coefficients(alpha: Any, elevator: Any, p: NamedValues) -> tuple[Any, Any]:
    """CX (2.14) and CZ (2.15), elementwise. alpha, elevator: [rad]."""
    CX = p.CX0 + p.CXa * alpha + p.CXa2 * alpha**2 + p.CXde * elevator
    return CX, p.CZ0 + p.CZa * alpha + p.CZa2 * alpha**2 + p.CZde * elevator


def force_models(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """Model with states V, alpha, theta and outputs V, alpha, theta, ax, az, which need no pitching moment in (2.17).

    CX and CZ do not depend on V, as in the source's own model. Drag follows from them by (2.16).
    """
    c = Constants.of(aircraft, J_ref)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        CL, CD = stability_axes(*force_coefficients(x.alpha, u.elevator, p), x.alpha)
        Vdot, alphadot, _ = motion.wind_axis_derivative(
            (x.V, x.alpha, u.beta), (u.phi, x.theta, 0.0), (u.p, u.q, u.r),
            coefficients=(CL, CD, 0.0), T=corrected_thrust(c, u, p), m=c.m, qS=u.rho * x.V**2 / 2 * c.S,
        )  # fmt: skip
        return Vdot, alphadot, motion.attitude_derivative(u.phi, x.theta, u.p, u.q, u.r)[1]

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        CX, CZ = force_coefficients(x.alpha, u.elevator, p)
        qS = u.rho * x.V**2 / 2 * c.S
        ax = (qS * CX + corrected_thrust(c, u, p)) / c.m + p.ax_bias
        return (*measured_air_data(x, p), x.theta, ax, qS * CZ / c.m + p.az_bias)

    CLde, CLde_sigma = CROSS_CHECK.priors["CLde"]
    return Model(
        name="force_models",
        states=("V", "alpha", "theta"),
        inputs=("thrust", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "theta", "ax", "az"),
        parameters=(
            Parameter(name="CX0", start=-0.04),
            Parameter(name="CXa", start=0.25, unit="1/rad"),
            Parameter(name="CXa2", start=3.0, unit="1/rad^2"),
            # A deflection of the elevator hardly tilts the tail's lift.
            Parameter(name="CXde", start=0.0, prior_sigma=0.05, unit="1/rad"),
            Parameter(name="CZ0", start=-0.25),
            Parameter(name="CZa", start=-lift_slope(c.aspect_ratio), unit="1/rad"),
            Parameter(name="CZa2", start=0.0, prior_sigma=2.0, unit="1/rad^2"),
            Parameter(name="CZde", start=-CLde, prior_sigma=CLde_sigma, unit="1/rad"),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )


def starting_values(aircraft: Aircraft, segments: Segment | Sequence[Segment], CLde: float = 0.4) -> dict[str, float]:
    """Starting values of CL0, CLa, A0, A1, A2 from a least-squares line and parabola through CL and CD of all samples.

    Biases of the sensors and noise in the regressors are ignored. If lift falls with alpha, or the parabola is
    unphysical (A0 <= 0 or A2 <= 0), the default starting values remain.
    """
    c = Constants.of(aircraft)
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)

    def pooled(name: str) -> Array:
        return np.concatenate([segment.z[name] if name in segment.z else segment.u[name] for segment in segments])

    V, alpha, ax, az = (pooled(name) for name in ("V", "alpha", "ax", "az"))
    qS = pooled("rho") * V**2 / 2 * c.S
    CL, CD = stability_axes((c.m * ax - pooled("thrust")) / qS, c.m * az / qS, alpha)
    good = np.isfinite(CL) & np.isfinite(CD) & (qS > 0)
    CL, CD, alpha, elevator = CL[good], CD[good], alpha[good], pooled("elevator")[good]
    default = {q.name: q.start for q in aerodynamic_parameters(c)}
    start = {name: default[name] for name in ("CL0", "CLa", "A0", "A1", "A2")}
    if len(CL) < len(start):
        return start
    (CL0, CLa), *_ = np.linalg.lstsq(np.stack([np.ones_like(alpha), alpha], axis=1), CL - CLde * elevator, rcond=None)
    if CLa > 0:
        start |= {"CL0": float(CL0), "CLa": float(CLa)}
    (A0, A1, A2), *_ = np.linalg.lstsq(drag_terms(CL), CD, rcond=None)
    if A0 > 0 and A2 > 0:
        start |= {"A0": float(A0), "A1": float(A1), "A2": float(A2)}
    return start


def level_flight_state(segment: Segment) -> Mapping[str, float]:
    """V, alpha, theta, q, h at a segment's start, from its first second, with theta = alpha + climb angle and q = 0.

    States without data are left out.
    """
    first_second = slice(0, max(2, round(1 / segment.step_s)))
    t = segment.t_s[first_second] - segment.t_s[0]

    def line(name: str) -> tuple[float, float]:
        """Value and slope of a least-squares line at the start; NaN with fewer than two samples."""
        if name not in segment.z:
            return np.nan, np.nan
        values = segment.z[name][first_second]
        good = np.isfinite(values)
        if good.sum() < 2:
            return np.nan, np.nan
        slope, value = np.polyfit(t[good], values[good], 1)
        return float(value), float(slope)

    (V, _), (alpha, _), (h, hdot) = line("V"), line("alpha"), line("h")
    theta = alpha + np.arcsin(np.clip(hdot / V, -1, 1))
    state = {"V": V, "alpha": alpha, "theta": float(theta), "q": 0.0, "h": h}
    return {name: value for name, value in state.items() if np.isfinite(value)}


def two_state(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """Model with states V, alpha and outputs V, alpha, ax, az; the pitch angle theta is an input (3.38).

    It has bias and scale of V and alpha, and biases of ax and az (Table 3.1). Errors of the measured theta enter the
    estimates.
    """
    c = Constants.of(aircraft, J_ref)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return wind_axis_derivative(c, Flow(x.V, x.alpha, u.q - p.q_bias), u.theta, u, p)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return (
            *measured_air_data(x, p),
            *measured_specific_force(c, Flow(x.V, x.alpha, u.q - p.q_bias), u, p),
        )

    return Model(
        name="two_state",
        states=("V", "alpha"),
        inputs=("thrust", "J", "elevator", "q", "theta", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az"),
        parameters=(
            *aerodynamic_parameters(c),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
            gyro_bias(priors, free=False),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )


def level_run(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """Model with states V, gamma, theta, h, in which alpha = theta - gamma.

    The flight path angle gamma (wings level) replaces alpha as a state, so that the gyro acts on theta alone. Process
    noise of theta is then the noise of the gyro, with its correct effect on alpha and lift.

    Thrust is thrust + thrust_per_speed (V - V_ref) at the airspeed V of the state, because a table read at an airspeed
    3 % too high gives 9 % too little thrust at high speed. Airspeed has a scale, a bias and a lag. Flow angles are
    computed from pressures over dynamic pressure, so an airspeed scale s changes alpha by the fraction -2 s.
    """
    c = Constants.of(aircraft, J_ref)

    def specific_force(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
        """Specific force ax, az [m/s^2] without biases."""
        alpha = x.theta - x.gamma
        table_thrust = u.thrust + u.thrust_per_speed * (x.V - u.V_ref)
        T = table_thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J * x.V / u.V_ref - c.J_ref))
        q_hat = reduced_pitch_rate(c, u.q - p.q_bias, u.V_ref)
        CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * q_hat
        CX, CZ = body_axes(CL, p.A0 + p.A1 * CL + p.A2 * CL**2, alpha)
        qS = u.rho * x.V**2 / 2 * c.S
        return (qS * CX + T) / c.m, qS * CZ / c.m

    def flow_derivative(x: NamedValues, u: NamedValues, p: NamedValues, ax: Any, az: Any) -> tuple[Any, Any]:
        """Vdot [m/s^2], alphadot [rad/s] from the specific force; the side force is zero."""
        forward, right, down = motion.velocity_of(x.V, x.theta - x.gamma, u.beta)
        udot, vdot, wdot = motion.velocity_derivative(
            (forward, right, down), (u.p, u.q - p.q_bias, u.r), u.phi, x.theta, (ax, 0.0, az)
        )
        Vdot = (forward * udot + right * vdot + down * wdot) / x.V
        return Vdot, (forward * wdot - down * udot) / (forward**2 + down**2)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        Vdot, alphadot = flow_derivative(x, u, p, *specific_force(x, u, p))
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, u.q - p.q_bias, u.r)
        return Vdot, thetadot - alphadot, thetadot, climb_rate(x.V, x.theta - x.gamma, x.theta, u)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        ax, az = specific_force(x, u, p)
        Vdot, alphadot = flow_derivative(x, u, p, ax, az)
        return (
            (x.V - p.air_data_lag * Vdot) * (1 + p.V_scale) + p.V_bias,
            (x.theta - x.gamma - p.air_data_lag * alphadot) * (1 + p.alpha_scale - 2 * p.V_scale) + p.alpha_bias,
            ax + p.ax_bias,
            az + p.az_bias,
            x.h,
        )

    def initial_state(segment: Segment) -> Mapping[str, float]:
        state = dict(level_flight_state(segment))
        if {"theta", "alpha"} <= set(state):
            state["gamma"] = state["theta"] - state["alpha"]
        return state

    start, sigma = CROSS_CHECK.priors["air_data_lag"]
    lag = Parameter(name="air_data_lag", start=start, prior_sigma=sigma, unit="s")
    return Model(
        name="level_run",
        states=("V", "gamma", "theta", "h"),
        inputs=("thrust", "thrust_per_speed", "V_ref", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az", "h"),
        parameters=(
            *aerodynamic_parameters(c),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
            lag,
            gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=initial_state,
    ).changed(CLq=CLq_with_prior())
