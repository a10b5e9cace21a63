"""Prior standard deviations of the sensor errors and of the initial state."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.sensor_noise import ZEROS
from flight.aircraft import Uncertainty

Array = NDArray[np.float64]

CHANGE_OF_ZERO = "change_of_zero"  # between rest and flight, among what the aircraft file states; no sensor error
UNMEASURED_ZERO_PA = 1.0  # of a log without rest, by `daq zero` on another day or at another temperature


def stated_sigma(uncertainty: Uncertainty) -> Mapping[str, float]:
    """Prior standard deviation of each sensor error, as [uncertainty] of the aircraft file states it."""
    accelerometer = uncertainty.accelerometer_offset_mps2
    return MappingProxyType({
        "p_bias": 0.002, "q_bias": 0.002, "r_bias": 0.002,  # about the zeros at rest
        "ax_bias": accelerometer, "ay_bias": accelerometer, "az_bias": accelerometer,
        "alpha_bias": uncertainty.angle_of_attack_offset_rad,
        "alpha_scale": uncertainty.angle_of_attack_slope_fraction,
        "beta_bias": np.radians(1.0),
        "V_scale": uncertainty.airspeed_scale_fraction,
        "air_data_lag": uncertainty.air_data_lag_s, "gps_latency": 0.2,
        "heading_bias": np.radians(10.0),  # declination in inhabited regions, and how the tray sits
        "dp_alpha_zero": UNMEASURED_ZERO_PA, "q_c_zero": UNMEASURED_ZERO_PA,
        CHANGE_OF_ZERO: uncertainty.transducer_zero_Pa,
    })  # fmt: skip


PRIOR_SIGMA = stated_sigma(Uncertainty())  # where the aircraft file states nothing
PRIOR_MEAN = {"gps_latency": 0.1}
# What remains of two priors once the transducers are calibrated: error of the density, position error of the static
# ports, differences of the probe on the aircraft from the probe in the tunnel. Values assumed, not measured.
REMAINING_SIGMA = {"V_scale": 0.003, "alpha_scale": 0.005}
# Without GPS the compass defines north, and without a compass the initial heading does; standard deviation of either.
NORTH_RAD = 0.01
INITIAL_BLOCKS = 25  # a log in which the aircraft is at rest within these began at rest


def sensor_error_prior(
    alpha_scale_sigma: float,
    calibrated: Mapping[str, float] = MappingProxyType({}),
    stated: Mapping[str, float] = PRIOR_SIGMA,
    zeros: Mapping[str, float] = MappingProxyType({}),
    *,
    gps: bool,
) -> tuple[Array, Array]:
    """Mean and standard deviation (m,), order of SENSOR_ERRORS.

    alpha_scale_sigma : of the slope of the probe's calibration, in addition to the stated one
    calibrated : standard errors by the calibration of the transducers, by name of REMAINING_SIGMA; in place of
        the stated ones. An error of the reference's scale acts on both; they are taken as independent.
    stated : of `stated_sigma`
    zeros : standard errors [Pa] of the zeros that the log shows, `zeros_at_rest`
    """
    own = {name: float(np.hypot(error, REMAINING_SIGMA[name])) for name, error in calibrated.items()}
    sigma = {**stated, **own, **zeros}
    for name in ZEROS:
        sigma[name] = float(np.hypot(sigma[name], stated[CHANGE_OF_ZERO]))
    sigma["alpha_scale"] = float(np.hypot(sigma["alpha_scale"], alpha_scale_sigma))
    if not gps:
        sigma["heading_bias"] = NORTH_RAD
    return (
        np.array([PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS]),
        np.array([sigma[name] for name in SENSOR_ERRORS]),
    )


def initial_state_sigma(sigma_w_mps: float, *, heading_measured: bool, at_rest: bool) -> Array:
    """Standard deviation (nx,) of the initial state, order of STATES. sigma_w_mps: of vertical gusts."""
    heading = 3.0 if heading_measured else NORTH_RAD
    velocity = 0.3 if at_rest else 10.0
    return np.array([1.0, 0.5, heading, *[velocity] * 3, 3.0, 8.0, 8.0, *[max(sigma_w_mps, 0.01)] * 5])


def begins_at_rest(at_rest: NDArray[np.bool_]) -> bool:
    """Whether the log begins with the aircraft at rest. at_rest: (n,) blocks at rest."""
    return bool(at_rest.any()) and int(np.argmax(at_rest)) < INITIAL_BLOCKS
