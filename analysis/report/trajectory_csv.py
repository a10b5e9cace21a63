"""The reconstructed trajectory as CSV."""

import pandas as pd

from analysis.trajectory.equations import GUST_FILTER_STATES, STATES
from analysis.trajectory.reconstruction import Trajectory

COLUMNS = {name: f"{name}_mps" for name in STATES}
COLUMNS |= {"phi": "roll_rad", "theta": "pitch_rad", "psi": "yaw_rad", "height": "height_m"}


def trajectory_csv(trajectory: Trajectory) -> str:
    """Every state with its standard error (`…_error`), one line each 0.2 s; units in the header."""
    states = trajectory.states.drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS)
    errors = trajectory.states_error().drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS).add_suffix("_error")
    return str(pd.concat([states, errors], axis=1).to_csv(float_format="%.6g", lineterminator="\n"))
