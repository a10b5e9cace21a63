"""Which of its sensors' errors a flight determined, and what it lacked where it did not.

An error was determined when the flight left clearly less of the uncertainty assumed beforehand. What it lacked is read
off the flight itself: its headings, its speeds, the air, what was recorded.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.trajectory import time_shift
from analysis.trajectory.blocks import block_mean
from analysis.trajectory.reconstruction import Trajectory
from analysis.trajectory.time_shift import LEARNT
from flight.errors import InputError

DEG, PERCENT, MILLI = float(np.degrees(1.0)), 100.0, 1000.0
# In words, and the unit a reader thinks in.
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
}
MATTERS = ("alpha_bias", "alpha_scale", "V_scale")  # for the power curve, of which a flight may fail to determine them
FAR_OFF, DOUBTFUL = 3.0, 2.0  # of the compass: standard deviations of its offset, and of its error about that
ONE_HEADING = 0.7  # length of the mean of unit vectors along the headings: 1 is one heading, 0 to and fro
ONE_SPEED = 1.25  # fastest over slowest: a quarter faster is a third less lift coefficient
UNCERTAIN_ALPHA_DEG, TURBULENT_MPS = 0.3, 0.3  # W20 = 6 kt and more, as the trajectory shows it
GUSTY_MPS = 0.1  # vertical, 1 sigma: W20 = 2 kt


class Flown(NamedTuple):
    """What a flight had of what determines errors of sensors."""

    gps: bool
    sideslip: bool
    headings: float  # length of the mean of unit vectors along them
    speed_ratio: float  # of the 95th to the 5th percentile
    gust_mps: float


class Learnt(NamedTuple):
    """One error of a sensor: what the flight says of it, in `unit`, and what it lacked to say more."""

    name: str
    title: str
    value: float
    standard_error: float
    prior_sigma: float
    unit: str
    determined: bool
    missing: tuple[str, ...]

    def in_words(self) -> str:
        """ "This flight does not show the scale of airspeed: …"."""
        return (
            f"This flight does not show the {self.title}: uncertain by {self.prior_sigma:.2g} {self.unit} (1 sigma)"
            f" beforehand, and {self.standard_error:.2g} after. Why: {'; '.join(self.missing)}. The interval allows for"
            " it."
        )


def flown(table: pd.DataFrame, trajectory: Trajectory) -> Flown:
    """What the flight had. table: as `air_data` leaves it, the one the path was reconstructed from."""
    n = len(trajectory.states)
    V, height = (block_mean(table[name], n) for name in ("V_mps", "height_m"))
    high = (height > LEAST_HEIGHT_M) & np.isfinite(V)
    heading = trajectory.states["psi"].to_numpy()[high]
    slow, fast = np.percentile(V[high], (5, 95)) if high.any() else (1.0, 1.0)
    return Flown(
        gps="gps_north" in trajectory.residuals and bool(table["gps_north_mps"].notna().any()),
        sideslip=bool(table["beta_rad"].notna().any()),
        headings=float(abs(np.mean(np.exp(1j * heading)))) if high.any() else 1.0,
        speed_ratio=float(fast / slow),
        gust_mps=trajectory.gust_mps,
    )


_AIR = frozenset({"alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag"})
_ACROSS = frozenset({"V_scale", "beta_bias", "ay_bias", "r_bias"})
# What may lack, in words with what to do about it, and what then stays unknown.
_LACKS: tuple[tuple[Callable[[Flown], bool], str, frozenset[str]], ...] = (
    (lambda f: not f.gps, "no GPS", _ACROSS | {"gps_latency", "heading_bias"}),
    (lambda f: not f.sideslip, "sideslip was not measured", frozenset({"beta_bias"})),
    (
        lambda f: f.headings > ONE_HEADING,
        "nearly one heading throughout; fly opposite headings, with turns between",
        _ACROSS,
    ),
    (
        lambda f: f.speed_ratio < ONE_SPEED,
        "nearly one speed throughout; fly slow and fast",
        frozenset({"alpha_scale", "air_data_lag", "V_scale"}),
    ),
    (lambda f: f.gust_mps > GUSTY_MPS, "gusts hide it; fly longer, or on a calmer day", _AIR - {"alpha_scale"}),
    (
        lambda f: f.gust_mps > GUSTY_MPS,
        "gusts hide it; porpoise for a minute (stick to and fro, 1.5 s a cycle), or fly on a calmer day",
        frozenset({"alpha_scale"}),
    ),
)
_TOO_LITTLE = "too short a flight, or too little happened in it"


def missing(name: str, had: Flown) -> tuple[str, ...]:
    """What the flight lacked to determine the number of that name (of SENSOR_ERRORS), in words."""
    return tuple(words for lacks, words, hidden in _LACKS if name in hidden and lacks(had)) or (_TOO_LITTLE,)


def sensor_error_estimates(table: pd.DataFrame, trajectory: Trajectory) -> list[Learnt]:
    """Each of SENSOR_ERRORS, the ones that matter most first; nothing of a compass where none was used.

    table: what `reconstruct` made the path of.
    """
    had = flown(table, trajectory)
    out = []
    for name, (title, factor, unit) in TITLES.items():
        if name == "heading_bias" and "compass" not in trajectory.residuals:
            continue
        sigma, before = trajectory.standard_error(name), trajectory.assumed(name)
        determined = sigma < LEARNT * before
        lacked = () if determined else missing(name, had)
        value = factor * trajectory.value(name)
        out.append(Learnt(name, title, value, factor * sigma, factor * before, unit, determined, lacked))
    return out


def trajectory_notes(
    table: pd.DataFrame,
    trajectory: Trajectory,
    errors: list[Learnt],
    runs: int,
    *,
    magnetometer_calibrated: bool,
    log: str,
) -> list[str]:
    """What a reader of the power curve should know of gusts, time shifts, heading and sensor errors, in sentences.

    runs: how many accelerations and decelerations there are. Raises InputError as `gust_notes`.
    """
    return (
        gust_notes(trajectory, runs, log)
        + time_shift.notes(trajectory)
        + heading_notes(table, trajectory, calibrated=magnetometer_calibrated)
        + sensor_error_notes(errors)
    )


def gust_notes(trajectory: Trajectory, runs: int, log: str) -> list[str]:
    """What turbulence leaves unknown, in words.

    Raises InputError where all there is is one run, and gusts leave the angle of attack more uncertain than one run can
    stand: a degree is 20 % of power near the stall (method section 6).
    """
    sigma_deg = float(np.degrees(trajectory.standard_error("alpha_bias")))
    if sigma_deg < UNCERTAIN_ALPHA_DEG or trajectory.gust_mps < TURBULENT_MPS:
        return []
    said = f"vertical gusts of {trajectory.gust_mps:.1f} m/s leave the angle of attack uncertain by {sigma_deg:.1f} deg"
    if runs == 1:
        raise InputError(f"{log}: one run alone, and {said}; fly more runs, longer, or on a calmer day")
    return [f"In this air {said}: the interval is wide. A longer or a calmer flight makes it narrower."]


def sensor_error_notes(errors: list[Learnt]) -> list[str]:
    """What a reader of the power curve should know: errors it rests on that the flight did not determine."""
    return [error.in_words() for error in errors if error.name in MATTERS and not error.determined]


def heading_notes(table: pd.DataFrame, trajectory: Trajectory, *, calibrated: bool) -> list[str]:
    """What a flight knows of its heading, where that is less than usual. calibrated: whether the magnetometer was."""
    gps, left = flown(table, trajectory).gps, trajectory.residuals.get("compass")
    if left is not None:
        off = trajectory.value("heading_bias")
        if left > DOUBTFUL or abs(off) > FAR_OFF * trajectory.assumed("heading_bias"):
            against = "GPS" if gps else "the gyros"
            return [
                f"The magnetometer contradicts {against}: its heading is off by {DEG * off:+.0f} deg,"
                f" and about that by {left:.1f} times its error. Is it mounted as the tray's file has it?"
            ]
        held = DEG * float(np.median(trajectory.states_error()["psi"]))
        said = f"No GPS: the magnetometer held the heading, to {held:.1f} deg (1 sigma) of magnetic north."
        return [] if gps else [said]
    if gps:
        return []
    said = "No GPS: the heading was not determined; it is counted from where the nose pointed at first."
    if not calibrated and "mag_x_T" in table and table["mag_x_T"].notna().any():
        said += " A magnetometer was recorded, but not its calibration; `analyze --magnetometer` takes one."
    return [said]
