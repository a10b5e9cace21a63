"""Airspeed scale and wind of a flight, from airspeed against GPS on different headings."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.trajectory.reconstruction import Trajectory
from analysis.trajectory.time_shift import DETERMINED_SHARE

ONE_WAY = 0.75  # length of the mean heading vector; above it, nearly all was flown in one direction


class AirspeedCalibration(NamedTuple):
    """scale: fraction by which airspeed reads high, and its standard error; wind: mean over the flight [m/s]."""

    scale: float
    scale_error: float
    wind_mps: float
    wind_from_deg: float
    one_way: float  # length of the mean heading vector: 0 for evenly distributed headings, 1 for a single one
    notes: list[str]
    unsupported: str  # why the flight does not determine the scale, and what to fly; empty if it does


def why_not_determined(error: float, prior: float) -> str:
    """Why a flight does not determine the scale, and what to fly; empty if it does. Both: standard errors."""
    if error <= DETERMINED_SHARE * prior:
        return ""
    return (
        f"the flight does not determine the scale (standard error {100 * error:.1f} %, before the flight"
        f" {100 * prior:.1f} %): fly legs of half a minute there and back, with GPS"
    )


def notes_on(one_way: float, error: float, prior: float) -> list[str]:
    """What limits a scale, in sentences. one_way: length of the mean heading vector; prior: its standard deviation."""
    notes = []
    if one_way > ONE_WAY:
        notes.append(
            "Nearly all was flown in one direction: scale and wind along it cannot be separated. Fly back, too."
        )
    if error > DETERMINED_SHARE * prior:
        notes.append(
            f"This flight hardly determines the scale: standard error {100 * error:.1f} %,"
            f" before the flight {100 * prior:.1f} %."
        )
    return notes


def calibrate(table: pd.DataFrame, trajectory: Trajectory) -> AirspeedCalibration:
    """Airspeed scale and wind of a reconstructed flight. table: as `air_data` returns it."""
    flying = table["flying"].to_numpy()[trajectory.block_means.rows]
    heading = trajectory.states["psi"].to_numpy()[flying]
    north, east = (trajectory.states[f"wind_{axis}"].to_numpy()[flying].mean() for axis in ("north", "east"))
    one_way = float(abs(np.mean(np.exp(1j * heading)))) if len(heading) else 1.0
    error = trajectory.standard_error("V_scale")
    prior = trajectory.prior_standard_error("V_scale")
    notes = []
    if not trajectory.block_means.measured("gps_north_mps"):
        notes.append("No GPS in this log: neither scale nor wind can be determined.")
        notes += notes_on(0.0, error, prior)
    else:
        notes += notes_on(one_way, error, prior)
    if not trajectory.converged:
        notes.append("The trajectory reconstruction did not converge: do not rely on these values.")
    if not trajectory.converged:
        unsupported = "the trajectory reconstruction did not converge"
    elif not trajectory.block_means.measured("gps_north_mps"):
        unsupported = "no GPS in this log, so wind and scale are not determined: fly with GPS"
    else:
        unsupported = why_not_determined(error, prior)
    return AirspeedCalibration(
        scale=trajectory.value("V_scale"),
        scale_error=error,
        wind_mps=float(np.hypot(north, east)),
        wind_from_deg=float(np.degrees(np.arctan2(-east, -north)) % 360),
        one_way=one_way,
        notes=notes,
        unsupported=unsupported,
    )
