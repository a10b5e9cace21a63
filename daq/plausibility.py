"""Checks whether readings contradict each other: a reading can be wrong although its status is `ok`.

The sampling thread keeps the latest readings, and compares them once a second. A contradiction that lasts some seconds
is reported (event, state, ground station, page), and is thereby marked in the log; no reading is changed.
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import TypeVar

import msgspec

from flightpower.daq.rest_check import MAX_BAROMETER_DIFFERENCE_PA, MIN_SATELLITES, THREE_DIMENSIONAL
from flightpower.daq.sensors import Sample
from flightpower.daq.still_air_zero import DIFFERENCE, Zero
from flightpower.flight.messages import (
    AIRBORNE_MODELS,
    OK,
    AbsolutePressure,
    Attitude,
    Battery,
    Comparison,
    DifferentialPressure,
    Event,
    Gps,
    Rpm,
)
from flightpower.flight.probe_maps import ProbeMaps

TOPICS = frozenset(
    (
        "/probe/airspeed",
        "/probe/airspeed/2",
        "/probe/alpha",
        "/probe/beta",
        "/attitude",
        "/gps",
        "/gps/2",
        "/baro",
        "/static",
        "/battery",
        "/rpm",
    )
)
M = TypeVar("M")
DENSITY_KGPM3 = 1.2  # an error of 10 % in it is 5 % of airspeed, far less than the wind
# Airspeed and speed over the ground differ by no more than the wind; nobody flies tests in more wind than this.
STRONGEST_WIND_MPS = 10.0
MAX_SPEED_ACCURACY_MPS = 1.0  # in flight; `daq check` demands half of it
IDLE_CURRENT_A = 3.0  # receiver, servos and computer draw less
# Averaged over 20 s of steady flight, angle of attack and attitude minus flight-path angle differ by the mounting of
# probe and autopilot, upwash and vertical gusts; exchanged lines of the probe reverse the sign of the angle of attack.
# While speed changes, an autopilot's attitude is wrong by up to 10 deg.
MAX_ALPHA_DIFFERENCE_RAD = math.radians(6.0)
MEAN_OF_COMPARISONS = 20
STEADY_OVER, STEADY_MPS = 5, 1.0  # flight is steady if airspeed changes by less over so many comparisons
LEAST_AIRSPEED_MPS, LARGEST_BANK_RAD = 8.0, math.radians(25.0)  # limits of comparing alpha with attitude
MAX_SECOND_DIFFERENCE_MPS = 3.0  # speeds by two sensors differ by their places on the aircraft, turns, position errors
COMPARE_EVERY_NS, MAX_AGE_NS = 1_000_000_000, 2_000_000_000
WRONG_FOR_NS = 5_000_000_000  # how long readings are wrong before a report, and right before they are plausible again


class Values(msgspec.Struct, frozen=True, kw_only=True):
    """The latest readings of quantities that the crew can judge; None if missing."""

    airspeed_mps: float | None = None  # from q_c, without calibration and zero
    height_msl_m: float | None = None
    satellites: int | None = None
    motor_speed_revps: float | None = None


class Plausibility:
    """Compares the readings of all sensors with one another. probe, zero: the tray's, for the angle of attack."""

    def __init__(self, probe: ProbeMaps | None = None, zero: Zero | None = None) -> None:
        self._probe = probe
        self._zeros_Pa = (
            {topic: readings[DIFFERENCE].mean for topic, readings in zero.readings.items() if DIFFERENCE in readings}
            if zero
            else {}
        )
        self._airspeeds_mps: deque[float] = deque(maxlen=STEADY_OVER)
        self._alpha_differences: deque[float] = deque(maxlen=MEAN_OF_COMPARISONS)
        self._latest: dict[str, tuple[int, object]] = {}
        self._due_ns = 0
        self._changed_ns: dict[Comparison, int] = {}  # since when the result differs from the last report
        self._notified: dict[Comparison, str] = {}

    @property
    def implausible(self) -> list[str]:
        """Current faults, one clause each."""
        return list(self._notified.values())

    @property
    def mean_alpha_difference_rad(self) -> float | None:
        """Angle of attack by the probe minus that by attitude, averaged over the latest comparisons; None if few."""
        differences = self._alpha_differences
        return sum(differences) / len(differences) if len(differences) == MEAN_OF_COMPARISONS else None

    def add(self, samples: Iterable[Sample], now_ns: int) -> list[Event]:
        """Process a tick's messages. Returns an event for each comparison that has become wrong, or right again."""
        for topic, time_ns, message, _ in samples:
            if topic in TOPICS and (message.status is OK or isinstance(message, Gps)):
                self._latest[topic] = (time_ns, message)
        if now_ns < self._due_ns:
            return []
        self._due_ns = now_ns + COMPARE_EVERY_NS
        events = []
        for comparison, text in self._compared(now_ns).items():
            if bool(text) == (comparison in self._notified):
                self._changed_ns.pop(comparison, None)
                continue
            if now_ns - self._changed_ns.setdefault(comparison, now_ns) < WRONG_FOR_NS:
                continue
            del self._changed_ns[comparison]
            if text:
                self._notified[comparison] = text
                events.append(Event(severity="warning", sensor="daq", text=text, compared=comparison))
            else:
                del self._notified[comparison]
                events.append(Event(sensor="daq", text=f"{comparison} plausible again", compared=comparison))
        return events

    def values(self, now_ns: int) -> Values:
        """The latest readings."""
        gps, motor = self._fresh(Gps, "/gps", now_ns), self._fresh(Rpm, "/rpm", now_ns)
        return Values(
            airspeed_mps=self._airspeed_mps(now_ns),
            height_msl_m=gps.height_msl_m if gps else None,
            satellites=gps.satellites if gps else None,
            motor_speed_revps=motor.motor_speed_revps if motor else None,
        )

    def _compared(self, now_ns: int) -> dict[Comparison, str]:
        """What is wrong by each comparison; empty if nothing is, or if a reading is missing, as its status shows."""
        return {
            Comparison.AIRSPEED: self._airspeed_problem(now_ns),
            Comparison.ANGLE_OF_ATTACK: self._alpha_problem(now_ns),
            Comparison.BAROMETERS: self._barometer_problem(now_ns),
            Comparison.MOTOR: self._motor_problem(now_ns),
            Comparison.GPS: self._receiver_problem(now_ns),
            Comparison.SECOND_SENSORS: self._second_problem(now_ns),
        }

    def _airspeed_mps(self, now_ns: int, topic: str = "/probe/airspeed") -> float | None:
        q_c = self._fresh(DifferentialPressure, topic, now_ns)
        if q_c is None or q_c.differential_pressure_Pa is None:
            return None
        return math.sqrt(2 * max(q_c.differential_pressure_Pa, 0.0) / DENSITY_KGPM3)

    def _speed_over_ground_mps(self, now_ns: int, topic: str = "/gps") -> float | None:
        gps = self._fresh(Gps, topic, now_ns)
        if gps is None or gps.velocity_north_mps is None or gps.velocity_east_mps is None:
            return None
        return math.hypot(gps.velocity_north_mps, gps.velocity_east_mps)

    def _difference_Pa(self, topic: str, now_ns: int) -> float | None:
        """A pressure difference minus its zero."""
        reading = self._fresh(DifferentialPressure, topic, now_ns)
        if reading is None or reading.differential_pressure_Pa is None:
            return None
        return reading.differential_pressure_Pa - self._zeros_Pa.get(topic, 0.0)

    def _alpha_problem(self, now_ns: int) -> str:
        airspeed = self._airspeed_mps(now_ns) or 0.0
        self._airspeeds_mps.append(airspeed)
        if airspeed < LEAST_AIRSPEED_MPS:
            self._alpha_differences.clear()
        steady = max(self._airspeeds_mps) - min(self._airspeeds_mps) < STEADY_MPS
        if steady and (difference := self._alpha_difference_rad(now_ns)) is not None:
            self._alpha_differences.append(difference)
        mean = self.mean_alpha_difference_rad
        if mean is None or abs(mean) <= MAX_ALPHA_DIFFERENCE_RAD:
            return ""
        return (
            f"angle of attack {math.degrees(mean):+.0f} deg from attitude less climb: are lines of the probe off or"
            " exchanged?"
        )

    def _alpha_difference_rad(self, now_ns: int) -> float | None:
        """The probe's angle of attack minus that from attitude and flight path, which neglects the vertical wind."""
        attitude, gps = self._fresh(Attitude, "/attitude", now_ns), self._fresh(Gps, "/gps", now_ns)
        dp_alpha, q_c = self._difference_Pa("/probe/alpha", now_ns), self._difference_Pa("/probe/airspeed", now_ns)
        if self._probe is None or attitude is None or gps is None or dp_alpha is None or q_c is None or q_c <= 0:
            return None
        roll, pitch, down_mps = attitude.roll_rad, attitude.pitch_rad, gps.velocity_down_mps
        if roll is None or pitch is None or down_mps is None or abs(roll) > LARGEST_BANK_RAD:
            return None
        flow = self._probe.flow(dp_alpha / q_c, (self._difference_Pa("/probe/beta", now_ns) or 0.0) / q_c)
        airspeed = math.sqrt(2 * q_c / flow.q_ratio / DENSITY_KGPM3)
        climb = math.asin(min(max(-down_mps / airspeed, -1.0), 1.0))
        return flow.alpha_rad - (pitch - climb) / math.cos(roll)

    def _second_problem(self, now_ns: int) -> str:
        pairs = (
            ("airspeed", self._airspeed_mps(now_ns), self._airspeed_mps(now_ns, "/probe/airspeed/2")),
            (
                "speed over the ground",
                self._speed_over_ground_mps(now_ns),
                self._speed_over_ground_mps(now_ns, "/gps/2"),
            ),
        )
        return "; ".join(
            f"{what} {first:.0f} m/s, {second:.0f} by the second sensor"
            for what, first, second in pairs
            if first is not None and second is not None and abs(first - second) > MAX_SECOND_DIFFERENCE_MPS
        )

    def _airspeed_problem(self, now_ns: int) -> str:
        airspeed, over_ground = self._airspeed_mps(now_ns), self._speed_over_ground_mps(now_ns)
        if airspeed is None or over_ground is None:
            return ""
        if abs(over_ground - airspeed) <= STRONGEST_WIND_MPS:
            return ""
        return f"airspeed {airspeed:.0f} m/s, {over_ground:.0f} over the ground: is a line of the probe off or blocked?"

    def _barometer_problem(self, now_ns: int) -> str:
        baro, static = (self._fresh(AbsolutePressure, topic, now_ns) for topic in ("/baro", "/static"))
        if baro is None or static is None or baro.pressure_Pa is None or static.pressure_Pa is None:
            return ""
        q_c = self._fresh(DifferentialPressure, "/probe/airspeed", now_ns)
        # The pressure in the fuselage differs from static pressure by a fraction of q.
        allowed_Pa = MAX_BAROMETER_DIFFERENCE_PA + abs((q_c and q_c.differential_pressure_Pa) or 0.0)
        difference_Pa = baro.pressure_Pa - static.pressure_Pa
        if abs(difference_Pa) <= allowed_Pa:
            return ""
        return f"barometers differ by {difference_Pa / 100:+.0f} hPa: is the static line off or blocked?"

    def _motor_problem(self, now_ns: int) -> str:
        battery, motor = self._fresh(Battery, "/battery", now_ns), self._fresh(Rpm, "/rpm", now_ns)
        if battery is None or battery.current_A is None or battery.current_A <= IDLE_CURRENT_A:
            return ""
        if motor is not None and motor.motor_speed_revps:
            return ""
        return f"{battery.current_A:.0f} A, but no motor speed: is the RPM sensor's wire off?"

    def _receiver_problem(self, now_ns: int) -> str:
        gps = self._fresh(Gps, "/gps", now_ns)
        if gps is None or gps.fix_type is None or gps.status is not OK:
            return ""
        if gps.dynamic_model is not None and gps.dynamic_model not in AIRBORNE_MODELS:
            return f"the GPS receiver's dynamic model is {gps.dynamic_model}: it smooths velocity"
        if gps.fix_type != THREE_DIMENSIONAL or (gps.satellites or 0) < MIN_SATELLITES:
            return f"GPS has a fix of type {gps.fix_type} with {gps.satellites} satellites"
        if (gps.speed_accuracy_mps or 0.0) > MAX_SPEED_ACCURACY_MPS:
            return f"GPS knows velocity to {gps.speed_accuracy_mps:.1f} m/s only"
        return ""

    def _fresh(self, kind: type[M], topic: str, now_ns: int) -> M | None:
        """The latest message, if it is recent."""
        time_ns, message = self._latest.get(topic, (0, None))
        return message if isinstance(message, kind) and now_ns - time_ns <= MAX_AGE_NS else None
