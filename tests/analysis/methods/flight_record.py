"""The record of a flight that no log holds, for methods that take the record."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from analysis.air.contents import LogContents, Replacements
from analysis.air.flight_data import FlightData
from analysis.air.flown import flown_condition
from analysis.flight import Reconstructed
from analysis.maneuvers.kinds import Maneuver, Maneuvers
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.observability import PriorConflict
from flight.aircraft import Aircraft
from flight.propeller import Propeller


def flight_record(
    table: pd.DataFrame, trajectory: Any, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller, **known: Any
) -> Reconstructed:
    """known: other fields of the record, such as flown_CL."""
    log: Any = SimpleNamespace(path=Path("flight.mcap"), entries={}, attachments={})
    probe: Any = None
    fields: dict[str, Any] = {
        "log": log,
        "replacements": Replacements(),
        "contents": LogContents(aircraft, propeller, probe, None, None, []),
        "data": FlightData(table, [], zeroed=True, compass=None, notes=[]),
        "maneuvers": Maneuvers(runs),
        "runs_file": None,
        "condition": flown_condition(table, aircraft) if len(table) else None,
        "flown_CL": (0.2, 1.0),
        "trajectory": trajectory,
        "prior_conflict": PriorConflict(np.ones(len(SENSOR_ERRORS)), {}, 1.0),
    }
    return Reconstructed(**fields | known)
