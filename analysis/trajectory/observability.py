"""Which sensor errors a flight determined, and what it lacked to determine the others.

A flight determines a sensor error when the standard error is clearly below the prior standard deviation. What it lacked
follows from its excitation: headings, speeds, gusts, recorded channels.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from analysis.trajectory.reconstruction import Trajectory
from analysis.trajectory.sensor_noise import ZEROS
from analysis.trajectory.time_shift import DETERMINED_SHARE, time_shift_notes
from flight.errors import InputError

DEG, PERCENT, MILLI = float(np.degrees(1.0)), 100.0, 1000.0
# Title, factor and unit for the reader.
TITLES: dict[str, tuple[str, float, str]] = {
    "alpha_bias": ("offset of angle of attack", DEG, "deg"),
    "alpha_scale": ("slope of angle of attack", PERCENT, "%"),
    "V_scale": ("scale of airspeed", PERCENT, "%"),
    "beta_bias": ("offset of sideslip", DEG, "deg"),
    "air_data_lag": ("lag of the probe", MILLI, "ms"),
    "gps_latency": ("latency of GPS", MILLI, "ms"),
    "heading_bias": ("offset of the compass, declination included", DEG, "deg"),
    "ax_bias": ("bias of the accelerometer, forward", 1.0, "m/s²"),
    "ay_bias": ("bias of the accelerometer, right", 1.0, "m/s²"),
    "az_bias": ("bias of the accelerometer, down", 1.0, "m/s²"),
    "p_bias": ("bias of the roll gyro", DEG, "deg/s"),
    "q_bias": ("bias of the pitch gyro", DEG, "deg/s"),
    "r_bias": ("bias of the yaw gyro", DEG, "deg/s"),
    "dp_alpha_zero": ("zero of the angle-of-attack pressure", 1.0, "Pa"),
    "q_c_zero": ("zero of the airspeed pressure", 1.0, "Pa"),
}
MATTERS = ("alpha_bias", "alpha_scale", "V_scale")  # sensor errors with a large effect on the power curve
# Compass: largest offset in prior standard deviations, and largest rms residual in standard deviations.
LARGEST_COMPASS_OFFSET, LARGEST_COMPASS_RESIDUAL = 3.0, 2.0
ONE_HEADING = 0.7  # length of the mean heading vector above which a flight counts as flown on one heading
ONE_SPEED = 1.25  # ratio of fastest to slowest speed; a quarter faster has a third less lift coefficient
UNCERTAIN_ALPHA_DEG, TURBULENT_MPS = 0.3, 0.3  # W20 = 6 kt and more
GUSTY_MPS = 0.1  # vertical, 1 sigma: W20 = 2 kt


class FlightExcitation(NamedTuple):
    """What a flight contains that determines sensor errors.

    mean_heading_vector : length of the mean of unit vectors along the headings: 1 on one heading, 0 to and fro
    speed_ratio : 95th over 5th percentile of airspeed       gust_mps : vertical, 1 sigma
    """

    gps: bool
    sideslip: bool
    mean_heading_vector: float
    speed_ratio: float
    gust_mps: float


class SensorErrorEstimate(NamedTuple):
    """One sensor error, in `unit`; missing: what the flight lacked to determine it."""

    name: str
    title: str
    value: float
    standard_error: float
    prior_sigma: float
    unit: str
    determined: bool
    missing: tuple[str, ...]

    def in_words(self) -> str:
        """ "This flight does not determine the scale of airspeed: …"."""
        return (
            f"This flight does not determine the {self.title}: standard deviation {self.prior_sigma:.2g} {self.unit}"
            f" before the flight, {self.standard_error:.2g} {self.unit} after it. Reason: {'; '.join(self.missing)}."
            " The interval includes this uncertainty."
        )


def excitation(trajectory: Trajectory) -> FlightExcitation:
    """What the flight contains."""
    blocks = trajectory.block_means
    flying = blocks.flying
    heading, V = trajectory.states["psi"].to_numpy()[flying], blocks["V_mps"][flying]
    slow, fast = np.percentile(V, (5, 95)) if flying.any() else (1.0, 1.0)
    return FlightExcitation(
        gps="gps_north" in trajectory.residuals and blocks.measured("gps_north_mps"),
        sideslip=blocks.measured("beta_rad"),
        mean_heading_vector=float(abs(np.mean(np.exp(1j * heading)))) if flying.any() else 1.0,
        speed_ratio=float(fast / slow),
        gust_mps=trajectory.gust_mps,
    )


_AIR_DATA = frozenset({"alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag"})
_CROSSWIND = frozenset({"V_scale", "beta_bias", "ay_bias", "r_bias"})  # a steady wind on one heading acts like these
# Condition; reason, with advice; sensor errors that are then not determined.
_REASONS: tuple[tuple[Callable[[FlightExcitation], bool], str, frozenset[str]], ...] = (
    (lambda f: not f.gps, "no GPS", _CROSSWIND | {"gps_latency", "heading_bias"}),
    (lambda f: not f.sideslip, "sideslip was not measured", frozenset({"beta_bias"})),
    (
        lambda f: f.mean_heading_vector > ONE_HEADING,
        "nearly one heading throughout; fly opposite headings, with turns between",
        _CROSSWIND,
    ),
    (
        lambda f: f.speed_ratio < ONE_SPEED,
        "nearly one speed throughout; fly slow and fast",
        frozenset({"alpha_scale", "air_data_lag", "V_scale"}),
    ),
    (lambda f: f.gust_mps > GUSTY_MPS, "gusts; fly longer, or on a calmer day", _AIR_DATA - {"alpha_scale"}),
    (
        lambda f: f.gust_mps > GUSTY_MPS,
        "gusts; porpoise for a minute (stick to and fro, 1.5 s a cycle), or fly on a calmer day",
        frozenset({"alpha_scale"}),
    ),
)
_TOO_LITTLE = "the flight is too short or has too few changes of speed and attitude"


def missing(name: str, flight: FlightExcitation) -> tuple[str, ...]:
    """Reasons why the flight does not determine a sensor error, for the reader. name: of SENSOR_ERRORS."""
    return tuple(reason for holds, reason, errors in _REASONS if name in errors and holds(flight)) or (_TOO_LITTLE,)


def sensor_error_estimates(trajectory: Trajectory) -> list[SensorErrorEstimate]:
    """Each of SENSOR_ERRORS that a flight determines, those with the largest effect on power first.

    Without the zeros of the pressures, which rest shows and not flight; the compass only where one was used.
    """
    flight = excitation(trajectory)
    estimates = []
    for name, (title, factor, unit) in TITLES.items():
        if name in ZEROS or (name == "heading_bias" and "compass" not in trajectory.residuals):
            continue
        sigma, prior = trajectory.standard_error(name), trajectory.prior_standard_error(name)
        determined = sigma < DETERMINED_SHARE * prior
        reasons = () if determined else missing(name, flight)
        value = factor * trajectory.value(name)
        estimates.append(
            SensorErrorEstimate(name, title, value, factor * sigma, factor * prior, unit, determined, reasons)
        )
    return estimates


def trajectory_notes(
    trajectory: Trajectory,
    errors: list[SensorErrorEstimate],
    runs: int,
    *,
    magnetometer_calibrated: bool,
    log: str,
) -> list[str]:
    """Notes for the reader of the power curve on gusts, time shifts, heading and sensor errors.

    runs: number of accelerations and decelerations. Raises InputError as `gust_notes`.
    """
    return (
        gust_notes(trajectory, runs, log)
        + time_shift_notes(trajectory)
        + heading_notes(trajectory, calibrated=magnetometer_calibrated)
        + sensor_error_notes(errors)
    )


def gust_notes(trajectory: Trajectory, runs: int, log: str) -> list[str]:
    """The effect of turbulence on the angle of attack.

    Raises InputError for a single run in gusts that leave the angle of attack more uncertain than UNCERTAIN_ALPHA_DEG:
    a degree is 20 % of power near the stall.
    """
    sigma_deg = float(np.degrees(trajectory.standard_error("alpha_bias")))
    if sigma_deg < UNCERTAIN_ALPHA_DEG or trajectory.gust_mps < TURBULENT_MPS:
        return []
    effect = (
        f"vertical gusts of {trajectory.gust_mps:.1f} m/s leave the angle of attack uncertain by {sigma_deg:.1f} deg"
    )
    if runs == 1:
        raise InputError(f"{log}: one run alone, and {effect}; fly more runs, longer, or on a calmer day")
    return [f"{effect[0].upper()}{effect[1:]}: the interval is wide. A longer or calmer flight narrows it."]


def sensor_error_notes(errors: list[SensorErrorEstimate]) -> list[str]:
    """Sensor errors with a large effect on power that the flight did not determine."""
    return [error.in_words() for error in errors if error.name in MATTERS and not error.determined]


def heading_notes(trajectory: Trajectory, *, calibrated: bool) -> list[str]:
    """How the heading was determined, where GPS did not, and whether the compass agrees. calibrated: whether the log
    has a calibration of the magnetometer."""
    gps, residual = excitation(trajectory).gps, trajectory.residuals.get("compass")
    if residual is not None:
        offset = trajectory.value("heading_bias")
        largest = LARGEST_COMPASS_OFFSET * trajectory.prior_standard_error("heading_bias")
        if residual > LARGEST_COMPASS_RESIDUAL or abs(offset) > largest:
            return [
                f"The magnetometer contradicts {'GPS' if gps else 'the gyros'}: mean heading error"
                f" {DEG * offset:+.0f} deg, rms residual {residual:.1f} standard deviations."
                " Check how it is mounted against the tray file."
            ]
        if gps:
            return []
        error = DEG * float(np.median(trajectory.states_error()["psi"]))
        return [f"No GPS: the magnetometer held the heading; standard error {error:.1f} deg from magnetic north."]
    if gps:
        return []
    notes = ["No GPS: the heading was not determined; it is relative to the initial heading."]
    if not calibrated and trajectory.block_means.measured("mag_x_T"):
        notes.append("A magnetometer was recorded, but not its calibration; `analyze --magnetometer` takes one.")
    return [" ".join(notes)]
