"""Makes the record of a flight without a log, for methods that need one."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from flightpower.analysis.air.contents import LogContents, Replacements
from flightpower.analysis.air.flight_data import FlightData
from flightpower.analysis.flight import Reconstructed
from flightpower.analysis.maneuvers.flown import flown_condition
from flightpower.analysis.maneuvers.kinds import Maneuver, Maneuvers
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import PriorConflict
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.propeller import Propeller


def flight_record(
    table: pd.DataFrame,
    trajectory: Any,
    runs: list[Maneuver],
    aircraft: Aircraft,
    propeller: Propeller,
    **overrides: Any,
) -> Reconstructed:
    """Return the record of a flight; `overrides` replaces any of its fields, such as flown_CL."""
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
    return Reconstructed(**fields | overrides)
