"""Ground segments that rehearse the calibrations: bursts, a water column, turning by hand, deflections, a motor run-up
with the aircraft strapped down, the tray on its six sides, weights on the probe's boom."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.air import ambient
from flightpower.sim.ground import Motion, motion_of, smooth_step, stand
from flightpower.sim.plant import Plant
from flightpower.sim.propulsion import ThrustFactor, power_train

LINES = ("alpha", "beta", "airspeed")
SURFACES = ("elevator", "aileron", "rudder")
REST_S, PRESS_S, HOLD_S, JITTER_S = 2.0, 1.0, 2.0, 0.2  # phases of a burst
MOVE_S = 0.5  # time to move a surface from one angle to the next
HAND_ROLL_RAD, HAND_PITCH_RAD = 2.9, 1.3
HAND_ROLL_S, HAND_PITCH_S, HAND_YAW_S, LIFT_S = 13.0, 9.7, 15.0, 4.0


class LineResponse(Protocol):
    """Pressure at the end of a pneumatic line (`sim.sensors.tubing.StepResponse`); times t (n,) since its beginning."""

    def step(self, t: Array) -> Array: ...

    def ramp(self, t: Array) -> Array: ...


@dataclass(frozen=True, kw_only=True)
class BenchSegment:
    """A procedure with the standing aircraft, with the motor off."""

    kind = "bench"

    @property
    def duration_s(self) -> float:
        raise NotImplementedError

    def check(self) -> None:
        """Raises InputError if the segment cannot be done."""

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        """The motion at times t (n,) from the segment's start."""
        return stand(position, attitude, len(t))

    def columns(self, plant: Plant, t: Array) -> dict[str, Array]:
        """Columns of the truth that differ from those of an aircraft that stands still, each (n,)."""
        return {}


@dataclass(frozen=True, kw_only=True)
class BurstsSegment(BenchSegment):
    """Pressure is applied to one line, held, and suddenly released; for `calibrate tubing`."""

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

        For each burst it sums the responses to two ramps and a step, so that a burst need not start at one of the times
        t.
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
    """One pressure acts on all three lines, from a water column through a T-piece; for `calibrate transducers`."""

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
        return _steps(t, self.pressure_Pa, self.hold_s, self.move_s)


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

    def columns(self, plant: Plant, t: Array) -> dict[str, Array]:
        """Raises InputError if an angle is beyond the surface's travel."""
        travel = np.degrees(getattr(plant.aircraft, self.surface).angle_rad)
        for angle in np.degrees(self.angle_rad).tolist():
            if not travel.min() <= angle <= travel.max():
                raise InputError(
                    f"{angle:.1f} deg is beyond the {self.surface}'s travel, {travel.min():.1f} to {travel.max():.1f}"
                )
        angle = _steps(t, self.angle_rad, self.hold_s, MOVE_S)
        return {f"{self.surface}_command_rad": angle, f"{self.surface}_rad": angle}


@dataclass(frozen=True, kw_only=True)
class RunUpSegment(BenchSegment):
    """The motor is run up in steps of throttle, with the aircraft strapped down; for `calibrate run-up`.

    lean_rad : nose-down pitch at full throttle, because the straps give
    """

    throttle: tuple[float, ...] = (0.45, 0.6, 0.8, 1.0, 0.8, 0.6, 0.45)
    hold_s: float = 12.0
    move_s: float = 2.0
    lean_rad: float = 0.01
    kind = "run-up"

    def check(self) -> None:
        if not self.throttle or not all(0 < value <= 1 for value in self.throttle):
            raise InputError("throttle: give the positions to hold, in order, above 0 and up to 1")

    @property
    def duration_s(self) -> float:
        return len(self.throttle) * (self.move_s + self.hold_s) + self.move_s

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        return _pitching(
            position, attitude, t, -self.lean_rad * _steps(t, self.throttle, self.hold_s, self.move_s) ** 2
        )

    def columns(self, plant: Plant, t: Array) -> dict[str, Array]:
        rho = float(ambient(plant.air, 0.0).density)
        deviations = plant.deviations
        factor = ThrustFactor(1 + deviations.thrust_scale, deviations.thrust_slope_J)

        def acceleration(revps: float, throttle: float) -> float:
            train = power_train(plant.aircraft.propulsion, plant.propeller, V=0.0, n=revps, throttle=throttle, rho=rho)
            return float(train.motor_acceleration_revps2)

        fastest = plant.aircraft.propulsion.max_rpm / 60 * 2
        steady = [brentq(acceleration, 1.0, fastest, args=(throttle,)) for throttle in self.throttle]
        revps, throttle = (_steps(t, values, self.hold_s, self.move_s) for values in (steady, self.throttle))
        train = power_train(
            plant.aircraft.propulsion, plant.propeller, V=0.0, n=revps, throttle=throttle, rho=rho, thrust_factor=factor
        )
        return {
            "motor_speed_revps": revps,
            "throttle": throttle,
            "thrust_N": np.where(revps > 0, train.thrust_N, 0.0),
            "shaft_power_W": np.where(revps > 0, train.shaft_power_W, 0.0),
            "battery_voltage_V": np.asarray(train.battery_voltage_V),
            "battery_current_A": np.asarray(train.battery_current_A),
        }


@dataclass(frozen=True, kw_only=True)
class BoomWeightsSegment(BenchSegment):
    """Weights are hung on the tip of the probe's boom, one after another; for `calibrate boom`.

    carried_kg : mass that bends the boom in flight: the probe's mass, and a third of the boom's
    give_rad_per_N : nose-down pitch per unit of weight, because the landing gear gives
    """

    mass_kg: tuple[float, ...] = (0.1, 0.2, 0.3, 0.2, 0.1)
    hold_s: float = 10.0
    move_s: float = 4.0
    carried_kg: float = 0.05
    give_rad_per_N: float = 0.002
    kind = "boom-weights"

    def check(self) -> None:
        if not self.mass_kg or not all(mass > 0 for mass in self.mass_kg):
            raise InputError("mass: give the weights to hang, in order")

    @property
    def duration_s(self) -> float:
        return len(self.mass_kg) * (self.move_s + self.hold_s) + self.move_s

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        """The motion of the aircraft, which rocks whenever a weight is hung."""
        hung = _steps(t, self.mass_kg, self.hold_s, self.move_s) * GRAVITY_MPS2
        since = t % (self.move_s + self.hold_s) / self.move_s
        rocking = np.where(since < 1, 0.03 * np.sin(pi * since) ** 2 * np.sin(8 * pi * since), 0.0)
        return _pitching(position, attitude, t, rocking - self.give_rad_per_N * hung)

    def tip_rad(self, boom_bending_rad: float) -> list[float]:
        """Change of a level's reading on the probe at rest, positive nose up, without weight, under each weight, and
        without weight, for a boom that bends by `boom_bending_rad` per g of the mass that it carries."""
        per_kg = boom_bending_rad / self.carried_kg + self.give_rad_per_N * GRAVITY_MPS2
        return [-per_kg * mass for mass in (0.0, *self.mass_kg, 0.0)]


@dataclass(frozen=True, kw_only=True)
class SixSidesSegment(BenchSegment):
    """The tray rests on each of its sides in turn, upright first; for `calibrate imu`.

    tilt_rad : angle by which nose up and nose down fall short of a quarter turn
    """

    hold_s: float = 12.0
    move_s: float = 4.0
    tilt_rad: float = 0.1
    kind = "six-sides"

    @property
    def duration_s(self) -> float:
        return 5 * (self.move_s + self.hold_s) + self.move_s

    def motion(self, position: Array, attitude: Array, t: Array) -> Motion:
        """The motion: onto the right side, the back, the left side; then nose up and nose down."""
        upright = pi / 2 - self.tilt_rad
        roll, pitch = (
            _steps(t, values, self.hold_s, self.move_s)
            for values in ((pi / 2, pi, 3 * pi / 2, 2 * pi, 2 * pi), (0.0, 0.0, 0.0, upright, -upright))
        )
        return _turning(position, attitude, t, roll, pitch)


def _turning(position: Array, attitude: Array, t: Array, roll_rad: Array, pitch_rad: Array) -> Motion:
    """The motion of an aircraft held in place with these additional roll and pitch angles (n,)."""
    if len(t) < 2:
        return stand(position, attitude, len(t))
    angles = np.column_stack([roll_rad, pitch_rad, np.zeros(len(t))])
    spline = CubicSpline(t, attitude + angles, bc_type="clamped")
    zeros = np.zeros((len(t), 3))
    return motion_of((np.tile(position, (len(t), 1)), zeros, zeros), (spline(t), spline(t, 1), spline(t, 2)))


def _pitching(position: Array, attitude: Array, t: Array, pitch_rad: Array) -> Motion:
    """The motion of a standing aircraft with this additional pitch (n,)."""
    return _turning(position, attitude, t, np.zeros(len(t)), pitch_rad)


def _steps(t: Array, values: Sequence[float], hold_s: float, move_s: float) -> Array:
    """A history (n,) that starts at zero, holds each of the values, and returns to zero, with move_s between them."""
    begin = np.arange(len(values)) * (move_s + hold_s) + move_s
    times = np.column_stack([begin, begin + hold_s]).ravel()
    levels = np.repeat(values, 2)
    return np.asarray(np.interp(t, np.r_[0.0, times, times[-1] + move_s], np.r_[0.0, levels, 0.0]))
