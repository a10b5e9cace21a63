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
    table = pd.concat([states, errors], axis=1).reset_index()
    line = ",".join(["%.6g"] * table.shape[1])
    lines = [",".join(table.columns), *(line % tuple(row) for row in table.to_numpy().tolist()), ""]
    return "\n".join(lines).replace("nan", "")
