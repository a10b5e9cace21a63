"""Detects a part that repeats one value, which is impossible in flight, where noise exceeds the resolution of all
parts.

A part or an autopilot that hangs may keep answering with a correct checksum and its last value. A value that repeats
for too long becomes `stale`, if the part's values changed all the time before; a value that never changed proves
nothing. Servo pulses, the battery and analog inputs may stay constant.
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

from flightpower.daq.sensors import Sample
from flightpower.flight.messages import (
    OK,
    AbsolutePressure,
    Attitude,
    DifferentialPressure,
    Gps,
    Imu,
    Magnetometer,
    Message,
    Rpm,
    Status,
)

AIRBORNE_PA, AIRBORNE_MPS = 40.0, 12.0  # 8 m/s by the pitot tube; a speed over the ground that exceeds the wind
SIGNS = frozenset({"/probe/airspeed", "/probe/airspeed/2", "/gps", "/gps/2"})
LANDED_AFTER_NS = 5_000_000_000  # time without a sign of flight
LEARNED_NS = 4_000_000_000  # time of changing values before a repetition proves anything


class Repetition(NamedTuple):
    """The fields of a message type that are compared. A value is stale if it repeats for `limit_ns`, provided that
    earlier values lasted at most `usual_ns` on average.
    """

    fields: tuple[str, ...]
    limit_ns: int
    usual_ns: int


SECOND_NS, CHANGING_NS = 1_000_000_000, 60_000_000
COMPARED: dict[type[Message], Repetition] = {
    # A message has six means of some eight counts each: two equal messages are no coincidence.
    Imu: Repetition(tuple(f"{part}_{axis}_counts" for part in ("accel", "gyro") for axis in "xyz"), 0, 41_000_000),
    Magnetometer: Repetition(("x_counts", "y_counts", "z_counts"), SECOND_NS, CHANGING_NS),
    AbsolutePressure: Repetition(("pressure_counts", "temperature_counts"), SECOND_NS, CHANGING_NS),
    DifferentialPressure: Repetition(("pressure_counts", "temperature_counts"), SECOND_NS, CHANGING_NS),
    Gps: Repetition(  # without the time, which a hung receiver may keep counting
        (
            "velocity_north_mps",
            "velocity_east_mps",
            "velocity_down_mps",
            "latitude_deg",
            "longitude_deg",
            "height_m",
        ),
        400_000_000,
        150_000_000,
    ),
    Rpm: Repetition(("motor_speed_revps", "period_us"), SECOND_NS, CHANGING_NS),
    Attitude: Repetition(("pitch_rad", "roll_rad", "yaw_rad"), SECOND_NS, CHANGING_NS),
}


class RepeatedReadings:
    """Detects repetition in the messages of one kind on one topic."""

    def __init__(self, kind: type[Message]):
        self.kind = kind
        self._compared = COMPARED[kind]
        self._first = attrgetter(self._compared.fields[0])
        self._all = attrgetter(*self._compared.fields)
        self._latest: Message | None = None
        self._latest_value: float | None = None  # the latest message's first field, which nearly always changes
        self._since_ns = 0  # when the latest values were first read
        self._changes = 0  # changes in flight, and how long the values lasted
        self._lasted_ns = 0
        self._stale = False

    def is_stale(self, message: Message, now_ns: int, *, in_flight: bool) -> bool:
        """Whether a measurement repeats an earlier one for impossibly long. It stays stale until it changes."""
        value = self._first(message)
        latest = self._latest
        if value != self._latest_value or latest is None or self._all(message) != self._all(latest):
            if in_flight and not self._stale and latest is not None:
                self._changes += 1
                self._lasted_ns += now_ns - self._since_ns
            self._latest, self._latest_value, self._since_ns, self._stale = message, value, now_ns, False
            return False
        if in_flight and not self._stale:
            limit_ns, usual_ns = self._compared.limit_ns, self._compared.usual_ns
            learned = self._lasted_ns >= LEARNED_NS and self._lasted_ns <= usual_ns * self._changes
            self._stale = learned and now_ns - self._since_ns >= limit_ns
        return self._stale


class RepeatedReadingsOfSensor:
    """Detects repetition in the messages of one sensor."""

    def __init__(self) -> None:
        self._readings: dict[str, RepeatedReadings] = {}
        self.stale = False  # whether a reading became stale, which may last after landing

    def marked(self, samples: list[Sample], now_ns: int, *, in_flight: bool) -> list[Sample]:
        """The samples; those that repeat an old value are marked stale and have no values."""
        for i, (topic, time_ns, message, tick) in enumerate(samples):
            kind = type(message)
            if message.status is not OK or kind not in COMPARED:
                continue
            readings = self._readings.get(topic)
            if readings is None or readings.kind is not kind:
                readings = self._readings[topic] = RepeatedReadings(kind)
            if readings.is_stale(message, now_ns, in_flight=in_flight):
                self.stale = True
                samples[i] = Sample(topic, time_ns, kind(status=Status.STALE), tick)
        return samples


class InFlight:
    """Tracks whether the aircraft is flying, by the latest measurements of pitot tube and receiver."""

    def __init__(self) -> None:
        self._seen_ns: int | None = None

    def update(self, samples: Sequence[Sample], now_ns: int) -> bool:
        """Take a tick's messages."""
        for topic, _, message, _ in samples:
            if topic in SIGNS and message.status is OK and is_sign_of_flight(message):
                self._seen_ns = now_ns
                break
        return self._seen_ns is not None and now_ns - self._seen_ns < LANDED_AFTER_NS


def is_sign_of_flight(message: Message) -> bool:
    """Whether this measurement shows that the aircraft is in the air."""
    if isinstance(message, Gps):
        north, east = message.velocity_north_mps or 0.0, message.velocity_east_mps or 0.0
        return north * north + east * east >= AIRBORNE_MPS**2
    if isinstance(message, DifferentialPressure):
        return (message.differential_pressure_Pa or 0.0) >= AIRBORNE_PA
    return False
