"""Says during the flight whether a run was good or has to be repeated, and how narrow the power's interval is so far.

A run is a level acceleration or deceleration. Criteria and thresholds are those of `analysis.maneuvers.find_level` and
`quality`; speed and height come from means over 0.2 s, smoothed as there. Runs in the process of `daq.telemetry`.
"""

import math
from collections import deque
from typing import NamedTuple

from daq.energy_balance import EnergyBalance
from daq.legs import Leg, Legs, Row, changing_part
from daq.motion_means import Motion, MotionFromMeans
from daq.probe_calibration import ProbeMaps
from daq.thrust import load_thrust
from daq.tick_means import MEAN_OVER_NS, Means
from flight.aircraft import Aircraft

STEP_S = MEAN_OVER_NS / 1e9
HALF = 5  # rows on each side of a fit over 2.2 s
# Those of the analysis; speeds and durations are times the aircraft's speed scale.
CHANGING_MPS2, CLEARLY_CHANGING_MPS2 = 0.15, 0.5
MENTIONED_S, SHORTEST_S, LONGEST_S = 3.0, 5.0, 40.0
SMALLEST_SPEED_CHANGE = 0.2
LARGEST_ALTITUDE_CHANGE_M = 20.0
LARGEST_CLIMB_MPS, STEEP_MPS = 1.2, 2.0
LARGEST_BANK_RAD = math.radians(25)
LEAST_HEIGHT_M = 20.0
LARGEST_GAP_SHARE = 0.02

# Local quadratic over 2 HALF + 1 rows: value and slope in the middle (Savitzky and Golay, Anal. Chem. 36, 1964).
_INDEX = range(-HALF, HALF + 1)
_NORM = (2 * HALF + 3) * (2 * HALF + 1) * (2 * HALF - 1)
VALUE = [3 * (3 * HALF**2 + 3 * HALF - 1 - 5 * i**2) / _NORM for i in _INDEX]
SLOPE = [i / sum(k**2 for k in _INDEX) / STEP_S for i in _INDEX]


class Verdict(NamedTuple):
    """On one stretch. reason: why it is no run; empty if it is one. text: for the pilot, at most 50 characters."""

    kind: str  # acceleration, deceleration
    start_s: float
    end_s: float
    reason: str
    text: str

    @property
    def good(self) -> bool:
        return not self.reason


class RunMonitor:
    """Fed with means, gives verdicts; `texts` is what the pilot reads."""

    def __init__(self, aircraft: Aircraft, probe: ProbeMaps | None, zeros: dict[str, float] | None = None):
        """zeros: of `daq zero`, by field of `Means`; those at rest before the flight replace them."""
        name = aircraft.propulsion.propeller
        thrust = load_thrust(name, folding=aircraft.propulsion.beyond_zero_thrust == "fold") if name else None
        self.motion = MotionFromMeans(aircraft, probe, thrust, zeros or {})
        self.energy = EnergyBalance(aircraft.uncertainty, aircraft.static_thrust_excess)
        self.slowest_mps, self.fastest_mps, self.runs = math.inf, 0.0, 0
        self._scale = self.motion.scale
        self._window: deque[Motion] = deque(maxlen=2 * HALF + 1)
        self._legs = Legs()
        self._turning_or_steep = False
        self._early: Verdict | None = None  # on a leg that had not ended
        self._measured_thrust = thrust is not None

    def add(self, means: Means) -> list[Verdict]:
        """Verdicts that became possible with these means."""
        motion = self.motion.at(means)
        if motion is None or (self._window and motion.t_s - self._window[-1].t_s > 1.5 * STEP_S):
            self._window.clear()
            if motion is None:
                return self._ended_stretch()
        self._window.append(motion)
        if len(self._window) < 2 * HALF + 1:
            return []
        row = self._smoothed()
        turning_or_steep = abs(row.bank) > LARGEST_BANK_RAD or abs(row.climb) > STEEP_MPS
        found = []
        rows = self._legs.rows
        if turning_or_steep != self._turning_or_steep or (rows and row.t_s - rows[-1].t_s > 1.5 * STEP_S):
            found = self._ended_stretch()
        self._turning_or_steep = turning_or_steep
        leg = self._legs.add(row)
        return found + (self._verdicts(leg) if leg else [])

    def interval_text(self) -> str:
        """Runs, speeds covered, and the interval of the smallest power by the energy of the runs; ≤ 50 characters."""
        covered = f"{self.runs} runs, {self.slowest_mps:.1f} to {self.fastest_mps:.1f} m/s"
        found = self.energy.at_endurance_speed(self.slowest_mps, self.fastest_mps) if self.runs else None
        return f"{covered}: power +-{100 * found.half_width:.1f} %" if found else covered

    def texts(self, means: Means) -> list[tuple[str, str]]:
        """Severity and text for the pilot. In turns no run is expected: what is lost there is not told."""
        found = []
        for verdict in self.add(means):
            if verdict.good:
                found += [("info", verdict.text), ("info", self.interval_text())]
            elif verdict.text:
                found.append(("warning", verdict.text))
        return found

    def _smoothed(self) -> Row:
        window = self._window
        middle = window[HALF]
        V = [motion.V for motion in window]
        height = [motion.height_m for motion in window]
        return Row(
            middle.t_s,
            sum(map(float.__mul__, VALUE, V)),
            sum(map(float.__mul__, SLOPE, V)),
            sum(map(float.__mul__, SLOPE, height)),
            middle.bank,
            middle.height_m,
            sum(map(float.__mul__, VALUE, height)),
            middle.complete,
            middle.drag,
        )

    def _ended_stretch(self) -> list[Verdict]:
        leg = self._legs.end()
        self._legs = Legs()
        return self._verdicts(leg) if leg else []

    def _verdicts(self, leg: Leg) -> list[Verdict]:
        """The verdict on a leg; none if it is that already given before the leg's end."""
        early, verdict = self._early, self._judged(leg)
        self._early = None if leg.ended else verdict
        if verdict is None or (early is not None and early.good == verdict.good and _same(early, verdict)):
            return []
        if verdict.good and not (early is not None and early.good):
            self._count(changing_part(leg, CHANGING_MPS2 * self._scale))
        return [verdict]

    def _count(self, rows: list[Row]) -> None:
        speeds = [row.V for row in rows]
        self.runs += 1
        self.slowest_mps, self.fastest_mps = min(self.slowest_mps, *speeds), max(self.fastest_mps, *speeds)
        self.energy.add_run(rows)

    def _judged(self, leg: Leg) -> Verdict | None:
        """None for a stretch that is too short to mention, or in which speed was held."""
        rows, scale = changing_part(leg, CHANGING_MPS2 * self._scale), self._scale
        speeds = [row.V for row in rows]
        change = (max(speeds) - min(speeds)) * len(speeds) / sum(speeds)
        steepest = max(leg.sign * row.Vdot for row in rows)
        gentle = steepest < CLEARLY_CHANGING_MPS2 * scale
        if (gentle and change < SMALLEST_SPEED_CHANGE) or len(rows) < MENTIONED_S * scale / STEP_S:
            return None
        kind = "acceleration" if leg.sign > 0 else "deceleration"
        start_s, end_s = rows[0].t_s, rows[-1].t_s
        reason = "too gentle" if gentle else self._reason_against(rows, change)
        if reason:
            told = change >= SMALLEST_SPEED_CHANGE and not reason.startswith("bank")
            return Verdict(kind, start_s, end_s, reason, f"{kind} lost: {reason}; repeat" if told else "")
        covered = f"{rows[0].V:.1f} to {rows[-1].V:.1f} m/s in {end_s - start_s:.0f} s"
        return Verdict(kind, start_s, end_s, "", f"{kind} good: {covered}")

    def _reason_against(self, rows: list[Row], change: float) -> str:
        """Why rows are not a run, in few words; empty if they are one."""
        seconds, scale = rows[-1].t_s - rows[0].t_s, self._scale
        if seconds < SHORTEST_S * scale:
            return f"{seconds:.1f} s, not {SHORTEST_S * scale:.2g} s"
        if seconds > LONGEST_S:
            return f"{seconds:.0f} s long"
        if change < SMALLEST_SPEED_CHANGE:
            return f"speed changed {100 * change:.0f} %"
        heights = [row.height_m for row in rows]
        if self.motion.ground_known and min(heights) < LEAST_HEIGHT_M * scale:
            return f"down to {min(heights):.0f} m"
        climb = sum(row.climb for row in rows) / len(rows)
        if abs(climb) > LARGEST_CLIMB_MPS * scale:
            return f"climbed {climb * seconds:.0f} m" if climb > 0 else f"sank {-climb * seconds:.0f} m"
        if max(heights) - min(heights) > LARGEST_ALTITUDE_CHANGE_M:
            return f"height +-{(max(heights) - min(heights)) / 2:.0f} m"
        bank = max(abs(row.bank) for row in rows)
        if bank > LARGEST_BANK_RAD:
            return f"bank {math.degrees(bank):.0f} deg"
        needed = self._measured_thrust
        gaps = sum(not row.complete or (needed and row.drag is None) for row in rows) / len(rows)
        return f"no data, {100 * gaps:.0f} %" if gaps > LARGEST_GAP_SHARE else ""


def _same(one: Verdict, other: Verdict) -> bool:
    """Whether two verdicts are on nearly the same stretch."""
    return abs(one.start_s - other.start_s) < 1.0 and abs(one.end_s - other.end_s) < 1.0
