"""What the topics of a log mean: one message type a topic, raw counts and SI values side by side.

Every message carries a `status`. A reading that failed is a message whose status says why and whose other fields are
null; it is never a repeated old value. Units stand at the end of the names. Axes are the body's: x forward, y right,
z down. The JSON Schema of a topic is generated from its type (`schema_of`).
"""

import enum
from typing import Any, ClassVar

import msgspec


class Status(enum.StrEnum):
    """Why a message holds what it holds."""

    OK = "ok"
    STARTING = "starting"  # the sensor has not been brought up yet
    STALE = "stale"  # the part says it has nothing new since the last reading
    FAULT = "fault"  # the part reports a fault of its own
    SATURATED = "saturated"  # counts at the end of the range: the value is a bound, not a measurement
    NO_REPLY = "no_reply"  # nothing acknowledged at the address
    TIMEOUT = "timeout"  # the bus, or the expected data, did not come in time
    BUSY = "busy"  # the part is measuring something else at this tick (its own temperature)
    CORRUPT = "corrupt"  # checksum, framing or plausibility failed
    WRONG_DEVICE = "wrong_device"  # something else answers at the address
    NO_DATA = "no_data"  # silence: nothing was received since the last tick


class Message(msgspec.Struct, kw_only=True):
    """Base of all messages."""

    topics: ClassVar[tuple[str, ...]] = ()

    status: Status = Status.OK


class Imu(Message):
    """Specific force and angular rate, averaged over the FIFO samples since the last tick (MPU9250)."""

    topics = ("/imu",)

    samples: int | None = None  # how many were averaged
    group_delay_s: float | None = None  # of the part's low-pass filter and of the averaging; not taken out of log_time
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
    temperature_counts: int | None = None  # D2, of the latest temperature conversion
    pressure_Pa: float | None = None
    temperature_K: float | None = None


class DifferentialPressure(Message):
    """A pressure difference of the five-port probe (MS4515DO, Honeywell SSC).

    /probe/alpha: lower minus upper port. /probe/beta: right minus left port (positive with wind from the right).
    /probe/airspeed: centre port minus static.
    """

    topics = ("/probe/alpha", "/probe/beta", "/probe/airspeed")

    pressure_counts: int | None = None
    temperature_counts: int | None = None
    differential_pressure_Pa: float | None = None
    temperature_K: float | None = None


class Gps(Message):
    """A navigation solution (u-blox NAV-PVT); `log_time` is its arrival, `itow_ms` the instant it is valid for."""

    topics = ("/gps",)

    itow_ms: int | None = None
    fix_type: int | None = None  # 0 none, 2 two-dimensional, 3 three-dimensional
    satellites: int | None = None
    utc_ns: int | None = None  # Unix time of the solution, when the receiver calls date and time valid
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


class Rpm(Message):
    """Speed of the motor from the period of its commutation pulses."""

    topics = ("/rpm",)

    period_us: int | None = None  # as received: ten electrical periods
    motor_speed_revps: float | None = None


class Controls(Message):
    """Pulse widths to the servos, surface angles by the aircraft file's table, and what the sticks say."""

    topics = ("/controls",)

    pulse_us: list[int] | None = None  # channels 1, 2, …
    stick_pulse_us: list[int] | None = None  # of the receiver; null when it has said nothing since the last message
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


class Time(Message):
    """One instant on every clock there is."""

    topics = ("/time",)

    monotonic_ns: int | None = None
    system_ns: int | None = None
    gps_utc_ns: int | None = None


class Tick(Message):
    """How the sampling loop itself did."""

    topics = ("/daq/tick",)

    late_ns: int = 0
    missed: int = 0  # ticks skipped just before this one
    duration_ns: dict[str, int] = {}  # of each sensor's turn


class Event(Message):
    """Something a person should know: a sensor failed or came back, a file was started."""

    topics = ("/daq/event",)

    severity: str = "info"  # info, warning, error
    sensor: str = ""
    text: str = ""


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
    Time,
    Tick,
    Event,
)
TYPE_OF_TOPIC: dict[str, type[Message]] = {topic: kind for kind in MESSAGES for topic in kind.topics}


def schema_of(kind: type[Message]) -> dict[str, Any]:
    """JSON Schema of a message type, its root an object (what Foxglove and PlotJuggler ask for)."""
    (reference,), components = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    root = dict(components.pop(reference["$ref"].rsplit("/", 1)[-1]))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **root, "$defs": components}
