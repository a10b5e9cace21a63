"""What is known before the reconstruction: sensor noise at rest, priors of the sensor errors, and a first trajectory.

The first trajectory starts the iteration: attitude from angle of attack and climb, velocity from GPS or airspeed.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.resolution import error_of_a_step
from flightpower.analysis.sources.rest import mean_at_rest
from flightpower.analysis.trajectory.block_means import BlockMeans, moving_average
from flightpower.analysis.trajectory.dryden import mean_wind_profile
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.measurements import LevelField
from flightpower.analysis.trajectory.settings import PRIORS, PROCESS, SENSORS
from flightpower.flight.aerodynamics import lift_slope
from flightpower.flight.aircraft import Aircraft, Uncertainty
from flightpower.flight.arrays import Array

BENCH_SIGMA = SENSORS.bench_sigma
WIND = slice(STATES.index("wind_north"), STATES.index("wind_east") + 1)
ZEROS = {"dp_alpha_zero": "dp_alpha_Pa", "q_c_zero": "q_c_Pa"}  # sensor errors, and their channels


def noise_at_rest(
    table: pd.DataFrame, rest: list[slice], resolution: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float]:
    """Standard deviation of one sample of each channel of BENCH_SIGMA. rest: rows in which the aircraft is at rest.

    A reading that does not change at rest, such as air data that begin at some airspeed, shows no noise, so the noise
    on the bench is used. resolution: by channel, the step of its values; a step that is larger than the noise hides it,
    and is added as noise.
    """
    noise = {}
    for name, bench in BENCH_SIGMA.items():
        variance = np.array([table[name].iloc[rows].var() for rows in rest])
        measured = variance[variance > np.finfo(float).eps]  # excludes the rounding of a constant, and NaN
        noise[name] = (
            float(max(np.sqrt(measured.mean()), SENSORS.least_noise_share * bench)) if len(measured) else bench
        )
        step = resolution.get(name, 0.0)
        if step > noise[name]:
            noise[name] = math.hypot(noise[name], error_of_a_step(step))
    return noise


def zeros_at_rest(table: pd.DataFrame, rest: list[slice], noise: dict[str, float]) -> dict[str, float]:
    """Standard errors [Pa] of the zeros of ZEROS; empty without rest. noise: from `noise_at_rest`.

    They follow from the scatter of means over seconds, which includes noise correlated over shorter times; they are no
    smaller than white noise makes them.
    """
    samples = sum(rows.stop - rows.start for rows in rest)
    if not samples:
        return {}
    step_s = float(table.index[1] - table.index[0])
    errors = {name: mean_at_rest(table[channel], rest, step_s)[1] for name, channel in ZEROS.items()}
    return {name: float(np.fmax(errors[name], noise[ZEROS[name]] / np.sqrt(samples))) for name in ZEROS}


# Contributions to the zero of the airspeed pressure that the aircraft file states; not sensor errors themselves.
CHANGE_OF_ZERO = "change_of_zero"  # between rest and flight; also of the angle-of-attack pressure
POSITION_ERROR = "position_error"  # an error of airspeed in proportion to the lift coefficient


def stated_sigma(
    uncertainty: Uncertainty, wing_loading_Pa: float = 0.0, *, motor_speed: bool = True
) -> Mapping[str, float]:
    """Prior standard deviation of each sensor error, as [uncertainty] of the aircraft file states it.

    motor_speed : whether the motor speed in the log is a motor's. A motor speed computed from a thrust column tells
    nothing about vibration: an offset in proportion to thrust would act like an error of thrust, 2 % of power where 1 %
    of thrust is stated.

    A relative error k C_L of airspeed is a relative error 2 k C_L of dynamic pressure. In level flight C_L times
    dynamic pressure is the wing loading, so the airspeed pressure has a constant error. Hysteresis of a fraction h of a
    swing makes readings too low by h/2 of the swing on the way up and too high on the way down, like a lag of h/2 times
    the duration of the swing, which is 20 s in a run.
    """
    swing_s = 20.0
    accelerometer = uncertainty.accelerometer_offset_mps2
    negligible = 1e-6  # for an error that does not exist, so that the covariance has an inverse
    vibration = uncertainty.accelerometer_vibration_mps2 if motor_speed else negligible
    return MappingProxyType({
        **{name: sigma for name, (_, sigma) in PRIORS.unstated.items()},
        "ax_bias": accelerometer, "ay_bias": accelerometer, "az_bias": accelerometer,
        "ax_scale": uncertainty.accelerometer_scale_fraction, "az_scale": uncertainty.accelerometer_scale_fraction,
        "alpha_bias": uncertainty.angle_of_attack_offset_rad,
        "alpha_scale": uncertainty.angle_of_attack_slope_fraction,
        "V_scale": uncertainty.airspeed_scale_fraction,
        "air_data_lag": math.hypot(uncertainty.air_data_lag_s, uncertainty.hysteresis_fraction * swing_s / 2),
        "dp_alpha_zero": PRIORS.unmeasured_zero_Pa, "q_c_zero": PRIORS.unmeasured_zero_Pa,
        "ax_vibration": vibration, "az_vibration": vibration,
        "alpha_per_g": uncertainty.boom_bending_rad, "probe_ahead": negligible,
        "updraft": max(uncertainty.updraft_mps, negligible),  # may be stated as 0
        CHANGE_OF_ZERO: uncertainty.transducer_zero_Pa,
        POSITION_ERROR: 2 * uncertainty.airspeed_per_lift_fraction * wing_loading_Pa,
    })  # fmt: skip


PRIOR_SIGMA = stated_sigma(Uncertainty())  # where the aircraft file states nothing
PRIOR_MEAN = {name: mean for name, (mean, _) in PRIORS.unstated.items()}
UPWASH, PROBE_POSITION = "probe.upwash_per_CL", "probe.position"  # keys of the aircraft file


def upwash_slope_sigma(aircraft: Aircraft) -> float:
    """Standard deviation of the slope of angle of attack due to an upwash that is missing from the aircraft file.

    It is the upwash per CL times the lift slope of the wing; 0 if the file gives the upwash.
    """
    if aircraft.has(UPWASH):
        return 0.0
    return float(PRIORS.upwash_rad * lift_slope(aircraft.aspect_ratio))


def probe_ahead_sigma_m(aircraft: Aircraft) -> float:
    """Standard deviation [m] of the probe's distance ahead of the center of gravity; negligible if in the file."""
    return PRIOR_SIGMA["probe_ahead"] if aircraft.has(PROBE_POSITION) else PRIORS.probe_ahead_m


class SensorPriors(NamedTuple):
    """What is known about the sensor errors before a flight.

    alpha_scale_sigma : standard deviation of the slope of the probe's calibration, in addition to the stated one
    file_sigma : standard deviations from `stated_sigma`
    calibrated : standard errors from the calibration of the transducers, by name of PRIORS.calibrated; they replace
        the stated ones. An error of the reference's scale acts on both; they are treated as independent.
    factor : factor on all standard deviations, a number or (m,)
    height_noise : noise of the height in flight over its noise at rest
    resolution : steps of the values as recorded, by channel
    probe_ahead_m : standard deviation of the probe's distance ahead of the center of gravity
    """

    alpha_scale_sigma: float = 0.0
    file_sigma: Mapping[str, float] = PRIOR_SIGMA
    calibrated: Mapping[str, float] = MappingProxyType({})
    factor: ArrayLike = 1.0
    height_noise: float = 1.0
    resolution: Mapping[str, float] = MappingProxyType({})
    probe_ahead_m: float = PRIOR_SIGMA["probe_ahead"]


def sensor_error_prior(
    priors: SensorPriors, zeros: Mapping[str, float] = MappingProxyType({}), *, gps: bool
) -> tuple[Array, Array]:
    """Mean and standard deviation (m,), order of SENSOR_ERRORS.

    zeros : standard errors [Pa] of the zeros that the log shows, `zeros_at_rest`
    """
    alpha_scale_sigma, file_sigma, calibrated, factor, *_ = priors
    with_calibration = {name: float(np.hypot(error, PRIORS.calibrated[name])) for name, error in calibrated.items()}
    sigma = {**file_sigma, **with_calibration, **zeros, "probe_ahead": priors.probe_ahead_m}
    for name in ZEROS:
        sigma[name] = float(np.hypot(sigma[name], file_sigma[CHANGE_OF_ZERO]))
    sigma["q_c_zero"] = float(np.hypot(sigma["q_c_zero"], file_sigma[POSITION_ERROR]))
    sigma["alpha_scale"] = float(np.hypot(sigma["alpha_scale"], alpha_scale_sigma))
    if not gps:
        sigma["heading_bias"] = PRIORS.north_rad
    return (
        np.array([PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS]),
        np.array([sigma[name] for name in SENSOR_ERRORS]) * np.asarray(factor),
    )


def initial_state_sigma(sigma_w_mps: float, *, heading_measured: bool, at_rest: bool) -> Array:
    """Standard deviation (nx,) of the initial state, order of STATES. sigma_w_mps: of vertical gusts."""
    heading = 3.0 if heading_measured else PRIORS.north_rad
    velocity = 0.3 if at_rest else 10.0
    return np.array([1.0, 0.5, heading, *[velocity] * 3, 3.0, 8.0, 8.0, *[max(sigma_w_mps, 0.01)] * 5])


def begins_at_rest(at_rest: NDArray[np.bool_]) -> bool:
    """Whether the log begins with the aircraft at rest. at_rest: (n,) blocks at rest."""
    return bool(at_rest.any()) and int(np.argmax(at_rest)) < PRIORS.initial_blocks


def initial_states(blocks: BlockMeans, bank: Array, V_reference: Array, field: LevelField | None) -> Array:
    """States (n, nx). bank: (n,) [rad]. V_reference: (n,) smoothed airspeed. field: None without a compass."""
    flying = blocks.flying
    x = np.zeros((blocks.n, len(STATES)))
    climb = np.gradient(moving_average(blocks["height_m"], 7), blocks.t_s)
    alpha = moving_average(np.where(flying, blocks["alpha_rad"], np.nan), 5)
    theta = alpha + np.arcsin(np.clip(climb / V_reference, -0.5, 0.5))
    x[:, 0] = bank * flying
    x[:, 1] = np.where(flying, theta, 0.0)
    yaw_rate = np.nan_to_num(blocks["r_radps"]) / np.cos(x[:, 0])
    heading = np.cumsum(yaw_rate) * (blocks.t_s[1] - blocks.t_s[0])
    north, east = (moving_average(blocks[f"gps_{axis}_mps"], 3) for axis in ("north", "east"))
    if np.isfinite(north).all():
        x[:, 3], x[:, 4] = north, east
        wind_sigma = initial_state_sigma(0.0, heading_measured=True, at_rest=False)[WIND]
        x[:, WIND] = mean_wind(x[flying, 3:5], V_reference[flying], wind_sigma) * _relative_wind(blocks)[:, None]
        air = x[:, 3:5] - x[:, WIND] * flying[:, None]
        heading = _with_track(heading, air[:, 0], air[:, 1], PROCESS.slowest_mps * blocks.speed_scale)
    else:
        if field is not None:
            heading = heading + field.heading_offset(heading, x[:, 0], x[:, 1])
        speed = np.where(flying, V_reference, 0.0)
        x[:, 3], x[:, 4] = speed * np.cos(heading), speed * np.sin(heading)
    x[:, 2], x[:, 5], x[:, 6] = heading, -climb, moving_average(blocks["height_m"], 3)
    return x


def mean_wind(velocity: Array, V: Array, sigma_mps: Array) -> Array:
    """The mean wind (2,), north and east [m/s], from ground speed and airspeed; zero on one heading.

    velocity : (n, 2) over the ground [m/s]        V : (n,) airspeed [m/s]        sigma_mps : (2,) prior of the wind

    V^2 = |v - w|^2 is linear in the wind w and in a constant: 2 v.w - c = |v|^2 - V^2, c = |w|^2. The constant is left
    free, which takes up errors of the airspeed. The prior pulls the wind to zero where it is lost in the scatter of the
    residuals.

    If the wind is nearly as fast as the aircraft, iterations that begin without it end at a gust that stops the
    aircraft over the ground.
    """
    if not len(V):
        return np.zeros(2)
    v, excess = velocity - velocity.mean(axis=0), np.sum(velocity**2, axis=1) - V**2
    excess = excess - excess.mean()
    normal, right = 4 * v.T @ v / len(v), 2 * v.T @ excess / len(v)
    least_squares = np.linalg.lstsq(normal, right)[0]
    residual_variance = float(np.mean((excess - 2 * v @ least_squares) ** 2))
    return np.asarray(np.linalg.lstsq(normal + residual_variance * np.diag(sigma_mps**-2), right)[0])


def _relative_wind(blocks: BlockMeans) -> Array:
    """The mean wind at each height (n,) over its mean in flight."""
    profile = mean_wind_profile(moving_average(blocks["height_m"], 3))
    return np.asarray(profile / (profile[blocks.flying].mean() if blocks.flying.any() else 1.0))


def initial_sensor_errors(prior_mean: Array, blocks: BlockMeans, x: Array, field: LevelField | None) -> Array:
    """Prior means (m,), with the compass offset measured against the headings of x. field: None without compass or
    without GPS."""
    errors = prior_mean.copy()
    if field is not None:
        offset = field.heading_offset(x[:, 2], x[:, 0], x[:, 1])[blocks.flying]
        errors[SENSOR_ERRORS.index("heading_bias")] = np.angle(np.mean(np.exp(1j * offset)))
    return errors


def _with_track(heading: Array, north: Array, east: Array, least_mps: float) -> Array:
    """The track through the air, interpolated where slower than `least_mps`; with too few fast values, the integrated
    heading, shifted by its mean offset from the track."""
    fast = np.hypot(north, east) > least_mps
    if fast.sum() > STATISTICS.fewest_values:
        track = np.unwrap(np.arctan2(east, north)[fast])
        return np.interp(np.arange(len(heading)), np.flatnonzero(fast), track)
    offset = np.angle(np.sum(np.exp(1j * (np.arctan2(east, north) - heading))[fast]))
    return np.asarray(heading + offset)
