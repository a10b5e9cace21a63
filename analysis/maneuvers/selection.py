"""Selects the maneuvers that an analysis uses: those found in the data, or those of an edited file."""

from pathlib import Path

import pandas as pd

from analysis.maneuvers import toml_file
from analysis.maneuvers.find import find
from analysis.maneuvers.kinds import FOR_DRAG, LEVEL_RUNS, Maneuvers, RejectedManeuver
from analysis.maneuvers.quality import TOO_LOW
from analysis.signals.aircraft_size import flying_Pa, speed_scale_of
from analysis.signals.synchronize import COLUMNS
from flight.errors import InputError

PRESSURES = ("q_c_Pa", "dp_alpha_Pa", "static_Pa")  # flight is recognized only if all of these are measured


def select(table: pd.DataFrame, rest: list[slice], log: str, runs_file: Path | None = None) -> Maneuvers:
    """The maneuvers found, or the ones that `runs_file` keeps.

    table: of `air_data`. rest: rows in which the aircraft stood still.
    Raises InputError naming the log or the file if no maneuver allows drag to be estimated.
    """
    entries = toml_file.load(runs_file) if runs_file else None
    found = find(table, rest)
    if entries:
        found = toml_file.apply(entries, table, found.rejected, str(runs_file))
    if found.of(*FOR_DRAG):
        return found
    if runs_file:
        raise InputError(f"{runs_file}: no maneuver to analyse; keep one of these: {', '.join(FOR_DRAG)}")
    missed = nearest_miss(found.rejected, table, rested=bool(rest))
    raise InputError(f"{log}: no acceleration or deceleration to analyse{missed}")


def nearest_miss(rejected: list[RejectedManeuver], table: pd.DataFrame, *, rested: bool = True) -> str:
    """Why there is no run: the reason for the longest rejected one, or why no flight was recognized.

    rested: the aircraft stood still somewhere in the log.
    """
    if not table["flying"].any():
        dead = sorted({COLUMNS[name][0] for name in PRESSURES if table[name].isna().all()})
        if dead:
            return f": {', '.join(dead)} showed nothing (a broken transducer or a blocked tube)"
        return (
            f": no flight in it (dynamic pressure below {flying_Pa(speed_scale_of(table)):.0f} Pa,"
            " or flow angles outside the probe calibration)"
        )
    missed = [stretch for stretch in rejected if stretch.kind in LEVEL_RUNS]
    if not missed:
        return " (speed never changed steadily in level flight)"
    longest = max(missed, key=lambda r: r.end_s - r.start_s)
    reason = f"; the longest stretch, {longest.start_s:.0f} to {longest.end_s:.0f} s: {longest.reason}"
    if rested or not longest.reason.startswith(TOO_LOW):
        return reason
    return (
        f"{reason}; there is no rest on the ground in the log, and the height where it begins is taken as the ground's"
    )
