"""Controls height and airspeed as the autopilots ArduPlane and PX4 do (total energy control, TECS).

Throttle responds to the error of total energy, pitch to the error of its distribution between height and airspeed. The
airspeed is the sensor's, gusts included, so throttle responds to gusts, which therefore affect both power and measured
airspeed. Structure and gains are those of ArduPlane 4.x with its default parameters (A. A. Lambregts, AIAA 83-2239;
documentation of TECS).
"""

from dataclasses import dataclass
from math import cos, sin, sqrt

from flightpower.flight.units import GRAVITY_MPS2 as g
from flightpower.sim.integration import Observation

CLIMB_MPS, SINK_MPS = 5.0, 2.0  # TECS_CLMB_MAX, TECS_SINK_MIN: at full and at zero throttle
TIME_CONSTANT_S, THROTTLE_DAMPING_S, PITCH_DAMPING_S = 5.0, 0.5, 0.3  # TECS_TIME_CONST, THR_DAMP, PTCH_DAMP
INTEGRAL = 0.3  # TECS_INTEG_GAIN
SPEED_RADPS = 2.0  # TECS_SPD_OMEGA: at frequencies below it the airspeed is the sensor's, above it the accelerometer's
ROLL_TO_THROTTLE = 10.0  # TECS_RLL2THR [m^2/s^3]
FILTER_S = 0.5  # filter of the error of the energy's rate
SLEW_PER_S = 1.0  # THR_SLEWRATE
STEEPEST_RAD = 0.35  # PTCH_LIM_MAX_DEG, PTCH_LIM_MIN_DEG


@dataclass(frozen=True)
class Cruise:
    """An autopilot's data about its aircraft: pitch and throttle of level cruise, and the permitted airspeeds."""

    pitch_rad: float
    throttle: float
    slowest_mps: float
    fastest_mps: float


class EnergyController:
    """Computes pitch and throttle every `dt` [s]. Its state is the filtered airspeed and the integrals."""

    def __init__(self, cruise: Cruise, dt: float):
        self._cruise, self._dt = cruise, dt
        self._speed: float | None = None
        self._acceleration = 0.0  # integral in the filter of airspeed
        self._wanted_mps = 0.0
        self._rate_error = 0.0
        self._throttle, self._throttle_integral, self._pitch_integral = cruise.throttle, 0.0, 0.0

    def command(self, seen: Observation, height_m: float, climb_mps: float, speed_mps: float) -> tuple[float, float]:
        """Pitch [rad] and throttle (0 to 1) for a wanted height, its rate, and airspeed."""
        dt, cruise = self._dt, self._cruise
        if self._speed is None:
            self._speed = self._wanted_mps = seen.V
        forward = seen.forward_mps2 - g * sin(seen.theta)  # inertial acceleration, which gusts do not disturb
        error = seen.V - self._speed
        self._acceleration += error * SPEED_RADPS**2 * dt
        self._speed += (self._acceleration + forward + sqrt(2) * SPEED_RADPS * error) * dt
        V = max(self._speed, 3.0)
        wanted = min(max(speed_mps, cruise.slowest_mps), cruise.fastest_mps)
        most, least = CLIMB_MPS * g / 2 / V, -SINK_MPS * g / 2 / V
        change = min(max((wanted - self._wanted_mps) / dt, least), most)
        self._wanted_mps += change * dt
        climb_mps = min(max(climb_mps, -3 * SINK_MPS), CLIMB_MPS)

        kinetic, kinetic_rate = (self._wanted_mps**2 - V**2) / 2, V * change - V * forward
        fastest, slowest = (x**2 / 2 - self._wanted_mps**2 / 2 for x in (cruise.fastest_mps, cruise.slowest_mps))
        potential = min(max(g * (height_m - seen.height), slowest), fastest)
        potential_rate = g * (climb_mps - seen.climb)
        throttle = self._throttle_by(seen, potential + kinetic, g * climb_mps + V * change)
        balance = potential - kinetic + PITCH_DAMPING_S * (potential_rate - kinetic_rate)
        balance += TIME_CONSTANT_S * (g * climb_mps - V * change)
        pitch = balance / (V * TIME_CONSTANT_S * g) + self._pitch_integral + cruise.pitch_rad
        if abs(pitch) < STEEPEST_RAD:
            self._pitch_integral += INTEGRAL * (potential - kinetic) * dt / (V * TIME_CONSTANT_S * g)
        return min(max(pitch, -STEEPEST_RAD), STEEPEST_RAD), throttle

    def _throttle_by(self, seen: Observation, energy: float, wanted_rate: float) -> float:
        """Throttle for an energy error [m^2/s^2] and a wanted energy rate [m^2/s^3], both per unit mass."""
        dt, V = self._dt, self._speed or seen.V
        per_throttle = g * (CLIMB_MPS + SINK_MPS)
        wanted_rate = min(max(wanted_rate, -SINK_MPS * g), CLIMB_MPS * g)
        rate = g * seen.climb + V * (seen.forward_mps2 - g * sin(seen.theta))
        self._rate_error += (wanted_rate - rate - self._rate_error) * dt / FILTER_S
        turning = ROLL_TO_THROTTLE * (1 / max(cos(seen.phi) ** 2, 0.1) - 1)
        gain = 1 / (TIME_CONSTANT_S * per_throttle)
        wanted = self._cruise.throttle + (wanted_rate + turning) / per_throttle
        wanted += gain * (energy + THROTTLE_DAMPING_S * self._rate_error) + self._throttle_integral
        if 0 < wanted < 1:
            self._throttle_integral += INTEGRAL * gain * energy * dt
        step = SLEW_PER_S * dt
        self._throttle = min(max(wanted, self._throttle - step, 0.0), self._throttle + step, 1.0)
        return self._throttle
