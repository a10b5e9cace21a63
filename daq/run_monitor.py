"""Tells the pilot in flight how long to hold a run, whether it was good, and how narrow the power's interval is so far.

A run is a level acceleration or deceleration by the criteria of `flight.runs`, which the analysis also uses; speed and
height come from means over 0.2 s, smoothed as in the analysis. This module runs in the process of `daq.telemetry`.
"""

import math
from collections import deque
from typing import NamedTuple

from flightpower.daq.energy_balance import EnergyBalance
from flightpower.daq.flight_card import FlightCard
from flightpower.daq.legs import Leg, Legs, Row
from flightpower.daq.motion_means import Motion, MotionFromMeans
from flightpower.daq.thrust import load_thrust
from flightpower.daq.tick_means import MEAN_OVER_NS, Means
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.probe_maps import ProbeMaps
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunMeasures, RunRejected

STEP_S = MEAN_OVER_NS / 1e9
HALF = round(LEVEL_RUN.smoothing_s / STEP_S / 2 - 0.5)  # rows on each side of a fit

# Weights for value and slope in the middle of a quadratic fit to 2 HALF + 1 rows (Savitzky and Golay, Anal. Chem. 36,
# 1964).
_INDEX = range(-HALF, HALF + 1)
_NORM = (2 * HALF + 3) * (2 * HALF + 1) * (2 * HALF - 1)
VALUE = [3 * (3 * HALF**2 + 3 * HALF - 1 - 5 * i**2) / _NORM for i in _INDEX]
SLOPE = [i / sum(k**2 for k in _INDEX) / STEP_S for i in _INDEX]


class JudgedRun(NamedTuple):
    """Verdict on one stretch. rejection: why it is not a run; None if it is one."""

    kind: str  # acceleration, deceleration
    start_s: float
    end_s: float
    first_mps: float
    last_mps: float
    speed_change: float  # (largest - smallest)/mean speed
    rejection: Rejection | None

    @property
    def good(self) -> bool:
        return self.rejection is None

    @property
    def notified(self) -> bool:
        """Whether the pilot gets a message. Turns are not meant as runs; a small change of speed needs no repeat."""
        if self.rejection is None:
            return True
        enough = self.speed_change >= LEVEL_RUN.smallest_speed_change
        return enough and self.rejection.reason is not RunRejected.BANKED

    @property
    def reason(self) -> str:
        """Why the stretch is not a run, in a few words; empty if it is one."""
        return "" if self.rejection is None else _short_text(self.rejection, self.end_s - self.start_s)

    @property
    def text(self) -> str:
        """Text for the pilot, at most 50 characters; empty if there is no message."""
        if not self.notified:
            return ""
        if not self.good:
            return f"{self.kind} lost: {self.reason}; repeat"
        covered = f"{self.first_mps:.1f} to {self.last_mps:.1f} m/s in {self.end_s - self.start_s:.0f} s"
        return f"{self.kind} good: {covered}"


class Progress(NamedTuple):
    """State of the current stretch. more_s: how much longer it must last to be a run; 0 if it already is one."""

    kind: str  # acceleration, deceleration
    more_s: float

    @property
    def text(self) -> str:
        """Text for the pilot, at most 50 characters."""
        return f"{self.kind}: hold {math.ceil(self.more_s)} s more" if self.more_s else f"{self.kind}: long enough"


def _short_text(rejection: Rejection, seconds: float) -> str:
    """The reason in a few words. seconds: duration of the stretch."""
    reason, measured, limit, _ = rejection
    texts = {
        RunRejected.TOO_GENTLE: "too gentle",
        RunRejected.TOO_SHORT: f"{measured:.1f} s, not {limit:.2g} s",
        RunRejected.TOO_LONG: f"{measured:.0f} s long",
        RunRejected.SPEED_CHANGED_LITTLE: f"speed changed {100 * measured:.0f} %",
        RunRejected.HEIGHT_UNKNOWN: "no height",
        RunRejected.TOO_LOW: f"down to {measured:.0f} m",
        RunRejected.CLIMBED: f"{'climbed' if measured > 0 else 'sank'} {abs(measured) * seconds:.0f} m",
        RunRejected.HEIGHT_VARIED: f"height +-{measured / 2:.0f} m",
        RunRejected.BANKED: f"bank {math.degrees(measured):.0f} deg",
        RunRejected.DATA_MISSING: f"no data, {100 * measured:.0f} %",
    }
    return texts[RunRejected(reason)]


class RunMonitor:
    """Judges runs from means of the readings; `texts` gives the pilot's messages."""

    def __init__(
        self,
        aircraft: Aircraft,
        probe: ProbeMaps | None,
        zeros: dict[str, float] | None = None,
        card: FlightCard | None = None,
    ):
        """zeros: of `daq zero`, by field of `Means`; zeros at rest before flight replace them. card: of the plan."""
        self.card = card
        self._ticked_off: JudgedRun | None = None
        name = aircraft.propulsion.propeller
        thrust = load_thrust(name, folding=aircraft.propulsion.beyond_zero_thrust == "fold") if name else None
        self.motion = MotionFromMeans(aircraft, probe, thrust, zeros or {})
        self.energy = EnergyBalance(aircraft.uncertainty, aircraft.static_thrust_excess)
        self.slowest_mps, self.fastest_mps, self.runs = math.inf, 0.0, 0
        self._scale = self.motion.scale
        self._window: deque[Motion] = deque(maxlen=2 * HALF + 1)
        self._legs = Legs()
        self._turning_or_steep = False
        self._early: JudgedRun | None = None  # verdict on a leg that had not ended
        self._measured_thrust = thrust is not None

    def add(self, means: Means) -> list[JudgedRun]:
        """Add means. Returns the verdicts that they make possible."""
        motion = self.motion.at(means)
        if motion is None or (self._window and motion.t_s - self._window[-1].t_s > 1.5 * STEP_S):
            self._window.clear()
            if motion is None:
                return self._ended_stretch()
        self._window.append(motion)
        if len(self._window) < 2 * HALF + 1:
            return []
        row = self._smoothed()
        turning_or_steep = abs(row.bank) > LEVEL_RUN.largest_bank_rad or abs(row.climb) > LEVEL_RUN.steep_mps
        verdicts = []
        rows = self._legs.rows
        if turning_or_steep != self._turning_or_steep or (rows and row.t_s - rows[-1].t_s > 1.5 * STEP_S):
            verdicts = self._ended_stretch()
        self._turning_or_steep = turning_or_steep
        leg = self._legs.add(row)
        return verdicts + (self._verdicts(leg) if leg else [])

    def interval_text(self) -> str:
        """Number of runs, speeds covered, and interval of least power by the runs' energy balance; ≤ 50 characters."""
        covered = f"{self.runs} runs, {self.slowest_mps:.1f} to {self.fastest_mps:.1f} m/s"
        power = self.energy.at_endurance_speed(self.slowest_mps, self.fastest_mps) if self.runs else None
        return f"{covered}: power +-{100 * power.half_width:.1f} %" if power else covered

    def texts(self, means: Means) -> list[tuple[str, str]]:
        """Severities and texts for the pilot."""
        texts = []
        for verdict in self.add(means):
            if verdict.good:
                texts += [("info", verdict.text), ("info", self.interval_text())]
                texts += [("info", text) for text in self._ticked(verdict)]
            elif verdict.notified:
                texts.append(("warning", verdict.text))
        return texts

    def _ticked(self, verdict: JudgedRun) -> list[str]:
        """The card's line after a good run; empty if the run is not planned or was already ticked off."""
        if self.card is None or (self._ticked_off and abs(self._ticked_off.start_s - verdict.start_s) < 1.0):
            return []
        if not self.card.tick_off(verdict.kind, verdict.first_mps, verdict.last_mps):
            return []
        self._ticked_off = verdict
        return [self.card.text]

    def progress(self) -> Progress | None:
        """Progress of the stretch being flown; None if there is none, or if it cannot become a run any more.

        It is known once speed has changed by an eighth. Like smoothed speed it is a second late, so the time shown is
        too long.
        """
        leg = self._legs.going_on()
        if leg is None:
            return None
        rows = leg.changing_part(LEVEL_RUN.changing_mps2 * self._scale)
        more_s = self._measures(leg.sign, rows).seconds_more(self._scale)
        return None if more_s is None else Progress(leg.kind, more_s)

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

    def _ended_stretch(self) -> list[JudgedRun]:
        leg = self._legs.end()
        self._legs = Legs()
        return self._verdicts(leg) if leg else []

    def _verdicts(self, leg: Leg) -> list[JudgedRun]:
        """The verdict on a leg; empty if it repeats the verdict given before the leg's end."""
        early, verdict = self._early, self._judged(leg)
        self._early = None if leg.ended else verdict
        if verdict is None or (early is not None and early.good == verdict.good and _same(early, verdict)):
            return []
        if verdict.good and not (early is not None and early.good):
            self._count(leg.changing_part(LEVEL_RUN.changing_mps2 * self._scale))
        return [verdict]

    def _count(self, rows: list[Row]) -> None:
        speeds = [row.V for row in rows]
        self.runs += 1
        self.slowest_mps, self.fastest_mps = min(self.slowest_mps, *speeds), max(self.fastest_mps, *speeds)
        self.energy.add_run(rows)

    def _judged(self, leg: Leg) -> JudgedRun | None:
        """Judge a leg. Returns None if it is too short to mention, or if speed was held."""
        rows = leg.changing_part(LEVEL_RUN.changing_mps2 * self._scale)
        measures = self._measures(leg.sign, rows)
        if measures.negligible(self._scale):
            return None
        ends = rows[0].t_s, rows[-1].t_s, rows[0].V, rows[-1].V
        return JudgedRun(leg.kind, *ends, measures.speed_change, measures.rejection(self._scale))

    def _measures(self, sign: int, rows: list[Row]) -> RunMeasures:
        speeds, heights = [row.V for row in rows], [row.height_m for row in rows]
        thrust_measured = self._measured_thrust
        gaps = sum(not row.complete or (thrust_measured and row.drag is None) for row in rows)
        return RunMeasures(
            rows=len(rows),
            step_s=STEP_S,
            seconds=rows[-1].t_s - rows[0].t_s,
            peak_mps2=max(sign * row.Vdot for row in rows),
            speed_change=(max(speeds) - min(speeds)) * len(speeds) / sum(speeds),
            lowest_m=min(heights) if self.motion.ground_known else math.inf,
            mean_climb_mps=sum(row.climb for row in rows) / len(rows),
            height_range_m=max(heights) - min(heights),
            largest_bank_rad=max(abs(row.bank) for row in rows),
            missing=("data", gaps / len(rows)),
        )


def _same(run: JudgedRun, other: JudgedRun) -> bool:
    """Whether two verdicts are on nearly the same stretch."""
    return abs(run.start_s - other.start_s) < 1.0 and abs(run.end_s - other.end_s) < 1.0
