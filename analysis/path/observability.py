"""Which of its sensors' errors a flight determined, and what it lacked where it did not.

An error was determined when the flight left clearly less of the uncertainty assumed beforehand. What it lacked is read
off the flight itself: its headings, its speeds, the air, what was recorded.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.airdata.air import LOW_M
from analysis.airdata.skew import LEARNT
from analysis.path.blocks import block_mean
from analysis.path.reconstruct import Path

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


def flown(table: pd.DataFrame, path: Path) -> Flown:
    """What the flight had. table: as `air_data` leaves it, the one the path was reconstructed from."""
    n = len(path.states)
    V, height = (block_mean(table[name], n) for name in ("V_mps", "height_m"))
    high = (height > LOW_M) & np.isfinite(V)
    heading = path.states["psi"].to_numpy()[high]
    slow, fast = np.percentile(V[high], (5, 95)) if high.any() else (1.0, 1.0)
    return Flown(
        gps="gps_north" in path.residuals and bool(table["gps_north_mps"].notna().any()),
        sideslip=bool(table["beta_rad"].notna().any()),
        headings=float(abs(np.mean(np.exp(1j * heading)))) if high.any() else 1.0,
        speed_ratio=float(fast / slow),
        gust_mps=path.gust_mps,
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
    """What the flight lacked to determine the number of that name (of SHARED), in words."""
    return tuple(words for lacks, words, hidden in _LACKS if name in hidden and lacks(had)) or (_TOO_LITTLE,)


def learnt(table: pd.DataFrame, path: Path) -> list[Learnt]:
    """Each of SHARED, the ones that matter most first; nothing of a compass where none was used.

    table: what `reconstruct` made the path of.
    """
    had = flown(table, path)
    out = []
    for name, (title, factor, unit) in TITLES.items():
        if name == "heading_bias" and "compass" not in path.residuals:
            continue
        sigma, before = path.standard_error(name), path.assumed(name)
        determined = sigma < LEARNT * before
        lacked = () if determined else missing(name, had)
        value = factor * path.value(name)
        out.append(Learnt(name, title, value, factor * sigma, factor * before, unit, determined, lacked))
    return out


def notes(errors: list[Learnt]) -> list[str]:
    """What a reader of the power curve should know: errors it rests on that the flight did not determine."""
    return [error.in_words() for error in errors if error.name in MATTERS and not error.determined]


def heading_said(table: pd.DataFrame, path: Path, *, calibrated: bool) -> list[str]:
    """What a flight knows of its heading, where that is less than usual. calibrated: whether the magnetometer was."""
    gps, left = flown(table, path).gps, path.residuals.get("compass")
    if left is not None:
        off = path.value("heading_bias")
        if left > DOUBTFUL or abs(off) > FAR_OFF * path.assumed("heading_bias"):
            against = "GPS" if gps else "the gyros"
            return [
                f"The magnetometer contradicts {against}: its heading is off by {DEG * off:+.0f} deg,"
                f" and about that by {left:.1f} times its error. Is it mounted as the tray's file has it?"
            ]
        held = DEG * float(np.median(path.states_error()["psi"]))
        said = f"No GPS: the magnetometer held the heading, to {held:.1f} deg (1 sigma) of magnetic north."
        return [] if gps else [said]
    if gps:
        return []
    said = "No GPS: the heading was not determined; it is counted from where the nose pointed at first."
    if not calibrated and "mag_x_T" in table and table["mag_x_T"].notna().any():
        said += " A magnetometer was recorded, but not its calibration; `analyze --magnetometer` takes one."
    return [said]
