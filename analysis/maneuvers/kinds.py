"""What a run is: a stretch of the flight in which something was flown that a method can use."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

ACCELERATION, DECELERATION, STEADY = "acceleration", "deceleration", "steady"
ROLLER_COASTER, WIND_UP_TURN, STEPS_3211 = "roller coaster", "wind-up turn", "3-2-1-1"
PORPOISING = "porpoising"  # no method's: what it shows is the slope of angle of attack, to the flight path
STANDING, FLYING = "standing", "flying"

LEVEL_RUNS = (ACCELERATION, DECELERATION)  # the dynamic method's
LOAD_FACTOR_MANEUVERS = (ROLLER_COASTER, WIND_UP_TURN)  # lift varies at about one speed
FOR_DRAG = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS)
WHOLE = (PORPOISING, STANDING, FLYING)  # no method's, so that nothing is asked of their data
KINDS = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS, STEPS_3211, PORPOISING, STANDING, FLYING)

END_S = 0.4  # over which the height at a run's ends is averaged


@dataclass(frozen=True)
class Run:
    """One stretch of the flight, of one of KINDS."""

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

    @property
    def seconds(self) -> float:
        return self.end_s - self.start_s


@dataclass(frozen=True)
class Rejected:
    """A stretch that looked like a run, and why it was not taken."""

    kind: str
    start_s: float
    end_s: float
    reason: str


@dataclass(frozen=True)
class Maneuvers:
    """All maneuvers of a flight and all rejected stretches, each in order of time."""

    maneuvers: list[Run]
    rejected: list[Rejected] = field(default_factory=list)

    def of(self, *kinds: str) -> list[Run]:
        return [run for run in self.maneuvers if run.kind in kinds]

    @property
    def level_runs(self) -> list[Run]:
        return self.of(*LEVEL_RUNS)


def measured(kind: str, rows: slice, table: pd.DataFrame, V: np.ndarray, notes: tuple[str, ...] = ()) -> Run:
    """The run of some rows of the table. V: smooth speed [m/s], a value for each of the table's rows."""
    step_s = float(table.index[1] - table.index[0])
    few = max(1, round(END_S / step_s))
    height, speed = table["height_m"].to_numpy()[rows], V[rows]
    flown = np.isfinite(speed).any() and np.isfinite(height).any()
    height = height[np.isfinite(height)]
    return Run(
        kind,
        rows,
        float(table.index[rows.start]),
        float(table.index[rows.stop - 1]),
        float(np.nanmin(speed)) if flown else 0.0,
        float(np.nanmax(speed)) if flown else 0.0,
        float(height[-few:].mean() - height[:few].mean()) if flown else 0.0,
        notes,
    )
