"""Segments on the ground that rehearse the calibrations: bursts, a water column, turning by hand, deflections."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flight.complete_aircraft import CompleteAircraft
from flight.errors import InputError
from sim.ground import Motion, motion_of, smooth_step, stand

Array = NDArray[np.float64]

LINES = ("alpha", "beta", "airspeed")
SURFACES = ("elevator", "aileron", "rudder")
REST_S, PRESS_S, HOLD_S, JITTER_S = 2.0, 1.0, 2.0, 0.2  # of a burst
MOVE_S = 0.5  # of a surface from one angle to the next
HAND_ROLL_RAD, HAND_PITCH_RAD = 2.9, 1.3
HAND_ROLL_S, HAND_PITCH_S, HAND_YAW_S, LIFT_S = 13.0, 9.7, 15.0, 4.0


class LineResponse(Protocol):
    """Pressure at the end of a pneumatic line (`sim.sensors.tubing.StepResponse`); times t (n,) since its beginning."""

    def step(self, t: Array) -> Array: ...

    def ramp(self, t: Array) -> Array: ...


@dataclass(frozen=True, kw_only=True)
class BenchSegment:
    """Something that is done with the standing aircraft, motor off."""

    kind = "bench"

    @property
    def duration_s(self) -> float:
        raise NotImplementedError

    def check(self) -> None:
        """Raises InputError if the segment cannot be done."""

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        """The motion at times t (n,) from the segment's start."""
        return stand(position, attitude, len(t))

    def columns(self, aircraft: CompleteAircraft, t: Array) -> dict[str, Array]:
        """Columns of the truth that differ from those of standing still, each (n,)."""
        return {}


@dataclass(frozen=True, kw_only=True)
class BurstsSegment(BenchSegment):
    """Pressure on one line, held, and released at once; for `calibrate tubing`."""

    line: str
    pressure_Pa: float = 400.0
    count: int = 8
    kind = "bursts"

    def check(self) -> None:
        if self.line not in LINES:
            raise InputError(f"line: {self.line!r} is not one of {', '.join(LINES)}")
        if self.count < 1:
            raise InputError(f"count: {self.count} should be one or more")

    @property
    def duration_s(self) -> float:
        return self.count * (REST_S + PRESS_S + HOLD_S) + REST_S

    def response(self, t: Array, line: LineResponse, jitter: Array) -> Array:
        """Pressure [Pa] at the end of the line at times t (n,) from the start. jitter: of each burst, -1 to 1.

        The sum of the responses to two ramps and a step for each burst, so that a burst is not tied to the times t.
        """
        total = np.zeros_like(t)
        for number, shift in enumerate(jitter.tolist()):
            pressed = t - REST_S - number * (REST_S + PRESS_S + HOLD_S)
            burst = pressed - PRESS_S - HOLD_S - JITTER_S * shift
            rise = (line.ramp(pressed) - line.ramp(pressed - PRESS_S)) / PRESS_S
            total += self.pressure_Pa * (rise - line.step(burst))
        return total


@dataclass(frozen=True, kw_only=True)
class ColumnSegment(BenchSegment):
    """The same pressures on all three lines, from a water column through a T-piece; for `calibrate transducers`."""

    pressure_Pa: tuple[float, ...]
    hold_s: float = 8.0
    move_s: float = 2.0
    kind = "column"

    def check(self) -> None:
        if not self.pressure_Pa:
            raise InputError("pressure: give the pressures to hold, in order")
        if not (self.hold_s > 0 and self.move_s > 0):
            raise InputError("hold, move: should be longer than 0 s")

    @property
    def duration_s(self) -> float:
        return len(self.pressure_Pa) * (self.move_s + self.hold_s) + self.move_s

    def applied_Pa(self, t: Array) -> Array:
        """Pressure on the lines [Pa] at times t (n,) from the start; changes are slow against the lines' lags."""
        return _held(t, self.pressure_Pa, self.hold_s, self.move_s)


@dataclass(frozen=True, kw_only=True)
class HandTurnSegment(BenchSegment):
    """The aircraft is turned by hand through all attitudes; for `calibrate magnetometer`."""

    seconds_s: float = 60.0
    kind = "turn-by-hand"

    def check(self) -> None:
        if self.seconds_s < 2 * HAND_YAW_S:
            raise InputError(f"seconds: {self.seconds_s:g} s are too short; {2 * HAND_YAW_S:g} at least")

    @property
    def duration_s(self) -> float:
        return self.seconds_s

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        T = self.seconds_s
        lifted = smooth_step(np.clip(np.minimum(t, T - t) / LIFT_S, 0.0, 1.0))
        turns = max(1, round(T / HAND_YAW_S))
        angles = np.column_stack(
            [
                attitude[0] + lifted * HAND_ROLL_RAD * np.sin(2 * pi * t / HAND_ROLL_S),
                attitude[1] + lifted * HAND_PITCH_RAD * np.sin(2 * pi * t / HAND_PITCH_S),
                attitude[2] + 2 * pi * turns * smooth_step(t / T),
            ]
        )
        spline = CubicSpline(t, angles, bc_type="clamped")
        zeros = np.zeros((len(t), 3))
        return motion_of((np.tile(position, (len(t), 1)), zeros, zeros), (spline(t), spline(t, 1), spline(t, 2)))


@dataclass(frozen=True, kw_only=True)
class DeflectSegment(BenchSegment):
    """A surface is moved from angle to angle and held at each; for `calibrate surfaces`."""

    surface: str
    angle_rad: tuple[float, ...]
    hold_s: float = 4.0
    kind = "deflect"

    def check(self) -> None:
        if self.surface not in SURFACES:
            raise InputError(f"surface: {self.surface!r} is not one of {', '.join(SURFACES)}")
        if not self.angle_rad:
            raise InputError("angle: give the angles to hold, in order")

    @property
    def duration_s(self) -> float:
        return len(self.angle_rad) * (MOVE_S + self.hold_s) + MOVE_S

    def columns(self, aircraft: CompleteAircraft, t: Array) -> dict[str, Array]:
        """Raises InputError if an angle is beyond the surface's travel."""
        travel = np.degrees(getattr(aircraft, self.surface).angle_rad)
        for angle in np.degrees(self.angle_rad).tolist():
            if not travel.min() <= angle <= travel.max():
                raise InputError(
                    f"{angle:.1f} deg is beyond the {self.surface}'s travel, {travel.min():.1f} to {travel.max():.1f}"
                )
        angle = _held(t, self.angle_rad, self.hold_s, MOVE_S)
        return {f"{self.surface}_command_rad": angle, f"{self.surface}_rad": angle}


def _held(t: Array, values: Sequence[float], hold_s: float, move_s: float) -> Array:
    """Zero, each of the values held, and zero again, with move_s between them; (n,)."""
    begin = np.arange(len(values)) * (move_s + hold_s) + move_s
    times = np.column_stack([begin, begin + hold_s]).ravel()
    held = np.repeat(values, 2)
    return np.asarray(np.interp(t, np.r_[0.0, times, times[-1] + move_s], np.r_[0.0, held, 0.0]))
