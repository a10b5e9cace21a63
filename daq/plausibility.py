"""Whether readings that are each in order can be true together: one can lie while its status is `ok`.

The sampling thread keeps the latest readings, and compares them once a second. What is wrong for some seconds is told
(event, state, ground station, page) and so marked in the log; no reading is changed.
"""

import enum
import math
from collections.abc import Iterable
from typing import TypeVar

import msgspec

from daq.rest_check import MAX_BAROMETER_DIFFERENCE_PA, MIN_SATELLITES, THREE_DIMENSIONAL
from daq.sensors import Sample
from daq.sensors.ublox import AIRBORNE
from flight.messages import OK, AbsolutePressure, Battery, DifferentialPressure, Event, Gps, Rpm

TOPICS = frozenset(("/probe/airspeed", "/gps", "/baro", "/static", "/battery", "/rpm"))
M = TypeVar("M")
DENSITY_KGPM3 = 1.2  # 10 % of it is 5 % of airspeed, far less than the wind
# Airspeed and speed over the ground differ by the wind at most; nobody flies tests in more than this.
STRONGEST_WIND_MPS = 10.0
MAX_SPEED_ACCURACY_MPS = 1.0  # in flight; `daq check` demands half of it
IDLE_CURRENT_A = 3.0  # receiver, servos and computer stay below
COMPARE_EVERY_NS, MAX_AGE_NS = 1_000_000_000, 2_000_000_000
WRONG_FOR_NS = 5_000_000_000  # before it is told; and right for as long, before it is plausible again


class Comparison(enum.StrEnum):
    """What is compared."""

    AIRSPEED = "airspeed"
    BAROMETERS = "barometers"
    MOTOR = "motor speed"
    GPS = "GPS"


class Values(msgspec.Struct, frozen=True, kw_only=True):
    """The latest readings that the crew knows by heart; None where there is none."""

    airspeed_mps: float | None = None  # of q_c, without calibration and zero
    height_msl_m: float | None = None
    satellites: int | None = None
    motor_speed_revps: float | None = None


class Plausibility:
    """Compares the readings of all sensors with one another."""

    def __init__(self) -> None:
        self._latest: dict[str, tuple[int, object]] = {}
        self._due_ns = 0
        self._changed_ns: dict[Comparison, int] = {}  # since when it has not been as it was last told
        self._told: dict[Comparison, str] = {}

    @property
    def implausible(self) -> list[str]:
        """What is wrong at present, a clause each."""
        return list(self._told.values())

    def add(self, samples: Iterable[Sample], now_ns: int) -> list[Event]:
        """Take a tick's messages; returns an event for each comparison that has become wrong, or right again."""
        for topic, time_ns, message, _ in samples:
            if topic in TOPICS and (message.status is OK or topic == "/gps"):
                self._latest[topic] = (time_ns, message)
        if now_ns < self._due_ns:
            return []
        self._due_ns = now_ns + COMPARE_EVERY_NS
        events = []
        for comparison, text in self._compared(now_ns).items():
            if bool(text) == (comparison in self._told):
                self._changed_ns.pop(comparison, None)
                continue
            if now_ns - self._changed_ns.setdefault(comparison, now_ns) < WRONG_FOR_NS:
                continue
            del self._changed_ns[comparison]
            if text:
                self._told[comparison] = text
                events.append(Event(severity="warning", sensor="daq", text=text))
            else:
                del self._told[comparison]
                events.append(Event(sensor="daq", text=f"{comparison} plausible again"))
        return events

    def values(self, now_ns: int) -> Values:
        """The latest readings."""
        gps, motor = self._of(Gps, "/gps", now_ns), self._of(Rpm, "/rpm", now_ns)
        return Values(
            airspeed_mps=self._airspeed_mps(now_ns),
            height_msl_m=gps.height_msl_m if gps else None,
            satellites=gps.satellites if gps else None,
            motor_speed_revps=motor.motor_speed_revps if motor else None,
        )

    def _compared(self, now_ns: int) -> dict[Comparison, str]:
        """What is wrong with each; empty where nothing is, or a reading is missing, which its status tells."""
        return {
            Comparison.AIRSPEED: self._airspeed_problem(now_ns),
            Comparison.BAROMETERS: self._barometer_problem(now_ns),
            Comparison.MOTOR: self._motor_problem(now_ns),
            Comparison.GPS: self._receiver_problem(now_ns),
        }

    def _airspeed_mps(self, now_ns: int) -> float | None:
        q_c = self._of(DifferentialPressure, "/probe/airspeed", now_ns)
        if q_c is None or q_c.differential_pressure_Pa is None:
            return None
        return math.sqrt(2 * max(q_c.differential_pressure_Pa, 0.0) / DENSITY_KGPM3)

    def _airspeed_problem(self, now_ns: int) -> str:
        airspeed, gps = self._airspeed_mps(now_ns), self._of(Gps, "/gps", now_ns)
        if airspeed is None or gps is None or gps.velocity_north_mps is None or gps.velocity_east_mps is None:
            return ""
        over_ground = math.hypot(gps.velocity_north_mps, gps.velocity_east_mps)
        if abs(over_ground - airspeed) <= STRONGEST_WIND_MPS:
            return ""
        return f"airspeed {airspeed:.0f} m/s, {over_ground:.0f} over the ground: is a line of the probe off or blocked?"

    def _barometer_problem(self, now_ns: int) -> str:
        baro, static = (self._of(AbsolutePressure, topic, now_ns) for topic in ("/baro", "/static"))
        if baro is None or static is None or baro.pressure_Pa is None or static.pressure_Pa is None:
            return ""
        q_c = self._of(DifferentialPressure, "/probe/airspeed", now_ns)
        # The pressure in the fuselage differs from the static one by a part of q.
        allowed_Pa = MAX_BAROMETER_DIFFERENCE_PA + abs((q_c and q_c.differential_pressure_Pa) or 0.0)
        difference_Pa = baro.pressure_Pa - static.pressure_Pa
        if abs(difference_Pa) <= allowed_Pa:
            return ""
        return f"barometers differ by {difference_Pa / 100:+.0f} hPa: is the static line off or blocked?"

    def _motor_problem(self, now_ns: int) -> str:
        battery, motor = self._of(Battery, "/battery", now_ns), self._of(Rpm, "/rpm", now_ns)
        if battery is None or battery.current_A is None or battery.current_A <= IDLE_CURRENT_A:
            return ""
        if motor is not None and motor.motor_speed_revps:
            return ""
        return f"{battery.current_A:.0f} A, but no motor speed: is the RPM sensor's wire off?"

    def _receiver_problem(self, now_ns: int) -> str:
        gps = self._of(Gps, "/gps", now_ns)
        if gps is None or gps.fix_type is None or gps.status is not OK:
            return ""
        if gps.dynamic_model is not None and gps.dynamic_model not in AIRBORNE:
            return f"the GPS receiver's dynamic model is {gps.dynamic_model}: it smooths velocity"
        if gps.fix_type != THREE_DIMENSIONAL or (gps.satellites or 0) < MIN_SATELLITES:
            return f"GPS has a fix of type {gps.fix_type} with {gps.satellites} satellites"
        if (gps.speed_accuracy_mps or 0.0) > MAX_SPEED_ACCURACY_MPS:
            return f"GPS knows velocity to {gps.speed_accuracy_mps:.1f} m/s only"
        return ""

    def _of(self, kind: type[M], topic: str, now_ns: int) -> M | None:
        """The latest message, if it is not old."""
        time_ns, message = self._latest.get(topic, (0, None))
        return message if isinstance(message, kind) and now_ns - time_ns <= MAX_AGE_NS else None
