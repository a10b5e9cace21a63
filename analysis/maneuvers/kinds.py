"""Maneuvers: stretches of a flight, by kind. A run is a level acceleration or deceleration."""

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.maneuvers.settings import LOADS
from flightpower.analysis.records.flight import run_name
from flightpower.flight.runs import ACCELERATION, DECELERATION, Rejection, RunRejected

STEADY = "steady"
ROLLER_COASTER, WIND_UP_TURN, STEPS_3211 = "roller coaster", "wind-up turn", "3-2-1-1"
PORPOISING = "porpoising"  # no drag method uses it; it determines the slope of angle of attack in the trajectory
STANDING, FLYING = "standing", "flying"

LEVEL_RUNS = (ACCELERATION, DECELERATION)  # used by the dynamic method
LOAD_FACTOR_MANEUVERS = (ROLLER_COASTER, WIND_UP_TURN)  # lift varies at nearly constant speed
FOR_DRAG = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS)
CONTEXT_KINDS = (PORPOISING, STANDING, FLYING)  # no drag method uses them: their data may have gaps
KINDS = (*LEVEL_RUNS, STEADY, *LOAD_FACTOR_MANEUVERS, STEPS_3211, PORPOISING, STANDING, FLYING)


@dataclass(frozen=True)
class Maneuver:
    """One maneuver: kind (one of KINDS) and range of rows of the air data table."""

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
        return run_name(self.kind, self.start_s)


class Unsuitable(StrEnum):
    """Reasons why a stretch is not a maneuver, besides those for level runs (`flight.runs.RunRejected`)."""

    SPEED_DRIFTED = "speed drifted"
    SPEED_CHANGED = "speed changed"
    MOTOR_STOPPED = "motor stopped"
    MOTOR_VARIED = "motor varied"
    PORPOISE_TOO_GENTLE = "porpoise too gentle"
    LOAD_NOT_STEADY = "load not steady"
    LOAD_VARIED = "load varied"
    NOT_FLYING = "not flying"
    NO_3211 = "no 3-2-1-1"
    LEFT_OUT = "left out"


def reason_in_words(rejection: Rejection) -> str:
    """The reason in words, for the reader of the results."""
    reason, measured, limit, quantity = rejection
    percent, allowed = f"{100 * measured:.0f} %", f"{100 * limit:.0f} %"
    texts: dict[StrEnum, str] = {
        RunRejected.TOO_GENTLE: (
            f"too gentle: speed changed by {measured:.2f} m/s² at most, {limit:.2f} m/s² are needed"
        ),
        RunRejected.TOO_SHORT: f"too short: {measured:.1f} s, {limit:.2g} s are needed",
        RunRejected.TOO_LONG: f"too long: {measured:.0f} s",
        RunRejected.SPEED_CHANGED_LITTLE: f"speed changed by only {percent} of its mean, {allowed} are needed",
        RunRejected.HEIGHT_UNKNOWN: "no height was measured",
        RunRejected.TOO_LOW: f"too low: down to {measured:.0f} m above the ground, {limit:.0f} m are needed",
        RunRejected.CLIMBED: f"not level: it climbed at {measured:.1f} m/s on average",
        RunRejected.HEIGHT_VARIED: f"not level: height varied by {measured:.0f} m",
        RunRejected.BANKED: f"in a turn: bank reached {math.degrees(measured):.0f} deg",
        RunRejected.DATA_MISSING: f"no {quantity} for {percent} of the time",
        Unsuitable.SPEED_DRIFTED: f"speed drifted by {percent} of its mean, {allowed} are allowed",
        Unsuitable.SPEED_CHANGED: f"speed changed by {percent} of its mean, {allowed} are allowed",
        Unsuitable.MOTOR_STOPPED: "the motor stood still",
        Unsuitable.MOTOR_VARIED: f"the motor's speed varied by {percent}",
        Unsuitable.PORPOISE_TOO_GENTLE: f"too gentle to count: load factor {quantity} is needed",
        Unsuitable.LOAD_VARIED: f"the load factor varied by {measured:.2f} rms, {limit:.2f} are allowed",
        Unsuitable.LOAD_NOT_STEADY: f"the load factor did not rise steadily: {quantity}",
        Unsuitable.NOT_FLYING: "not in flight throughout",
        Unsuitable.NO_3211: f"steps held for {quantity} s are not a 3-2-1-1",
        Unsuitable.LEFT_OUT: "left out by hand",
    }
    return texts[reason]


@dataclass(frozen=True)
class RejectedManeuver:
    """A stretch that looked like a maneuver, and the reason why it is not used."""

    kind: str
    start_s: float
    end_s: float
    rejection: Rejection

    @property
    def reason(self) -> str:
        """The reason in words."""
        return reason_in_words(self.rejection)


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

    @property
    def for_drag(self) -> list[Maneuver]:
        """The accelerations and decelerations; if there are none, the other maneuvers that give drag."""
        return self.level_runs or self.of(*FOR_DRAG)


def maneuver_in(
    kind: str, rows: slice, table: pd.DataFrame, V: NDArray[np.float64], notes: tuple[str, ...] = ()
) -> Maneuver:
    """The maneuver in some rows of the table. V: smoothed speed [m/s], (n,), one value per row of the table."""
    step_s = float(table.index[1] - table.index[0])
    edge_rows = max(1, round(LOADS.load_smoothing_s / step_s))
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
        float(height[-edge_rows:].mean() - height[:edge_rows].mean()) if flown else 0.0,
        notes,
    )


@dataclass
class Search:
    """Maneuvers and rejected stretches of a table, as they are found. V : smoothed speed [m/s], (n,)"""

    table: pd.DataFrame
    V: NDArray[np.float64]
    maneuvers: list[Maneuver] = field(default_factory=list)
    rejected: list[RejectedManeuver] = field(default_factory=list)

    def judged(self, kind: str, rows: slice, rejection: Rejection | None, notes: tuple[str, ...] = ()) -> None:
        """Record a stretch as a maneuver, or the reason why it is not one."""
        if rejection:
            start_s, end_s = (float(self.table.index[row]) for row in (rows.start, rows.stop - 1))
            self.rejected.append(RejectedManeuver(kind, start_s, end_s, rejection))
        else:
            self.maneuvers.append(maneuver_in(kind, rows, self.table, self.V, notes))
