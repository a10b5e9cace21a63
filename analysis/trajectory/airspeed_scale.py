"""The airspeed scale and the wind of a flight, against GPS on headings that differ."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.trajectory.reconstruction import Trajectory

ONE_WAY = 0.75  # length of the mean heading vector: above, nearly all was flown in one direction
MOST_OF_PRIOR = 0.7  # an error that hardly shrank from what was assumed beforehand was not measured
PRIOR = 0.02


class AirspeedCalibration(NamedTuple):
    """scale: by what fraction the airspeed reads high, and its standard error; wind: mean over the flight [m/s]."""

    scale: float
    scale_error: float
    wind_mps: float
    wind_from_deg: float
    one_way: float  # 0 when flown evenly on all headings, 1 when on one
    notes: list[str]


def calibrate(table: pd.DataFrame, trajectory: Trajectory) -> AirspeedCalibration:
    """What a reconstructed flight says of its airspeed. table: as `air_data` leaves it."""
    rows = np.searchsorted(table.index.to_numpy(), trajectory.states.index.to_numpy())
    flying = table["flying"].to_numpy()[np.minimum(rows, len(table) - 1)]
    heading = trajectory.states["psi"].to_numpy()[flying]
    north, east = (trajectory.states[f"wind_{axis}"].to_numpy()[flying].mean() for axis in ("north", "east"))
    one_way = float(abs(np.mean(np.exp(1j * heading)))) if len(heading) else 1.0
    error = trajectory.standard_error("V_scale")
    notes = []
    if table["gps_north_mps"].isna().all():
        notes.append("No GPS in this log: neither scale nor wind can be known from it.")
    elif one_way > ONE_WAY:
        notes.append(
            "Nearly all was flown in one direction: scale and wind along it cannot be told apart. Fly back, too."
        )
    if error > MOST_OF_PRIOR * PRIOR:
        notes.append("The flight says hardly more of the scale than was assumed before it (2 %).")
    if not trajectory.converged:
        notes.append("The reconstruction of the path did not converge: take none of this for certain.")
    return AirspeedCalibration(
        scale=trajectory.value("V_scale"),
        scale_error=error,
        wind_mps=float(np.hypot(north, east)),
        wind_from_deg=float(np.degrees(np.arctan2(-east, -north)) % 360),
        one_way=one_way,
        notes=notes,
    )
