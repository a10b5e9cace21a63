"""The pilot, who controls altitude by elevator, speed by throttle, and bank and heading by aileron and rudder.

Feed-forward comes from a trim schedule; feedback loops correct the remaining error. `Gains.skill` scales the feedback
gains, which gives the pilots of the source: well tuned, low gain and high gain, each with or without gains scheduled
over speed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import asin, atan2, copysign, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from flightpower.flight.aircraft import ControlSurface
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.errors import InputError
from flightpower.sim.energy_controller import Cruise, EnergyController
from flightpower.sim.integration import Observation
from flightpower.sim.plant import Commands, Plant
from flightpower.sim.trim import Trimmer

MAX_BANK_RAD = 0.8
MAX_GAMMA_RAD = 0.35
MAX_SPEED_CHANGE_MPS2 = 1.0
STALL_MARGIN_RAD, STALL_PUSH = 0.035, 1.5
MAX_GAMMA_RATE_RADPS = 0.12  # limit on the rate of the commanded flight-path angle


class Targets(NamedTuple):
    """Commanded values of a segment. Throttle, when given, has priority over speed, and bank over heading."""

    height_m: float | None = None
    climb_mps: float = 0.0  # added to the height loop's climb; used alone if height is None
    speed_mps: float | None = None
    throttle: float | None = None
    heading_rad: float | None = None
    bank_rad: float | None = None
    bank_wander_rad: float = 0.0  # added to the commanded bank
    load_factor: float | None = None  # replaces the height loop: roller coaster, wind-up turn
    elevator_rad: float = 0.0  # added to the pilot's elevator: 3-2-1-1 inputs
    hold_elevator: bool = False  # holds the elevator constant, for a free response


@dataclass(frozen=True, kw_only=True)
class Gains:
    """The section [pilot] of a plan."""

    height_per_s: float = 0.45  # commanded climb per height error
    climb: float = 0.9  # flight-path angle added per flight-path error
    climb_integral_per_s: float = 0.25
    pitch: float = 0.8  # elevator per pitch error
    pitch_rate_s: float = 0.12  # elevator per pitch rate
    speed_per_m: float = 0.12  # throttle per speed error
    speed_integral: float = 0.03
    acceleration_s2_per_m: float = 0.15  # throttle per commanded acceleration
    bank: float = 0.5
    bank_rate_s: float = 0.08
    heading: float = 1.2  # bank per heading error
    yaw_rate_s: float = 0.15
    skill: float = 1.0  # factor on all feedback gains
    feedforward: float = 1.0  # share of the trim schedule used; 0: the cruise trim at all speeds
    scheduled: bool = True  # elevator and aileron gains fall with dynamic pressure
    energy: bool = False  # controls height and airspeed by total energy, as an autopilot does (`energy_controller`)


PILOTS = {
    "good": Gains(),
    "low-gain": Gains(skill=0.4, feedforward=0.8),
    "high-gain": Gains(skill=1.6),
    "unscheduled": Gains(scheduled=False),
    "schedule-free": Gains(feedforward=0.0),
    "autopilot": Gains(energy=True),
}


class TrimPoint(NamedTuple):
    """Level trim at one airspeed [rad, throttle 0 to 1]."""

    alpha: float
    elevator: float
    aileron: float
    rudder: float
    throttle: float


class TrimSchedule:
    """Level trim over airspeed: linear between equidistant points, constant beyond the ends."""

    def __init__(self, low: float, high: float, rows: Sequence[TrimPoint]):
        self._low, self._per_mps = low, (len(rows) - 1) / (high - low)
        self._high, self._last = high, len(rows) - 2
        self._rows = rows
        self._rises = [between(a, b, 1.0, -1.0) for a, b in pairwise(rows)]

    def at(self, V: float) -> TrimPoint:
        position = (V - self._low) * self._per_mps
        i = min(max(int(position), 0), self._last)
        share = min(max(position - i, 0.0), 1.0)
        # Written out for speed, because it is called three times in every step of a flight.
        alpha, elevator, aileron, rudder, throttle = self._rows[i]
        d_alpha, d_elevator, d_aileron, d_rudder, d_throttle = self._rises[i]
        return TrimPoint(
            alpha + share * d_alpha,
            elevator + share * d_elevator,
            aileron + share * d_aileron,
            rudder + share * d_rudder,
            throttle + share * d_throttle,
        )

    def mixed_with_point(self, share: float, elsewhere: TrimPoint) -> "TrimSchedule":
        """The schedule mixed with one trim point: share 1 gives the schedule, share 0 that point everywhere."""
        return TrimSchedule(self._low, self._high, [between(elsewhere, row, share, 1 - share) for row in self._rows])


def schedule_of(trimmer: Trimmer, points: int = 25) -> TrimSchedule:
    """Level trims from just above the stall to just below the highest speed."""
    low, high = 1.04 * trimmer.V_stall, 0.999 * trimmer.V_max
    rows = []
    for i in range(points):
        trim = trimmer.solve(V=low + i * (high - low) / (points - 1), climb=0.0)
        z = trim.unknowns
        rows.append(TrimPoint(z.alpha, z.elevator, z.aileron, z.rudder, trim.throttle))
    return TrimSchedule(low, high, rows)


def between(a: TrimPoint, b: TrimPoint, b_share: float, a_share: float) -> TrimPoint:
    return TrimPoint(*(a_share * x + b_share * y for x, y in zip(a, b, strict=True)))


class Pilot:
    """Turns targets into commands every `dt` [s]. Its state is the loops' integrals and the last commands."""

    def __init__(self, plant: Plant, trimmer: Trimmer, gains: Gains, dt: float):
        self._gains, self._dt = gains, dt
        self._V_reference = 1.6 * trimmer.V_stall
        self._travel = [(min(s.angle_rad), max(s.angle_rad)) for s in _surfaces(plant)]
        # Elevator against pitch damping in a pull-up: de = -Cmq/Cmde q cbar/2V.
        self._damping = -plant.aero.Cmq / plant.aero.Cmde * plant.aircraft.geometry.chord_m / 2
        schedule = schedule_of(trimmer)
        self._slowest = schedule.at(0.0)
        # Without feed-forward the pilot uses the cruise trim at all speeds.
        self._feedforward = schedule.mixed_with_point(gains.feedforward, schedule.at(self._V_reference))
        self._gamma_integral = 0.0
        self._throttle_integral = 0.0
        self._bank_integral = 0.0
        self._load_integral = 0.0
        self._gamma = 0.0  # the last commanded flight-path angle
        self._throttle = 0.0
        self._speed: float | None = None  # the commanded speed, rate-limited towards the target
        self._stick = 0.0  # the last commanded elevator, without the segment's addition
        self._energy: EnergyController | None = None
        if gains.energy:
            level = schedule.at(self._V_reference)
            speeds = 1.1 * trimmer.V_stall, 0.98 * trimmer.V_max
            self._energy = EnergyController(Cruise(level.alpha, level.throttle, *speeds), dt)

    def fly(self, seen: Observation, want: Targets) -> Commands:
        """Commands for the next step."""
        gains, dt, k = self._gains, self._dt, self._gains.skill
        V = max(seen.V, 5.0)
        bank = min(max(seen.phi, -1.2), 1.2)
        lift = max(want.load_factor or 1.0, 0.2) if want.load_factor is not None else 1 / cos(bank)
        # At load factor n the aircraft needs the angle of attack of level flight at V / sqrt(n).
        loaded, level = self._feedforward.at(V / sqrt(lift)), self._feedforward.at(V)
        alpha_ff, elevator_ff = loaded.alpha, loaded.elevator
        stiffness = min((self._V_reference / V) ** 2, 2.5) if gains.scheduled else 1.0

        if want.hold_elevator:
            elevator = self._stick
        elif want.load_factor is not None:
            q_wanted = g / V * (want.load_factor - cos(seen.theta) * cos(bank))
            self._load_integral += k * 0.1 * stiffness * (want.load_factor - seen.load_factor) * dt
            elevator = elevator_ff + self._damping / V * q_wanted - self._load_integral
            elevator += k * gains.pitch_rate_s * stiffness * (seen.q - q_wanted)
        elif self._energy is not None and want.height_m is not None and want.speed_mps is not None:
            theta_wanted, throttle_wanted = self._energy.command(seen, want.height_m, want.climb_mps, want.speed_mps)
            elevator = elevator_ff + k * stiffness * gains.pitch * (seen.theta - theta_wanted)
            elevator += k * stiffness * gains.pitch_rate_s * (seen.q - g / V * sin(bank) ** 2)
            want = want._replace(throttle=throttle_wanted)
        else:
            climb = want.climb_mps
            if want.height_m is not None:
                climb += k * gains.height_per_s * (want.height_m - seen.height)
            gamma_unlimited = asin(min(max(climb / V, -MAX_GAMMA_RAD), MAX_GAMMA_RAD))
            gamma = seen.climb / V
            most = MAX_GAMMA_RATE_RADPS * dt
            gamma_wanted = self._gamma + min(max(gamma_unlimited - self._gamma, -most), most)
            self._gamma = gamma_wanted
            self._gamma_integral += k * gains.climb_integral_per_s * (gamma_wanted - gamma) * dt
            self._gamma_integral = min(max(self._gamma_integral, -0.3), 0.3)
            theta_wanted = alpha_ff * cos(bank) + gamma_wanted + k * gains.climb * (gamma_wanted - gamma)
            theta_wanted += self._gamma_integral
            turn = g / V * sin(bank)
            q_steady = turn * sin(bank)
            elevator = elevator_ff + k * stiffness * gains.pitch * (seen.theta - theta_wanted)
            elevator += k * stiffness * gains.pitch_rate_s * (seen.q - q_steady)
        self._stick = elevator
        elevator += want.elevator_rad
        # Stall recovery: beyond the angle of attack of the slowest trim, elevator down in proportion to the excess.
        elevator = max(
            elevator, self._slowest.elevator + STALL_PUSH * (seen.alpha - self._slowest.alpha - STALL_MARGIN_RAD)
        )

        bank_wanted = self._bank_wanted(seen, want, V) + want.bank_wander_rad
        bank_error = bank_wanted - seen.phi
        self._bank_integral = min(max(self._bank_integral + 0.15 * k * bank_error * dt, -0.1), 0.1)
        aileron = level.aileron + stiffness * k * (gains.bank * bank_error - gains.bank_rate_s * seen.p)
        aileron += self._bank_integral
        r_steady = g / V * sin(seen.phi) * cos(seen.theta)
        rudder = level.rudder + stiffness * k * gains.yaw_rate_s * (seen.r - r_steady)

        throttle = self._throttle_for(seen, want)
        self._throttle = throttle
        (e0, e1), (a0, a1), (r0, r1) = self._travel
        return Commands(min(max(elevator, e0), e1), min(max(aileron, a0), a1), min(max(rudder, r0), r1), throttle)

    def _bank_wanted(self, seen: Observation, want: Targets, V: float) -> float:
        if want.bank_rad is not None:
            return want.bank_rad
        if want.heading_rad is None:
            return 0.0
        error = atan2(sin(want.heading_rad - seen.psi), cos(want.heading_rad - seen.psi))
        bank = self._gains.heading * error * min(V / self._V_reference, 2.0)
        return copysign(min(abs(bank), MAX_BANK_RAD), bank)

    def _throttle_for(self, seen: Observation, want: Targets) -> float:
        if want.throttle is not None:
            self._throttle_integral, self._speed = 0.0, None
            return min(max(want.throttle, 0.0), 1.0)
        if want.speed_mps is None:
            return self._throttle
        most = MAX_SPEED_CHANGE_MPS2 * self._dt
        before = seen.V if self._speed is None else self._speed
        change = min(max(want.speed_mps - before, -most), most)
        self._speed = before + change
        error = self._speed - seen.V
        gains, k = self._gains, self._gains.skill
        base = self._feedforward.at(self._speed).throttle
        throttle = base + gains.acceleration_s2_per_m * change / self._dt
        throttle += k * gains.speed_per_m * error + self._throttle_integral
        if 0 < throttle < 1:
            self._throttle_integral += k * gains.speed_integral * error * self._dt
        return min(max(throttle, 0.0), 1.0)


def _surfaces(plant: Plant) -> tuple[ControlSurface, ControlSurface, ControlSurface]:
    return plant.aircraft.elevator, plant.aircraft.aileron, plant.aircraft.rudder


def pilot_named(name: str) -> Gains:
    if name not in PILOTS:
        raise InputError(f"pilot {name!r}: not one of {', '.join(PILOTS)}")
    return PILOTS[name]


def wrap_angle(angle: float) -> float:
    """An angle in (-pi, pi]."""
    return pi - (pi - angle) % (2 * pi)


# Three sines with incommensurable periods: share of the amplitude, and period divided by the longest period.
SINES = ((0.5, 1.0), (0.3, 0.618), (0.2, 0.368))


@dataclass(frozen=True, kw_only=True)
class PilotWander:
    """A pilot's deviations from a segment of the plan: the largest amplitude and the longest period of each."""

    bank_rad: float = 0.0
    bank_period_s: float = 12.0
    height_m: float = 0.0
    height_period_s: float = 25.0
    speed_mps: float = 0.0
    speed_period_s: float = 20.0

    def wandering(self, targets: Targets, t_s: float, phases: tuple[float, ...]) -> Targets:
        """The targets of a segment at time t_s since the start, with the deviations added. phases: `drawn_phases`."""
        bank, _ = _sines(t_s, self.bank_rad, self.bank_period_s, phases[:3])
        height, climb = _sines(t_s, self.height_m, self.height_period_s, phases[3:6])
        if targets.height_m is not None:
            targets = targets._replace(height_m=targets.height_m + height, climb_mps=targets.climb_mps + climb)
        if targets.speed_mps is not None:
            speed, _ = _sines(t_s, self.speed_mps, self.speed_period_s, phases[6:])
            targets = targets._replace(speed_mps=targets.speed_mps + speed)
        return targets._replace(bank_wander_rad=bank)


def drawn_phases(seed: int) -> tuple[float, ...]:
    """Phases [rad] of the nine sines on one flight."""
    return tuple(np.random.default_rng([seed, 0xB4]).uniform(0, 2 * pi, 9).tolist())


def _sines(t_s: float, amplitude: float, period_s: float, phases: tuple[float, ...]) -> tuple[float, float]:
    """A sum of three sines, and its rate [1/s]."""
    value = rate = 0.0
    for (share, ratio), phase in zip(SINES, phases, strict=True):
        omega = 2 * pi / (ratio * period_s)
        value += share * amplitude * sin(omega * t_s + phase)
        rate += share * amplitude * omega * cos(omega * t_s + phase)
    return value, rate
