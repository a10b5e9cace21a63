"""The messages of a log: one message type per topic, with raw counts and SI values.

Every message has a `status`. A failed reading is a message whose status gives the reason and whose other fields are
null; an old value is never repeated. Names end with their unit. Axes are body axes: x forward, y right, z down. The
JSON Schema of a topic is generated from its type (`schema_of`).
"""

import enum
from typing import Any, ClassVar

import msgspec
import msgspec.inspect


class Status(enum.StrEnum):
    """Whether a message is a measurement, and if not, why."""

    OK = "ok"
    STARTING = "starting"  # the sensor has not been brought up yet
    STALE = "stale"  # the part reports no new value since the last reading
    FAULT = "fault"  # the part reports a fault of its own
    SATURATED = "saturated"  # counts at the end of the range: the value is only a bound
    NO_REPLY = "no_reply"  # nothing acknowledged at the address
    TIMEOUT = "timeout"  # the bus or the part did not answer in time
    BUSY = "busy"  # the part is measuring something else at this tick (its own temperature)
    CORRUPT = "corrupt"  # checksum, framing or plausibility failed
    WRONG_DEVICE = "wrong_device"  # something else answers at the address
    NO_DATA = "no_data"  # nothing was received since the last tick


TOPICS_FOR_DRAG = ("/imu", "/probe/alpha", "/probe/airspeed", "/static", "/rpm")  # drag requires all of them
# The first day of GPS time, and a century later: any other date is a receiver's mistake, and may be no valid year.
FIRST_UTC_NS, LAST_UTC_NS = 315_964_800 * 10**9, 4_102_444_800 * 10**9
OK = Status.OK  # looking up a member of an enum takes as long as making a small message (Python 3.11)


class Message(msgspec.Struct, kw_only=True):
    """Base of all messages."""

    topics: ClassVar[tuple[str, ...]] = ()

    status: Status = OK


class Imu(Message):
    """Specific force and angular rate, averaged over the FIFO samples since the last tick (MPU9250)."""

    topics = ("/imu",)

    samples: int | None = None  # number of samples averaged
    group_delay_s: float | None = None  # delay by low-pass filter and averaging; log_time is not corrected for it
    specific_force_group_delay_s: float | None = None  # where the accelerometers' delay differs from the gyroscopes'
    accel_x_counts: float | None = None
    accel_y_counts: float | None = None
    accel_z_counts: float | None = None
    gyro_x_counts: float | None = None
    gyro_y_counts: float | None = None
    gyro_z_counts: float | None = None
    temperature_counts: float | None = None
    specific_force_x_mps2: float | None = None
    specific_force_y_mps2: float | None = None
    specific_force_z_mps2: float | None = None
    angular_rate_x_radps: float | None = None
    angular_rate_y_radps: float | None = None
    angular_rate_z_radps: float | None = None
    temperature_K: float | None = None


class Magnetometer(Message):
    """Magnetic flux density in body axes (AK8963, whose own axes differ from the body's)."""

    topics = ("/mag",)

    x_counts: int | None = None
    y_counts: int | None = None
    z_counts: int | None = None
    field_x_T: float | None = None
    field_y_T: float | None = None
    field_z_T: float | None = None


class AbsolutePressure(Message):
    """A barometer: inside the fuselage on /baro (MS5611), on the probe's static line on /static (MS5805)."""

    topics = ("/baro", "/static")

    pressure_counts: int | None = None  # D1
    temperature_counts: int | None = None  # D2 of the latest temperature conversion
    pressure_Pa: float | None = None
    temperature_K: float | None = None


class DifferentialPressure(Message):
    """A pressure difference of the five-port probe (MS4515DO, Honeywell SSC).

    /probe/alpha: lower minus upper port. /probe/beta: right minus left port (positive with wind from the right).
    /probe/airspeed: center port minus static.
    """

    topics = ("/probe/alpha", "/probe/beta", "/probe/airspeed")

    pressure_counts: int | None = None
    temperature_counts: int | None = None
    differential_pressure_Pa: float | None = None
    temperature_K: float | None = None


AIRBORNE_MODELS = frozenset({6, 7, 8})  # models of a receiver's filter (CFG-NAV5 dynModel): airborne below 1, 2, 4 g


class Gps(Message):
    """A navigation solution (u-blox NAV-PVT); `log_time` is the time of arrival, `itow_ms` the time of validity."""

    topics = ("/gps",)

    itow_ms: int | None = None
    fix_type: int | None = None  # 0 none, 2 two-dimensional, 3 three-dimensional
    satellites: int | None = None
    utc_ns: int | None = None  # Unix time of the solution, when the receiver reports date and time as resolved
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None  # above the ellipsoid
    height_msl_m: float | None = None
    velocity_north_mps: float | None = None
    velocity_east_mps: float | None = None
    velocity_down_mps: float | None = None
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    speed_accuracy_mps: float | None = None
    # Model of the receiver's filter, as read back: 6 to 8 airborne; the factory's 0 smooths velocity. Null: not known.
    dynamic_model: int | None = None


class Rpm(Message):
    """Speed of the motor from the period of its commutation pulses."""

    topics = ("/rpm",)

    period_us: int | None = None  # as received: ten electrical periods, or ten times the mean of more than ten
    motor_speed_revps: float | None = None  # null with the status `corrupt` where the pulses do not agree
    pulses_captured: int | None = None  # since the last frame; null if the counter does not report it
    pulses_rejected: int | None = None  # captured pulses rejected because they came too early
    pulses_inserted: int | None = None  # missing pulses that were inserted


class Controls(Message):
    """Pulse widths to the servos, surface angles from the aircraft file's tables, and stick positions."""

    topics = ("/controls",)

    pulse_us: list[int] | None = None  # channels 1, 2, …
    stick_pulse_us: list[int] | None = None  # from the RC receiver; null if nothing came since the last message
    elevator_rad: float | None = None
    aileron_rad: float | None = None
    rudder_rad: float | None = None
    throttle: float | None = None  # 0 to 1


class Attitude(Message):
    """The autopilot's own attitude estimate: for comparison only, never used as truth in an acceleration run."""

    topics = ("/attitude",)

    roll_rad: float | None = None
    pitch_rad: float | None = None
    yaw_rad: float | None = None


class Battery(Message):
    topics = ("/battery",)

    voltage_V: float | None = None
    current_A: float | None = None


class Analog(Message):
    """The voltage at one input of an analog converter (ADS1115). The inputs of the converter are sampled in turn."""

    topics = ("/analog",)

    channel: int | None = None  # input of the converter, from 0
    counts: int | None = None
    voltage_V: float | None = None


class Time(Message):
    """One instant on every clock."""

    topics = ("/time",)

    monotonic_ns: int | None = None
    system_ns: int | None = None
    gps_utc_ns: int | None = None


class Tick(Message):
    """Timing of the sampling loop."""

    topics = ("/daq/tick",)

    late_ns: int = 0
    missed: int = 0  # ticks skipped just before this one
    duration_ns: dict[str, int] = {}  # reading time by sensor


class Comparison(enum.StrEnum):
    """Readings that the daemon compares in flight, because one may be wrong while its status is `ok`."""

    AIRSPEED = "airspeed"  # airspeed with the speed over the ground
    ANGLE_OF_ATTACK = "angle of attack"  # angle of attack with attitude minus flight-path angle
    BAROMETERS = "barometers"  # the barometers with each other
    MOTOR = "motor speed"  # motor speed with the current
    GPS = "GPS"  # the receiver's fix, accuracy and dynamic model with the requirements
    SECOND_SENSORS = "second sensors"  # second sensors with the first of their kind


class Event(Message):
    """News for the user: a sensor failed or recovered, a file was started."""

    topics = ("/daq/event",)

    severity: str = "info"  # info, warning, error
    sensor: str = ""
    text: str = ""
    compared: Comparison | None = None  # readings that contradict each other; with severity `info`: plausible again


class State(Message):
    """The state of the recording, once a second; the page and the ground station have the same text."""

    topics = ("/daq/state",)

    recording: bool = False
    well: bool = False  # true if there is nothing that the crew should know before the next run
    rate_Hz: float = 0.0  # rate of the ticks since the last state
    missed: int = 0  # missed ticks since the start
    text: str = ""
    run: str = ""  # progress of the run being flown; empty if there is none
    supply_low: bool | None = None  # supply of the computer; None if unknown
    processor_temperature_K: float | None = None


MESSAGES: tuple[type[Message], ...] = (
    Imu,
    Magnetometer,
    AbsolutePressure,
    DifferentialPressure,
    Gps,
    Rpm,
    Controls,
    Attitude,
    Battery,
    Analog,
    Time,
    Tick,
    Event,
    State,
)
SECOND = "/2"  # suffix of the topic of a second sensor of one kind
DOUBLED = ("/imu", "/gps", "/baro", "/static", "/probe/airspeed")  # kinds of which a tray may have a second one
TYPE_OF_TOPIC: dict[str, type[Message]] = {topic: kind for kind in MESSAGES for topic in kind.topics}
TYPE_OF_TOPIC |= {topic + SECOND: TYPE_OF_TOPIC[topic] for topic in DOUBLED}
SECOND_TOPICS = frozenset(topic + SECOND for topic in DOUBLED)


def schema_of(kind: type[Message]) -> dict[str, Any]:
    """JSON Schema of a message type, as Foxglove, Lichtblick and PlotJuggler require it.

    Its root is an object, and every property has one plain type: those programs read no `anyOf`, no `$ref` and no list
    of types. So the schema does not say that a field is null when it has no measurement.
    """
    info = msgspec.inspect.type_info(kind)
    assert isinstance(info, msgspec.inspect.StructType)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": kind.__name__,
        "description": " ".join((kind.__doc__ or "").split()),
        "type": "object",
        "properties": {field.encode_name: _schema_of_type(field.type) for field in info.fields},
    }


def _schema_of_type(kind: msgspec.inspect.Type) -> dict[str, Any]:
    """The schema of one plain type. Raises TypeError for a field that viewers could not show."""
    match kind:
        case msgspec.inspect.UnionType(types=types):
            (measured,) = (each for each in types if not isinstance(each, msgspec.inspect.NoneType))
            return _schema_of_type(measured)
        case msgspec.inspect.EnumType(cls=cls):
            return {"type": "string", "enum": [member.value for member in cls]}
        case msgspec.inspect.ListType(item_type=item):
            return {"type": "array", "items": _schema_of_type(item)}
        case msgspec.inspect.DictType(value_type=value):
            return {"type": "object", "properties": {}, "additionalProperties": _schema_of_type(value)}
        case msgspec.inspect.BoolType():
            return {"type": "boolean"}
        case msgspec.inspect.IntType():
            return {"type": "integer"}
        case msgspec.inspect.FloatType():
            return {"type": "number"}
        case msgspec.inspect.StrType():
            return {"type": "string"}
    raise TypeError(f"no plain JSON type for {kind}")
