"""Process and measurement equations of the trajectory reconstruction.

States at each instant: Euler angles, inertial velocity north-east-down, height, slowly varying wind, gusts, and the
filter states of the lateral and vertical gusts. Sensor errors are constant over the flight: biases, scales, lags;
the mean updraft is listed with them. The functions use NumPy; `linearized_equations` has CasADi differentiate them.

The aircraft responds to gusts: it heaves within a second and yaws into them within two; only its speed responds slowly.
If this response multiplied a free sensor error, gusts would be attributed to the sensor (estimators.md).
Therefore gusts are taken along the body axes, their effect on the flow depends on the predicted flow only, each scale
multiplies a value predicted from past data, and the measurement equations are differentiated at predicted states.
Residuals are exact; their derivatives are uncorrelated with the current gust (instrumental variables).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flightpower.flight import motion
from flightpower.flight.aircraft import VIBRATION_REVPS
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2 as g

GUST_FILTER_STATES = ("gust_v_filtered_twice", "gust_w_filtered_twice")  # g2 of dryden.SecondOrderGust
STATES = ("phi", "theta", "psi", "v_north", "v_east", "v_down", "height",
          "wind_north", "wind_east", "gust_u", "gust_v", "gust_w", *GUST_FILTER_STATES)  # fmt: skip
SENSOR_ERRORS = ("p_bias", "q_bias", "r_bias", "ax_bias", "ay_bias", "az_bias", "alpha_bias", "alpha_scale",
                 "beta_bias", "V_scale", "air_data_lag", "gps_latency", "heading_bias",
                 "dp_alpha_zero", "q_c_zero", "ax_vibration", "az_vibration", "alpha_per_g", "updraft",
                 "p_scale", "q_scale", "r_scale", "ax_scale", "az_scale", "probe_ahead")  # fmt: skip
CONING_SCULLING = ("coning_phi", "coning_theta", "coning_psi", "sculling_north", "sculling_east", "sculling_down")
# Inputs for the step between two instants: mean rates and specific force; predictions from past data of those that have
# a scale error; time step; what means leave out of the changes of angles and velocity; ratio of the mean wind at the
# two heights; decay factors of gusts.
PROCESS_INPUTS = ("p", "q", "r", "ax", "ay", "az", "vibration",
                  "p_predicted", "q_predicted", "r_predicted", "ax_predicted", "az_predicted", "dt", *CONING_SCULLING,
                  "wind_ratio", "decay_u", "decay_v", "decay_w")  # fmt: skip
MEASUREMENTS = ("V", "alpha", "beta", "height", "gps_north", "gps_east", "gps_down", "v_north", "v_east", "v_down",
                "compass")  # fmt: skip
# Flow predicted from past data; variance of lateral and vertical gusts together, (m/s)^2; d ln V/d ln(pressure
# difference of the alpha ports).
PREDICTED_FLOW = ("V_predicted", "alpha_predicted", "transverse_gust_variance", "dlnV_dlndp_alpha")
# Airspeed scale [1/Pa] and offset of the angle of attack [rad/Pa] that each pascal of `q_c_zero` and `dp_alpha_zero`
# causes.
BY_ZEROS = ("V_scale_per_Pa", "alpha_per_Pa")
LEVEL_FIELD = ("field_forward", "field_right")  # measured magnetic field in level axes along and across the heading [T]
# Regressors of the errors of the angle of attack: its change by the slope; the derivative of the angle at the probe,
# for the lag; its change by the airspeed scale; the load factor less 1; its change for each meter that the probe sits
# farther ahead; and its mean over a block less the value at the block's center.
ALPHA_REGRESSORS = ("alpha_by_slope", "probe_alpha_rate", "alpha_by_V_scale", "excess_load", "alpha_per_m_ahead",
                    "alpha_curvature")  # fmt: skip
MEASUREMENT_INPUTS = ("ax", "ay", "az", "vibration", "V_mean", "V_rate", "probe_beta_rate", "beta_per_m_ahead",
                      *ALPHA_REGRESSORS, *PREDICTED_FLOW, *BY_ZEROS, *LEVEL_FIELD)  # fmt: skip


def vibration(motor_revps: Array) -> Array:
    """Square (n,) of the ratio of motor speed to VIBRATION_REVPS; 0 where the speed was not measured."""
    return np.asarray(np.nan_to_num(motor_revps / VIBRATION_REVPS) ** 2)


def corrected_force(measured: Any, errors: Any) -> tuple[Any, Any, Any]:
    """Specific force [m/s^2] without the accelerometers' errors: biases, offsets by vibration, and scale errors.

    measured: ax, ay, az, and vibration as `vibration` returns it. The lateral offset by vibration is left out because
    it changes bank and heading, but hardly drag; so is the lateral scale, because the lateral force is negligible.
    """
    return (
        (measured.ax - errors.ax_bias - errors.ax_vibration * measured.vibration) / (1 + errors.ax_scale),
        measured.ay - errors.ay_bias,
        (measured.az - errors.az_bias - errors.az_vibration * measured.vibration) / (1 + errors.az_scale),
    )


def corrected_rates(measured: Any, errors: Any) -> tuple[Any, Any, Any]:
    """Angular rates [rad/s] without the gyros' errors: biases and scale errors. measured: p, q, r."""
    return (
        (measured.p - errors.p_bias) / (1 + errors.p_scale),
        (measured.q - errors.q_bias) / (1 + errors.q_scale),
        (measured.r - errors.r_bias) / (1 + errors.r_scale),
    )


def _over_a_step(u: Any, errors: Any) -> tuple[tuple[Any, Any, Any], tuple[Any, Any, Any]]:
    """Rates and specific force without their errors, over a step; u: PROCESS_INPUTS.

    Scales multiply values predicted from past data. Otherwise the aircraft's yaw and heave into a gust would be
    mistaken for a scale error (13 deg of heading without GPS, in 15 kt). So a scale error of 2 % still leaves an error
    of 2 % in quick changes.
    """

    def of_scale(scale: Any, predicted: Any) -> Any:
        return predicted * scale / (1 + scale)

    rates = (
        u.p - errors.p_bias - of_scale(errors.p_scale, u.p_predicted),
        u.q - errors.q_bias - of_scale(errors.q_scale, u.q_predicted),
        u.r - errors.r_bias - of_scale(errors.r_scale, u.r_predicted),
    )
    force = (
        u.ax - errors.ax_bias - errors.ax_vibration * u.vibration - of_scale(errors.ax_scale, u.ax_predicted),
        u.ay - errors.ay_bias,
        u.az - errors.az_bias - errors.az_vibration * u.vibration - of_scale(errors.az_scale, u.az_predicted),
    )
    return rates, force


def process_residuals(before: Any, after: Any, errors: Any, inputs: Any) -> Sequence[Any]:
    """State after a step less the state propagated from before it; errors: SENSOR_ERRORS, inputs: PROCESS_INPUTS.

    Mean rates and specific force are applied at the mean attitude; CONING_SCULLING corrects for what this leaves out.
    """
    a, b, u = before, after, inputs
    phi, theta, psi = (a.phi + b.phi) / 2, (a.theta + b.theta) / 2, (a.psi + b.psi) / 2
    rates, body_force = _over_a_step(u, errors)
    euler_rates = motion.attitude_derivative(phi, theta, *rates)
    force = motion.earth_from_body(body_force, (phi, theta, psi))
    v_once, v_twice = _gust_increments(a.gust_v, a.gust_v_filtered_twice, b.gust_v, b.gust_v_filtered_twice, u.decay_v)
    w_once, w_twice = _gust_increments(a.gust_w, a.gust_w_filtered_twice, b.gust_w, b.gust_w_filtered_twice, u.decay_w)
    return (
        b.phi - a.phi - u.dt * euler_rates[0] - u.coning_phi,
        b.theta - a.theta - u.dt * euler_rates[1] - u.coning_theta,
        b.psi - a.psi - u.dt * euler_rates[2] - u.coning_psi,
        b.v_north - a.v_north - u.dt * force[0] - u.sculling_north,
        b.v_east - a.v_east - u.dt * force[1] - u.sculling_east,
        b.v_down - a.v_down - u.dt * (force[2] + g) - u.sculling_down,
        b.height - a.height + u.dt * (a.v_down + b.v_down) / 2,
        b.wind_north - u.wind_ratio * a.wind_north,
        b.wind_east - u.wind_ratio * a.wind_east,
        b.gust_u - u.decay_u * a.gust_u,
        v_once,
        w_once,
        v_twice,
        w_twice,
    )


def _gust_increments(gust_a: Any, twice_a: Any, gust_b: Any, twice_b: Any, decay: Any) -> tuple[Any, Any]:
    """Increments over a step of g1 and g2 (dryden.SecondOrderGust); g1 follows from the gust g and g2."""
    once_a, once_b = (twice + (gust - twice) / np.sqrt(3) for gust, twice in ((gust_a, twice_a), (gust_b, twice_b)))
    return once_b - decay * once_a, twice_b - decay * twice_a - (1 - decay) * (once_a + once_b) / 2


def flow(x: Any, predicted: Any, updraft_mps: Any = 0.0) -> tuple[Any, Any, Any]:
    """Airspeed [m/s], angles of attack and of sideslip [rad] at state x; predicted: PREDICTED_FLOW.

    updraft_mps : mean vertical motion of the air. It changes the angle of attack as 1/V, whereas an offset is constant
        and a slope error varies as 1/V^2; in a turn it also changes sideslip. Its effect on airspeed, in proportion to
        the sine of the flight-path angle, is left out.

    The flow is linear in the gust, which is resolved along and across the predicted flow. Resolved along and across the
    actual flow, it would give products of gusts that act like an offset of angle of attack.

    The mean effect of transverse gusts g on airspeed is included. Airspeed is |v - g| = V - v.g/V + g^2/(2 V), with the
    direction of flight v/V. The aircraft heaves and yaws with the gust, so v also has a transverse component g, which
    the predicted flow lacks: v.g/V contains g^2/V on average, and the sum is -g^2/(2 V).
    """
    steady = x.v_north - x.wind_north, x.v_east - x.wind_east, x.v_down
    u, v, w = motion.body_from_earth(steady, (x.phi, x.theta, x.psi))
    V = np.sqrt(u**2 + v**2 + w**2 + 1e-6)  # never zero, for the derivative at rest
    cos_alpha, sin_alpha = np.cos(predicted.alpha_predicted), np.sin(predicted.alpha_predicted)
    return (
        V
        - x.gust_u * cos_alpha
        - x.gust_w * sin_alpha
        - predicted.transverse_gust_variance / (2 * predicted.V_predicted),
        np.arctan2(w, np.sqrt(u**2 + 1e-6))
        + (x.gust_u * sin_alpha - x.gust_w * cos_alpha + updraft_mps * np.cos(x.phi)) / predicted.V_predicted,
        np.arcsin(v / V) - (x.gust_v - updraft_mps * np.sin(x.phi)) / predicted.V_predicted,
    )


def measurement_model(x: Any, errors: Any, inputs: Any) -> Sequence[Any]:
    """Return each of MEASUREMENTS at state x; errors: SENSOR_ERRORS, inputs: MEASUREMENT_INPUTS.

    If airspeed reads high by a fraction, dynamic pressure reads high by twice that; flow angles are pressure
    differences over dynamic pressure, and read low by as much. An angle that reads low selects the wrong q_c/qbar in
    the probe's calibration, which changes airspeed (dlnV_dlndp_alpha). A lag subtracts the derivative times the lag.
    Slope and lag act on the angle at the probe, upwash and rotation included. The slope error is an error of the
    pressure difference and acts through the probe's calibration, which is curved: at 12 deg it multiplies 10.6 deg
    (alpha_by_slope). Upwash and rotation are subtracted in proportion to 1/V^2 and 1/V, so an airspeed error changes
    them too (alpha_by_V_scale). The zeros of q_c and dp_alpha act as an airspeed scale and as an offset of the angle,
    each in inverse proportion to dynamic pressure. The zero of dp_alpha also changes airspeed by 0.01 % per 0.1 Pa,
    which is left out.

    A probe farther ahead than assumed moves up as the aircraft pitches up, and to the right as it yaws to the right.

    compass: component of the earth's field across magnetic north, which is zero. Leveling of the field uses a fixed
    attitude (LEVEL_FIELD), so among the attitude angles only heading changes this residual. Otherwise errors of the
    magnetometer (hard iron) would change bank and pitch.
    """
    V, alpha, beta = flow(x, inputs, errors.updraft)
    V_scale = errors.V_scale + errors.q_c_zero * inputs.V_scale_per_Pa
    alpha_slope = errors.alpha_scale - 2 * V_scale
    force = motion.earth_from_body(corrected_force(inputs, errors), (x.phi, x.theta, x.psi))
    return (
        V
        + V_scale * inputs.V_mean
        + inputs.dlnV_dlndp_alpha * alpha_slope * inputs.V_predicted
        - errors.air_data_lag * inputs.V_rate,
        alpha
        + inputs.alpha_curvature
        + errors.alpha_scale * inputs.alpha_by_slope
        + V_scale * inputs.alpha_by_V_scale
        + errors.dp_alpha_zero * inputs.alpha_per_Pa
        + errors.alpha_per_g * inputs.excess_load
        + errors.probe_ahead * inputs.alpha_per_m_ahead
        - errors.air_data_lag * inputs.probe_alpha_rate
        + errors.alpha_bias,
        beta
        - errors.air_data_lag * inputs.probe_beta_rate
        + errors.probe_ahead * inputs.beta_per_m_ahead
        + errors.beta_bias,
        x.height,
        x.v_north - errors.gps_latency * force[0],
        x.v_east - errors.gps_latency * force[1],
        x.v_down - errors.gps_latency * (force[2] + g),
        x.v_north,
        x.v_east,
        x.v_down,
        inputs.field_forward * np.sin(x.psi + errors.heading_bias)
        + inputs.field_right * np.cos(x.psi + errors.heading_bias),
    )


class NamedArrays:
    """Values by name: `x.theta`."""

    def __init__(self, names: Sequence[str], values: Iterable[Any]):
        self.__dict__.update(zip(names, values, strict=True))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"no value is named {name!r}")


@dataclass(frozen=True)
class EquationInputs:
    """Inputs of the equations over n instants; a weight is 1/sigma, and 0 where nothing was measured."""

    process_inputs: Array  # (n-1, len(PROCESS_INPUTS))
    process_weight: Array  # (n-1, nx)
    measured: Array  # (n, ny), columns MEASUREMENTS
    measurement_weight: Array  # (n, ny)
    measurement_inputs: Array  # (n, len(MEASUREMENT_INPUTS))
    predicted_states: Array  # (n, nx), states at which the measurement equations are differentiated,
    predicted_inputs: Array  # (n, len(MEASUREMENT_INPUTS)), and their inputs there
