"""The aircraft's models: longitudinal flight with systematic errors of the sensors (Table 3.1), over `flight.motion`.

Drag is C_D = A0 + A1 C_L + A2 C_L^2, the parabolic polar (3.36) in its well conditioned form. Measured specific force
is that at the centre of gravity. Starting values come from the wing's geometry and from the data (`quick_start`),
never from what the simulator flies.

Inputs by name: thrust [N], advance ratio J, elevator [rad], body rates p, q, r [rad/s] as the gyro measures them, bank
phi [rad], sideslip beta [rad], density rho [kg/m^3]; in some models pitch angle theta [rad], and in `level_run` the
airspeed V_ref [m/s] for which thrust and J are given, with the slope thrust_per_speed [N s/m] there.
Outputs by name: airspeed V [m/s], alpha [rad], specific force ax, az [m/s^2], height h [m], climb rate hdot [m/s].
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.estimation.data import Segment
from analysis.estimation.filter_error import ProcessNoise
from analysis.estimation.model import Model, Named, Parameter
from flight import motion
from flight.aerodynamics import body_axes, stability_axes
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.motion import Inertia

DEGREE = np.pi / 180


@dataclass(frozen=True, kw_only=True)
class Priors:
    """What is known of the systematic errors before a flight: standard deviations about zero (or about `mean`)."""

    alpha_bias_rad: float = 1 * DEGREE
    alpha_scale: float = 0.03
    accelerometer_bias_mps2: float = 0.19  # a bias of 0.17 m/s^2 and 0.5 deg of misalignment under 1 g
    gyro_bias_radps: float = 0.001  # about the value on the ground, taken out before
    V_scale: float = 0.0125
    V_bias_mps: float = 0.3
    air_data_lag_s: float = 0.01  # about `air_data_lag_mean_s`: what tubes and filters may have beyond what is known
    air_data_lag_mean_s: float = 0.01
    thrust_scale: float = 0.018
    thrust_slope: float = 0.15  # of thrust over advance ratio, relative
    CLde_mean: float = 0.4  # a tail of 15 to 20 % of the wing's area
    CLde: float = 0.2
    CLq_mean: float = 5.0  # 2 a_t V_H of a tail with a lift slope of 4 and a volume of 0.6
    CLq: float = 3.0


@dataclass(frozen=True, kw_only=True)
class Constants:
    """What a model takes as known of an aircraft."""

    m: float  # kg
    S: float  # m^2
    chord: float  # m
    aspect_ratio: float
    inertia: Inertia | None  # None where the aircraft file does not have it

    @classmethod
    def of(cls, aircraft: Aircraft) -> "Constants":
        mass = aircraft.mass
        Ix, Iy, Iz = mass.Ix_kgm2, mass.Iy_kgm2, mass.Iz_kgm2
        known = Ix is not None and Iy is not None and Iz is not None
        return cls(
            m=aircraft.mass_kg,
            S=aircraft.geometry.wing_area_m2,
            chord=aircraft.geometry.mean_chord_m,
            aspect_ratio=aircraft.aspect_ratio,
            inertia=Inertia(Ix, Iy, Iz, mass.Ixz_kgm2) if known else None,
        )


def lift_slope(aspect_ratio: float) -> float:
    """Lift slope of a straight wing [1/rad]: Helmbold's equation (McCormick, Aerodynamics, 2nd ed., eq. 3.74)."""
    return 2 * np.pi * aspect_ratio / (2 + np.sqrt(aspect_ratio**2 + 4))


def two_state(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """The dissertation's form (3.38): states V, alpha; outputs V, alpha, ax, az; pitch angle theta is an input.

    With bias and scale on V and alpha, bias on ax and az (Table 3.1). As good as the measured theta is.
    """
    c = Constants.of(aircraft)

    def dynamics(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        return _wind_axis_derivative(c, x.V, x.alpha, u.theta, u.q - p.q_bias, u, p, J_ref)[:2]

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        return (*_air_data(x, p), *_specific_force(c, x.V, x.alpha, u.q - p.q_bias, u, p, J_ref))

    return Model(
        name="two_state",
        states=("V", "alpha"),
        inputs=("thrust", "J", "elevator", "q", "theta", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az"),
        parameters=(
            *_aerodynamic_parameters(c, priors),
            *_thrust_parameters(priors),
            *_sensor_parameters(priors, V_bias_free=True),
            _gyro_bias(priors, free=False),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )


def pitch_and_height(
    aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5, climb_rate: bool = False
) -> Model:
    """States V, alpha, theta, h: pitch is integrated from the gyro with a free bias, and height is an output.

    Height is what makes the bias of alpha and the pitch angle known: no attitude filter is needed. CLq has a prior:
    level runs hardly show it.
    climb_rate : hdot is an output too
    """
    c = Constants.of(aircraft)

    def dynamics(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        q = u.q - p.q_bias
        Vdot, alphadot, _ = _wind_axis_derivative(c, x.V, x.alpha, x.theta, q, u, p, J_ref)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, q, u.r)
        return Vdot, alphadot, thetadot, _climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        y = (*_air_data(x, p), *_specific_force(c, x.V, x.alpha, u.q - p.q_bias, u, p, J_ref), x.h)
        return (*y, _climb_rate(x.V, x.alpha, x.theta, u)) if climb_rate else y

    return Model(
        name="pitch_and_height",
        states=("V", "alpha", "theta", "h"),
        inputs=("thrust", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az", "h", *(("hdot",) if climb_rate else ())),
        parameters=(
            *_aerodynamic_parameters(c, priors),
            *_thrust_parameters(priors),
            *_sensor_parameters(priors, V_bias_free=False),
            _gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=level_flight_state,
    ).changed(CLq=_prior(priors.CLq_mean, priors.CLq))


GUSTS = ("gust", "gust_alpha")
# Dryden turbulence 100 m above the ground (MIL-F-8785C sec. 3.7.3.4.1): scale lengths along and across the flow.
GUST_LENGTHS_M = {"gust": 263.0, "gust_alpha": 100.0}


def level_run(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5, gusts: bool = False) -> Model:
    """States V, gamma, theta, h, for runs whose every systematic error counts; alpha = theta - gamma.

    With alpha's place taken by gamma (the angle of the path, wings level) the gyro moves theta alone, and so does its
    noise: process noise of theta is that of the gyro, whose effect on alpha and on lift then is the same.

    Thrust is that at the state's speed, thrust + thrust_per_speed (V - V_ref): a table read at an airspeed 3 % too high
    gives 9 % too little thrust at high speed. Airspeed has a scale, a bias and a lag; as angles are pressures over
    dynamic pressure, they read low by twice what airspeed reads high.

    gusts : two more states, along the flow (m/s) and across it (rad, `gust_alpha`), first order with GUST_LENGTHS_M,
    for `filter_error` with the noise of `gust_noise`. The air's motion is added to what the aircraft's own would be:
    V + gust is what wing, propeller and probe feel, V and alpha what moves it through the mean air. Scales of the air
    data are not applied to gusts, so that none can be learnt from how forces follow gusts.
    """
    c = Constants.of(aircraft)

    def felt(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        """Specific force ax, az [m/s^2]."""
        still = x.theta - x.gamma
        V, alpha = (x.V + x.gust, still + x.gust_alpha) if gusts else (x.V, still)
        thrust = u.thrust + u.thrust_per_speed * (V - u.V_ref)
        T = thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J * V / u.V_ref - J_ref))
        CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * _q_hat(c, u.q - p.q_bias, u.V_ref)
        CX, CZ = body_axes(CL, p.A0 + p.A1 * CL + p.A2 * CL**2, alpha)
        qS = u.rho * V**2 / 2 * c.S
        return (qS * CX + T) / c.m, qS * CZ / c.m

    def moved(x: Named, u: Named, p: Named, ax: Any, az: Any) -> tuple[Any, Any]:
        """Vdot, alphadot from the specific force; no side force is felt."""
        forward, right, down = motion.velocity_of(x.V, x.theta - x.gamma, u.beta)
        udot, vdot, wdot = motion.velocity_derivative(
            forward, right, down, u.p, u.q - p.q_bias, u.r, u.phi, x.theta, ax, 0.0, az
        )
        Vdot = (forward * udot + right * vdot + down * wdot) / x.V
        return Vdot, (forward * wdot - down * udot) / (forward**2 + down**2)

    def dynamics(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        Vdot, alphadot = moved(x, u, p, *felt(x, u, p))
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, u.q - p.q_bias, u.r)
        flight = (Vdot, thetadot - alphadot, thetadot, _climb_rate(x.V, x.theta - x.gamma, x.theta, u))
        return (*flight, *(-x[name] * u.V_ref / GUST_LENGTHS_M[name] for name in GUSTS)) if gusts else flight

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        ax, az = felt(x, u, p)
        Vdot, alphadot = moved(x, u, p, ax, az)
        gust, gust_alpha = (x.gust, x.gust_alpha) if gusts else (0.0, 0.0)
        return (
            (x.V - p.air_data_lag * Vdot) * (1 + p.V_scale) + p.V_bias + gust,
            (x.theta - x.gamma - p.air_data_lag * alphadot) * (1 + p.alpha_scale - 2 * p.V_scale)
            + p.alpha_bias
            + gust_alpha,
            ax + p.ax_bias,
            az + p.az_bias,
            x.h,
        )

    def initial_state(segment: Segment) -> Mapping[str, float]:
        state = dict(level_flight_state(segment))
        if {"theta", "alpha"} <= set(state):
            state["gamma"] = state["theta"] - state["alpha"]
        return {**state, **(dict.fromkeys(GUSTS, 0.0) if gusts else {})}

    lag = Parameter(name="air_data_lag", start=priors.air_data_lag_mean_s, prior_sigma=priors.air_data_lag_s, unit="s")
    return Model(
        name="level_run in gusts" if gusts else "level_run",
        states=("V", "gamma", "theta", "h", *(GUSTS if gusts else ())),
        inputs=("thrust", "thrust_per_speed", "V_ref", "J", "elevator", "q", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az", "h"),
        parameters=(
            *_aerodynamic_parameters(c, priors),
            *_thrust_parameters(priors),
            *_sensor_parameters(priors, V_bias_free=True),
            lag,
            _gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=initial_state,
    ).changed(CLq=_prior(priors.CLq_mean, priors.CLq))


def gust_noise(V_mps: float, *, gust_mps: float = 0.3) -> tuple[ProcessNoise, ...]:
    """The process noise of `level_run(gusts=True)`, to be estimated: at speed V, starting from gusts of a strength.

    A first-order gust of time constant T = L/V and intensity w has the variance w^2 T/2 (MIL-F-8785C sec. 3.7.1.2).
    """
    noises = []
    for state, length in GUST_LENGTHS_M.items():
        sigma = gust_mps if state == "gust" else gust_mps / V_mps
        half = length / V_mps / 2
        noises.append(ProcessNoise(state=state, start=float(sigma / np.sqrt(half)), acted_s=half))
    return tuple(noises)


def longitudinal(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """All of longitudinal motion, for elevator inputs such as 3-2-1-1: states V, alpha, theta, q, h.

    With pitching moment Cm0, Cma, Cmq, Cmde and CLq; outputs V, alpha, q, ax, az, h. CLde is free without a prior:
    such an input separates elevator from angle of attack.
    Raises InputError when the aircraft file does not have the moments of inertia.
    """
    c = Constants.of(aircraft)
    inertia = c.inertia
    if inertia is None:
        raise InputError(
            f"{aircraft.name}: the pitching moment takes mass.Ix, mass.Iy and mass.Iz of the aircraft file, such as"
            ' Iy = "0.28 kg m^2"'
        )

    def dynamics(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        Vdot, alphadot, _ = _wind_axis_derivative(c, x.V, x.alpha, x.theta, x.q, u, p, J_ref)
        _, thetadot, _ = motion.attitude_derivative(u.phi, x.theta, u.p, x.q, u.r)
        Cm = p.Cm0 + p.Cma * x.alpha + p.Cmq * _q_hat(c, x.q, x.V) + p.Cmde * u.elevator
        M = u.rho * x.V**2 / 2 * c.S * c.chord * Cm
        _, qdot, _ = motion.rate_derivative(u.p, x.q, u.r, 0.0, M, 0.0, inertia)
        return Vdot, alphadot, thetadot, qdot, _climb_rate(x.V, x.alpha, x.theta, u)

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        return (
            *_air_data(x, p),
            x.q + p.q_bias,
            *_specific_force(c, x.V, x.alpha, x.q, u, p, J_ref),
            x.h,
        )

    return Model(
        name="longitudinal",
        states=("V", "alpha", "theta", "q", "h"),
        inputs=("thrust", "J", "elevator", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "q", "ax", "az", "h"),
        parameters=(
            *_aerodynamic_parameters(c, priors),
            # Typical of model aircraft and light singles with a static margin of 15 %.
            Parameter(name="Cm0", start=0.05),
            Parameter(name="Cma", start=-0.15 * lift_slope(c.aspect_ratio), unit="1/rad"),
            Parameter(name="Cmq", start=-15.0, unit="1/rad"),
            Parameter(name="Cmde", start=-1.2, unit="1/rad"),
            *_thrust_parameters(priors),
            *_sensor_parameters(priors, V_bias_free=False),
            _gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=level_flight_state,
    ).changed(CLq={"free": True, "start": 5.0}, CLde={"prior_sigma": np.inf})


def wind_axis_forces(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """Regression of forces on a reconstructed path: no states, V and alpha are inputs.

    Outputs, per unit of mass [m/s^2]: `drag` = -(ax cos alpha + az sin alpha) and `lift` = ax sin alpha - az cos alpha,
    of the specific force felt, thrust included (`wind_axis_outputs` makes them). Biases of accelerometers and alpha
    are the path's business: they are not estimated again here, which would cost far more than it gains.
    """
    c = Constants.of(aircraft)

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        ax, az = _true_specific_force(c, u.V, u.alpha, u.q, u, p, J_ref)
        lift, drag = stability_axes(ax, az, u.alpha)
        return drag, lift

    return Model(
        name="wind_axis_forces",
        inputs=("V", "alpha", "thrust", "J", "elevator", "q", "rho"),
        outputs=("drag", "lift"),
        parameters=(*_aerodynamic_parameters(c, priors), *_thrust_parameters(priors)),
        output_function=outputs,
    )


def wind_axis_outputs(ax: Any, az: Any, alpha: Any) -> dict[str, Any]:
    """Measured outputs of `wind_axis_forces`, elementwise, from bias-free specific force [m/s^2] and alpha [rad]."""
    lift, drag = stability_axes(ax, az, alpha)
    return {"drag": drag, "lift": lift}


def quick_start(aircraft: Aircraft, segments: Segment | Sequence[Segment], CLde: float = 0.4) -> dict[str, float]:
    """Starting values of CL0, CLa, A0, A1, A2 by equation error: coefficients of each sample, by least squares.

    No accuracy is claimed, biases and noise of the regressors go straight in. Where the polar so found bends the
    wrong way, the generic one stays.
    """
    c = Constants.of(aircraft)
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)

    def pooled(name: str) -> Any:
        return np.concatenate([segment.z[name] if name in segment.z else segment.u[name] for segment in segments])

    V, alpha, ax, az = (pooled(name) for name in ("V", "alpha", "ax", "az"))
    qS = pooled("rho") * V**2 / 2 * c.S
    CL, CD = stability_axes((c.m * ax - pooled("thrust")) / qS, c.m * az / qS, alpha)
    good = np.isfinite(CL) & np.isfinite(CD) & (qS > 0)
    CL, CD, alpha, elevator = CL[good], CD[good], alpha[good], pooled("elevator")[good]
    start = {q.name: q.start for q in _aerodynamic_parameters(c, Priors()) if q.free and q.name != "CLde"}
    if len(CL) < len(start):
        return start
    line = np.linalg.lstsq(np.stack([np.ones_like(alpha), alpha], axis=1), CL - CLde * elevator, rcond=None)[0]
    if line[1] > 0:
        start |= {"CL0": float(line[0]), "CLa": float(line[1])}
    polar = np.linalg.lstsq(np.stack([np.ones_like(CL), CL, CL**2], axis=1), CD, rcond=None)[0]
    if polar[0] > 0 and polar[2] > 0:
        start |= {name: float(value) for name, value in zip(("A0", "A1", "A2"), polar, strict=True)}
    return start


def level_flight_state(segment: Segment) -> Mapping[str, float]:
    """V, alpha, theta, q, h at a segment's start, from its first second: theta = alpha + climb angle, q = 0."""
    first = slice(0, max(2, round(1 / segment.step_s)))
    t = segment.t_s[first] - segment.t_s[0]

    def line(name: str) -> tuple[float, float]:
        """(value, slope) at the start."""
        if name not in segment.z:
            return np.nan, np.nan
        values = segment.z[name][first]
        good = np.isfinite(values)
        if good.sum() < 2:
            return np.nan, np.nan
        slope, value = np.polyfit(t[good], values[good], 1)
        return float(value), float(slope)

    (V, _), (alpha, _), (h, hdot) = line("V"), line("alpha"), line("h")
    theta = alpha + np.arcsin(np.clip(hdot / V, -1, 1))
    guess = {"V": V, "alpha": alpha, "theta": float(theta), "q": 0.0, "h": h}
    return {name: value for name, value in guess.items() if np.isfinite(value)}


def _aerodynamic_parameters(c: Constants, priors: Priors) -> tuple[Parameter, ...]:
    # A cambered wing with fuselage and gear; e = 0.8 is usual for such aircraft.
    return (
        Parameter(name="CL0", start=0.25),
        Parameter(name="CLa", start=lift_slope(c.aspect_ratio), unit="1/rad"),
        Parameter(name="CLde", start=priors.CLde_mean, prior_sigma=priors.CLde, unit="1/rad"),
        Parameter(name="CLq", start=0.0, unit="1/rad", free=False),
        Parameter(name="A0", start=0.04),
        Parameter(name="A1", start=0.0),
        Parameter(name="A2", start=1 / (np.pi * 0.8 * c.aspect_ratio)),
    )


def _prior(mean: float, sigma: float) -> dict[str, Any]:
    return {"free": True, "start": mean, "prior_sigma": sigma}


def _thrust_parameters(priors: Priors) -> tuple[Parameter, ...]:
    return (
        Parameter(name="thrust_scale", start=0.0, prior_sigma=priors.thrust_scale),
        Parameter(name="thrust_slope", start=0.0, prior_sigma=priors.thrust_slope),
    )


def _sensor_parameters(priors: Priors, *, V_bias_free: bool) -> tuple[Parameter, ...]:
    return (
        Parameter(name="V_scale", start=0.0, prior_sigma=priors.V_scale),
        Parameter(name="V_bias", start=0.0, prior_sigma=priors.V_bias_mps, unit="m/s", free=V_bias_free),
        Parameter(name="alpha_scale", start=0.0, prior_sigma=priors.alpha_scale),
        Parameter(name="alpha_bias", start=0.0, prior_sigma=priors.alpha_bias_rad, unit="rad"),
        Parameter(name="ax_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
        Parameter(name="az_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
    )


def _gyro_bias(priors: Priors, *, free: bool) -> Parameter:
    return Parameter(name="q_bias", start=0.0, prior_sigma=priors.gyro_bias_radps, unit="rad/s", free=free)


def _q_hat(c: Constants, q: Any, V: Any) -> Any:
    return q * c.chord / (2 * V)


def _lift_and_drag(c: Constants, V: Any, alpha: Any, q: Any, u: Named, p: Named) -> tuple[Any, Any]:
    CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * _q_hat(c, q, V)  # (3.35)
    return CL, p.A0 + p.A1 * CL + p.A2 * CL**2


def _thrust(u: Named, p: Named, J_ref: float) -> Any:
    return u.thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J - J_ref))


def _wind_axis_derivative(
    c: Constants, V: Any, alpha: Any, theta: Any, q: Any, u: Named, p: Named, J_ref: float
) -> tuple[Any, Any, Any]:
    CL, CD = _lift_and_drag(c, V, alpha, q, u, p)
    return motion.wind_axis_derivative(
        V, alpha, u.beta, u.phi, theta, u.p, q, u.r,
        CL=CL, CD=CD, CY=0.0, T=_thrust(u, p, J_ref), m=c.m, qS=u.rho * V**2 / 2 * c.S,
    )  # fmt: skip


def _true_specific_force(c: Constants, V: Any, alpha: Any, q: Any, u: Named, p: Named, J_ref: float) -> tuple[Any, Any]:
    CX, CZ = body_axes(*_lift_and_drag(c, V, alpha, q, u, p), alpha)
    qS = u.rho * V**2 / 2 * c.S
    return (qS * CX + _thrust(u, p, J_ref)) / c.m, qS * CZ / c.m  # (3.39), (3.40)


def _specific_force(c: Constants, V: Any, alpha: Any, q: Any, u: Named, p: Named, J_ref: float) -> tuple[Any, Any]:
    ax, az = _true_specific_force(c, V, alpha, q, u, p, J_ref)
    return ax + p.ax_bias, az + p.az_bias


def _air_data(x: Named, p: Named) -> tuple[Any, Any]:
    """Measured V and alpha (3.43)."""
    return x.V * (1 + p.V_scale) + p.V_bias, x.alpha * (1 + p.alpha_scale) + p.alpha_bias


def _climb_rate(V: Any, alpha: Any, theta: Any, u: Named) -> Any:
    """hdot in still air."""
    forward, right, down = motion.velocity_of(V, alpha, u.beta)
    return -motion.earth_from_body(forward, right, down, u.phi, theta, 0.0)[2]
