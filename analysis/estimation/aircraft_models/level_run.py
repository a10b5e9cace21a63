"""Starting values from the data: aerodynamic parameters by least squares, and the initial state of level flight.

Airspeed and angle of attack with measured pitch angle, the dissertation's model (3.38).

Level runs with all their systematic errors, in still air or with gusts as states.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.aircraft_models.forces import (
    CLq_with_prior,
    Constants,
    Priors,
    aerodynamic_parameters,
    climb_rate,
    gyro_bias,
    measured_air_data,
    measured_specific_force,
    reduced_pitch_rate,
    sensor_parameters,
    thrust_parameters,
    wind_axis_derivative,
)
from analysis.estimation.data import Segment
from analysis.estimation.filter_error import ProcessNoise
from analysis.estimation.model import Model, NamedValues, Parameter
from flight import motion
from flight.aerodynamics import body_axes, stability_axes
from flight.aircraft import Aircraft

Array = NDArray[np.float64]


def starting_values(aircraft: Aircraft, segments: Segment | Sequence[Segment], CLde: float = 0.4) -> dict[str, float]:
    """Starting values of CL0, CLa, A0, A1, A2: CL and CD of each sample, and a least-squares line and parabola.

    Biases of the sensors and noise in the regressors are ignored. Where lift falls with alpha, or the parabola is
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
    start = {q.name: q.start for q in aerodynamic_parameters(c, Priors()) if q.free and q.name != "CLde"}
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
    """V, alpha, theta, q, h at a segment's start, from its first second: theta = alpha + climb angle, q = 0.

    States without data are left out.
    """
    first_second = slice(0, max(2, round(1 / segment.step_s)))
    t = segment.t_s[first_second] - segment.t_s[0]

    def line(name: str) -> tuple[float, float]:
        """(value, slope) at the start, of a least-squares line; NaN with fewer than two samples."""
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
    """States V, alpha; outputs V, alpha, ax, az; the pitch angle theta is an input (3.38).

    With bias and scale of V and alpha, and bias of ax and az (Table 3.1). Errors of the measured theta go into the
    estimates.
    """
    c = Constants.of(aircraft)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return wind_axis_derivative(c, x.V, x.alpha, u.theta, u.q - p.q_bias, u, p, J_ref)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return (
            *measured_air_data(x, p),
            *measured_specific_force(c, x.V, x.alpha, u.q - p.q_bias, u, p, J_ref),
        )

    return Model(
        name="two_state",
        states=("V", "alpha"),
        inputs=("thrust", "J", "elevator", "q", "theta", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az"),
        parameters=(
            *aerodynamic_parameters(c, priors),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
            gyro_bias(priors, free=False),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )


GUSTS = ("gust", "gust_alpha")
# Dryden turbulence 100 m above the ground (MIL-F-8785C sec. 3.7.3.4.1): scale lengths along and across the flow.
GUST_LENGTHS_M = {"gust": 263.0, "gust_alpha": 100.0}


def level_run(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5, gusts: bool = False) -> Model:
    """States V, gamma, theta, h; alpha = theta - gamma.

    The flight path angle gamma (wings level) replaces alpha as a state, so that the gyro acts on theta alone. Process
    noise of theta is then the noise of the gyro, with its correct effect on alpha and lift.

    Thrust is thrust + thrust_per_speed (V - V_ref), at the speed of the state: the table read at an airspeed 3 % too
    high gives 9 % too little thrust at high speed. Airspeed has a scale, a bias and a lag. Flow angles are pressures
    over dynamic pressure, so that a scale of airspeed has minus twice its effect on alpha.

    gusts : two more first-order states, the gust along the flow [m/s] and `gust_alpha` across it [rad], with
    GUST_LENGTHS_M, for `filter_error` with `gust_noise`. Wing, propeller and probe see V + gust and alpha + gust_alpha;
    the aircraft moves through the mean air with V and alpha. The scales of the air data do not act on the gusts, so
    that the response of the forces to gusts does not contribute to their estimates.
    """
    c = Constants.of(aircraft)

    def specific_force(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
        """ax, az [m/s^2], of the wing and propeller in the gusts."""
        mean_alpha = x.theta - x.gamma
        V, alpha = (x.V + x.gust, mean_alpha + x.gust_alpha) if gusts else (x.V, mean_alpha)
        table_thrust = u.thrust + u.thrust_per_speed * (V - u.V_ref)
        T = table_thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J * V / u.V_ref - J_ref))
        q_hat = reduced_pitch_rate(c, u.q - p.q_bias, u.V_ref)
        CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * q_hat
        CX, CZ = body_axes(CL, p.A0 + p.A1 * CL + p.A2 * CL**2, alpha)
        qS = u.rho * V**2 / 2 * c.S
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
        flight = (Vdot, thetadot - alphadot, thetadot, climb_rate(x.V, x.theta - x.gamma, x.theta, u))
        return (*flight, *(-x[name] * u.V_ref / GUST_LENGTHS_M[name] for name in GUSTS)) if gusts else flight

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        ax, az = specific_force(x, u, p)
        Vdot, alphadot = flow_derivative(x, u, p, ax, az)
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
            *aerodynamic_parameters(c, priors),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
            lag,
            gyro_bias(priors, free=True),
        ),
        dynamics=dynamics,
        output_function=outputs,
        initial_state=initial_state,
    ).changed(CLq=CLq_with_prior(priors))


def gust_noise(V_mps: float, *, gust_mps: float = 0.3) -> tuple[ProcessNoise, ...]:
    """Process noise of `level_run(gusts=True)` at airspeed V, free, with a starting value of the gusts' strength.

    gust_mps : standard deviation of the gusts. A first-order gust with time constant T = L/V and intensity w has the
    variance w^2 T/2 (MIL-F-8785C sec. 3.7.1.2).
    """
    noises = []
    for state, length in GUST_LENGTHS_M.items():
        sigma = gust_mps if state == "gust" else gust_mps / V_mps
        half_time_constant_s = length / V_mps / 2
        start = float(sigma / np.sqrt(half_time_constant_s))
        noises.append(ProcessNoise(state=state, start=start, active_before_s=half_time_constant_s))
    return tuple(noises)
