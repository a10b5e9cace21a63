"""Maneuvers: stretches of a flight, by kind. A run is a level acceleration or deceleration."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

ACCELERATION, DECELERATION, STEADY = "acceleration", "deceleration", "steady"
ROLLER_COASTER, WIND_UP_TURN, STEPS_3211 = "roller coaster", "wind-up turn", "3-2-1-1"
PORPOISING = "porpoising"  # no drag method uses it; it determines the slope of angle of attack in the trajectory
STANDING, FLYING = "standing", "flying"

LEVEL_RUNS = (ACCELERATION, DECELERATION)  # used by the dynamic method
LOAD_FACTOR_MANEUVERS = (ROLLER_COASTER, WIND_UP_TURN)  # lift varies at nearly constant speed
FOR_DRAG = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS)
CONTEXT_KINDS = (PORPOISING, STANDING, FLYING)  # no drag method uses them: their data may have gaps
KINDS = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS, STEPS_3211, PORPOISING, STANDING, FLYING)

END_S = 0.4  # the height at either end of a maneuver is the mean over this


@dataclass(frozen=True)
class Maneuver:
    """A stretch of the flight of one of KINDS. rows: of the air data table."""

    kind: str
    rows: slice
    start_s: float
    end_s: float
    lowest_speed_mps: float
    highest_speed_mps: float
    altitude_change_m: float
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.kind} at {self.start_s:.0f} s"


@dataclass(frozen=True)
class RejectedManeuver:
    """A stretch that looked like a maneuver, and the reason why it is not used."""

    kind: str
    start_s: float
    end_s: float
    reason: str


@dataclass(frozen=True)
class Maneuvers:
    """All maneuvers of a flight and all rejected stretches, each in order of time."""

    maneuvers: list[Maneuver]
    rejected: list[RejectedManeuver] = field(default_factory=list)

    def of(self, *kinds: str) -> list[Maneuver]:
        return [maneuver for maneuver in self.maneuvers if maneuver.kind in kinds]

    @property
    def level_runs(self) -> list[Maneuver]:
        return self.of(*LEVEL_RUNS)


def maneuver_in(
    kind: str, rows: slice, table: pd.DataFrame, V: NDArray[np.float64], notes: tuple[str, ...] = ()
) -> Maneuver:
    """The maneuver in some rows of the table. V: smoothed speed [m/s], (n,), one value per row of the table."""
    step_s = float(table.index[1] - table.index[0])
    few = max(1, round(END_S / step_s))
    height, speed = table["height_m"].to_numpy()[rows], V[rows]
    flown = np.isfinite(speed).any() and np.isfinite(height).any()
    height = height[np.isfinite(height)]
    return Maneuver(
        kind,
        rows,
        float(table.index[rows.start]),
        float(table.index[rows.stop - 1]),
        float(np.nanmin(speed)) if flown else 0.0,
        float(np.nanmax(speed)) if flown else 0.0,
        float(height[-few:].mean() - height[:few].mean()) if flown else 0.0,
        notes,
    )
