"""Reads a PX4 log (ULog) into the channels of an ordinary flight."""

import contextlib
import io
from collections.abc import Callable, Collection
from enum import IntEnum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.position import fix_of, places
from flightpower.analysis.sources.recording import (
    AllChannels,
    Battery,
    Channel,
    Event,
    EventKind,
    Fix,
    FlightRecording,
    channel,
    in_order,
    modes,
    most_varying,
    propulsion,
    vehicle_of,
    without_damage,
    without_hover,
    without_jumps,
)
from flightpower.analysis.sources.ulog import BlockwiseULog
from flightpower.analysis.sources.unpacked import unpacked
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

TOPICS = (
    "actuator_controls_0", "actuator_controls_1", "airspeed", "airspeed_validated", "battery_status",
    "differential_pressure", "esc_status", "rpm", "sensor_baro", "sensor_combined", "sensor_gps",
    "vehicle_acceleration", "vehicle_air_data", "vehicle_gps_position", "vehicle_status", "vehicle_thrust_setpoint",
)  # fmt: skip
RECEIVERS = ("vehicle_gps_position", "sensor_gps")
AIRSPEED_TOPICS = (  # topics with their fields, in order of preference
    ("airspeed_validated", ("indicated_airspeed_m_s",)),
    ("airspeed", ("indicated_airspeed_m_s",)),
)
ENABLED_BY = {
    recording.OF_AIRSPEED: " (SENS_EN_*, SYS_HAS_NUM_ASPD)",
    recording.OF_BAROMETER: " (SYS_HAS_BARO)",
    recording.OF_BATTERY: " (BAT1_SOURCE, BAT1_V_DIV, BAT1_A_PER_V)",
}
BAROMETERS = ("vehicle_air_data", "sensor_baro")
FORCES = (recording.FORCE_X, recording.FORCE_Y, recording.FORCE_Z)
RPM_FIELDS = ("rpm_estimate", "indicated_frequency_rpm")
PRESSURE_FIELDS = ("differential_pressure_pa", "differential_pressure_filtered_pa", "differential_pressure_raw_pa")


class _Topic:
    """One instance of a logged topic."""

    def __init__(self, data: dict[str, NDArray[Any]], instance: int):
        self.instance, self._data = instance, data
        self.t_s: Array = np.asarray(data["timestamp"], dtype=float) * 1e-6

    def has(self, field: str) -> bool:
        return field in self._data

    def values(self, field: str) -> Array:
        with np.errstate(invalid="ignore"):
            return without_damage(self._data[field])

    def channel(self, field: str) -> Channel:
        """Return the field's channel; empty if the firmware does not log it."""
        return channel(self.t_s, self.values(field)) if self.has(field) else channel([], [])


def read_px4(path: Path) -> FlightRecording:
    """Return the channels of a PX4 log.

    Raises InputError, with a one-line message, if the file is not a readable ULog, and for aircraft without wings.
    """
    topics, parameters, notes, vehicle, messages = _topics(path)
    _refuse_wingless(path, topics, parameters)
    airspeed, zeroed = _airspeed(topics)
    channels = airspeed | _static(topics) | _force(topics) | _gps(topics)
    batteries = [
        Battery(f"battery_status {topic.instance}", topic.channel("voltage_v"), topic.channel("current_a"))
        for topic in topics.get("battery_status", [])
    ]
    driven, battery_notes, motor_notes = propulsion(
        batteries, _controllers(topics), _motors(topics), most_varying(_throttles(topics))
    )
    channels |= driven
    place, fix = _place(topics)
    (channels, thermometers, place), jumps = without_jumps(channels, _thermometers(topics), place)
    notes += jumps
    # Only after the clock check, where the gap of a long hover would look like a jump.
    channels, hover_notes = without_hover(channels, partial(_lifting_s, topics))
    return FlightRecording(
        path,
        channels,
        thermometers,
        tuple(notes + battery_notes + hover_notes + motor_notes),
        zeroed,
        parameters,
        inside=frozenset(f"{name} {topic.instance}" for name in BAROMETERS for topic in topics.get(name, [])),
        enabled_by=ENABLED_BY,
        vehicle=vehicle,
        place=place,
        fix=fix,
        events=in_order([*_modes(topics), *messages]),
    )


def _opened(path: Path, topics: Collection[str] | None) -> BlockwiseULog:
    """Open the log with these topics, or all of them. Raises InputError if it cannot be read."""
    try:
        with (
            unpacked(path) as plain,
            plain.open("rb") as stream,
            contextlib.redirect_stdout(io.StringIO()),
        ):
            return BlockwiseULog(stream, topics)
    except InputError:
        raise
    except Exception as error:  # a truncated or altered file may raise any exception
        raise InputError(f"{path}: cannot be read as a PX4 log ({type(error).__name__}: {_line(error)})") from None


def start_unix_s(beginning: bytes) -> float | None:
    """Return the Unix time at the start of a log, from GPS in its first bytes; None if these have no fix."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            log = BlockwiseULog(io.BytesIO(beginning), RECEIVERS)
        topics: dict[str, list[_Topic]] = {}
        for data in log.data_list:
            topics.setdefault(data.name, []).append(_Topic(data.data, int(data.multi_id)))
        _, fix = _place(topics)
    except Exception:  # damage can raise any error here; the analysis reports what is wrong
        return None
    return None if fix.unix_at_zero_s is None else fix.unix_at_zero_s + 1e-6 * float(log.start_timestamp)


def all_channels(path: Path) -> AllChannels:
    """Return every field of every topic: `battery_status.voltage_v`, or `battery_status 1.voltage_v` of instance 1.

    Raises InputError if the log cannot be read.
    """
    channels: dict[str, Callable[[], Channel]] = {}
    for data in _opened(path, None).data_list:
        if "timestamp" not in data.data:
            continue
        topic, instance = _Topic(data.data, int(data.multi_id)), f" {data.multi_id}" if data.multi_id else ""
        channels |= {f"{data.name}{instance}.{field}": partial(topic.channel, field) for field in data.data}
    return channels


def _topics(path: Path) -> tuple[dict[str, list[_Topic]], dict[str, float], list[str], str, list[Event]]:
    """Return the topics by name, the autopilot's parameters, notes, the vehicle, and the messages to its pilot."""
    log = _opened(path, TOPICS)
    topics: dict[str, list[_Topic]] = {}
    for data in sorted(log.data_list, key=lambda instance: instance.multi_id):
        if "timestamp" in data.data and len(data.data["timestamp"]):
            topics.setdefault(data.name, []).append(_Topic(data.data, int(data.multi_id)))
    if not topics:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    notes = ["The log is damaged; what could be read is used."] if log.file_corruption else []
    lost_s = sum(dropout.duration for dropout in log.dropouts) / 1000
    if lost_s > 1.0:
        notes.append(f"The autopilot dropped {lost_s:.0f} s of messages, in {len(log.dropouts)} gaps.")
    parameters = {
        str(name): float(value) for name, value in log.initial_parameters.items() if isinstance(value, int | float)
    }
    uuid = log.msg_info_dict.get("sys_uuid")
    messages = [
        Event(1e-6 * instance.timestamp, EventKind.MESSAGE, str(instance.message)) for instance in log.logged_messages
    ]
    return topics, parameters, notes, vehicle_of(uuid) if isinstance(uuid, str) and uuid else "", messages


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120]


class FlightMode(IntEnum):
    """Values of vehicle_status.nav_state."""

    MANUAL = 0
    ALTITUDE = 1
    POSITION = 2
    MISSION = 3
    LOITER = 4
    RETURN = 5
    ACRO = 10
    DESCEND = 12
    TERMINATION = 13
    OFFBOARD = 14
    STABILIZED = 15
    TAKEOFF = 17
    LAND = 18
    FOLLOW = 19
    PRECISION_LAND = 20
    ORBIT = 21
    VTOL_TAKEOFF = 22


class VehicleType(IntEnum):
    """Values of vehicle_status.vehicle_type."""

    ROTARY_WING = 1
    FIXED_WING = 2
    ROVER = 3


class MavType(IntEnum):
    """Values of MAV_TYPE for vehicles without wings."""

    QUADROTOR = 2
    COAXIAL = 3
    HELICOPTER = 4
    GROUND_ROVER = 10
    SURFACE_BOAT = 11
    SUBMARINE = 12
    HEXAROTOR = 13
    OCTOROTOR = 14
    TRICOPTER = 15


ROVERS = {MavType.GROUND_ROVER, MavType.SURFACE_BOAT, MavType.SUBMARINE}
MULTICOPTERS = {*MavType} - ROVERS


def _refuse_wingless(path: Path, topics: dict[str, list[_Topic]], parameters: dict[str, float]) -> None:
    """Raises InputError for a vehicle without wings, and if neither status nor MAV_TYPE tells the vehicle's type."""
    if not topics.get("vehicle_status") and "MAV_TYPE" not in parameters:
        raise InputError(
            f"{path}: the log does not say which vehicle wrote it (no vehicle_status, no MAV_TYPE), and a multicopter's"
            " log cannot give the power of a fixed wing: log vehicle_status, or give the whole log"
        )
    if int(np.nan_to_num(parameters.get("MAV_TYPE", 0.0))) in MULTICOPTERS | ROVERS:
        raise InputError(
            f"{path}: the log of a multicopter, rover or boat; power required is computed for fixed wings only"
        )
    for status in topics.get("vehicle_status", []):
        kinds = status.values("vehicle_type") if status.has("vehicle_type") else np.empty(0)
        mav = set(status.values("system_type").tolist()) if status.has("system_type") else set()
        vtol = status.has("is_vtol") and bool(status.values("is_vtol").any())
        if mav & ROVERS or (len(kinds) and (kinds == VehicleType.ROVER).all()):
            raise InputError(f"{path}: the log of a rover or boat; power required is computed for fixed wings only")
        if mav & MULTICOPTERS or (len(kinds) and (kinds == VehicleType.ROTARY_WING).all()):
            kind = "a multicopter, or of a VTOL that never flew on its wing" if vtol else "a multicopter"
            raise InputError(f"{path}: the log of {kind}; power required is computed for fixed wings only")


def _airspeed(topics: dict[str, list[_Topic]]) -> tuple[dict[str, Channel], bool]:
    """Return the differential pressure of the pitot tube, and whether its zero is already corrected.

    Topics are tried in order of preference; of a topic's instances, the one that varies most is used.
    """
    for name, fields in AIRSPEED_TOPICS:
        channels = []
        for topic in topics.get(name, []):
            for field in fields:
                speed = topic.values(field) if topic.has(field) else np.full(len(topic.t_s), np.nan)
                for source in ("selected_airspeed_index", "airspeed_source"):
                    if topic.has(source):
                        # Other sources are not sensors: 0 is ground speed minus wind, 4 synthetic, -1 none.
                        speed = np.where(np.isin(topic.values(source), (1, 2, 3)), speed, np.nan)
                channels.append(channel(topic.t_s, recording.pressure_of_indicated_airspeed(speed)))
        best = most_varying(channels)
        if best is not None and len(best.t_s) >= READABLE.fewest_samples:
            return {recording.AIRSPEED_PRESSURE: best}, True
    raw = [topic.channel(field) for topic in topics.get("differential_pressure", []) for field in PRESSURE_FIELDS]
    best = most_varying(raw)
    return ({} if best is None else {recording.AIRSPEED_PRESSURE: best}), False


def _lifting_s(topics: dict[str, list[_Topic]], t_s: Array) -> list[Array]:
    """Return times of status messages, and times in t_s (n,), with a VTOL on its lifting motors or in transition."""
    for status in topics.get("vehicle_status", []):
        if status.has("vehicle_type"):
            lifted = status.values("vehicle_type") == VehicleType.ROTARY_WING
            if status.has("in_transition_mode"):
                lifted |= status.values("in_transition_mode") == 1
            latest = np.clip(np.searchsorted(status.t_s, t_s, side="right") - 1, 0, None)
            return [status.t_s[lifted], t_s[lifted[latest]]]
    return []


def _static(topics: dict[str, list[_Topic]]) -> dict[str, Channel]:
    for topic in topics.get("vehicle_air_data", []):
        if topic.has("baro_pressure_pa"):
            return {recording.STATIC: topic.channel("baro_pressure_pa")}
    for barometer in topics.get("sensor_baro", []):
        pressure = barometer.channel("pressure")
        if len(pressure.value):
            factor = 100.0 if np.median(pressure.value) < READABLE.possible["static_Pa"][0] / 10 else 1.0
            return {recording.STATIC: Channel(pressure.t_s, factor * pressure.value)}
    return {}


def _force(topics: dict[str, list[_Topic]]) -> dict[str, Channel]:
    for name, field in (("vehicle_acceleration", "xyz"), ("sensor_combined", "accelerometer_m_s2")):
        axes = {axis: f"{field}[{i}]" for i, axis in enumerate(FORCES)}
        for topic in topics.get(name, []):
            if topic.has(axes[recording.FORCE_Z]):
                return {axis: topic.channel(column) for axis, column in axes.items() if topic.has(column)}
    return {}


def _gps(topics: dict[str, list[_Topic]]) -> dict[str, Channel]:
    fields = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
    for name in ("vehicle_gps_position", "sensor_gps"):
        for topic in topics.get(name, []):
            if not all(topic.has(field) for field in fields):
                continue
            fixed = topic.values("fix_type") >= 3 if topic.has("fix_type") else np.ones(len(topic.t_s), dtype=bool)
            if fixed.sum() >= READABLE.fewest_samples:
                return {
                    axis: channel(topic.t_s[fixed], topic.values(field)[fixed])
                    for axis, field in zip(recording.GPS, fields, strict=True)
                }
    return {}


def _receiver(topics: dict[str, list[_Topic]]) -> tuple[_Topic, str, str, NDArray[np.bool_]] | None:
    """Return the receiver that gives positions, its names of latitude and longitude, and its rows with a fix."""
    names = (("latitude_deg", "longitude_deg"), ("lat", "lon"))  # since 1.14, and before
    for topic in (topic for name in RECEIVERS for topic in topics.get(name, [])):
        for latitude, longitude in names:
            if topic.has(latitude) and topic.has(longitude):
                fixed = topic.values("fix_type") >= 3 if topic.has("fix_type") else np.ones(len(topic.t_s), dtype=bool)
                return topic, latitude, longitude, fixed
    return None


def _place(topics: dict[str, list[_Topic]]) -> tuple[dict[str, Channel], Fix]:
    """Return the distances from the first position, and the date and place."""
    receiver = _receiver(topics)
    if receiver is None:
        return {}, Fix()
    topic, *names, fixed = receiver
    t_s, latitude, longitude = topic.t_s[fixed], *(topic.values(name)[fixed] for name in names)
    heights = (("altitude_msl_m", 1.0), ("alt", 1e-3))  # since 1.14, and before
    height_m = next((unit * topic.values(name)[fixed] for name, unit in heights if topic.has(name)), None)
    unix_s = 1e-6 * topic.values("time_utc_usec")[fixed] if topic.has("time_utc_usec") else None
    return places(t_s, latitude, longitude), fix_of(t_s, latitude, longitude, height_m, unix_s)


def _modes(topics: dict[str, list[_Topic]]) -> list[Event]:
    names = {int(mode): mode.name.replace("_", " ").capitalize() for mode in FlightMode}
    statuses = [topic for topic in topics.get("vehicle_status", []) if topic.has("nav_state")]
    return modes(statuses[0].t_s, statuses[0].values("nav_state"), names) if statuses else []


def _throttles(topics: dict[str, list[_Topic]]) -> list[Channel]:
    """Return the throttles of the propulsion, 0 to 1; newer firmware logs them as thrust along the first axis."""
    newer = [topic.channel("xyz[0]") for topic in topics.get("vehicle_thrust_setpoint", [])]
    vtol = any(topic.has("is_vtol") and topic.values("is_vtol").any() for topic in topics.get("vehicle_status", []))
    older = topics.get("actuator_controls_1" if vtol else "actuator_controls_0", [])
    return newer or [topic.channel("control[3]") for topic in older]


def _controllers(topics: dict[str, list[_Topic]]) -> list[Battery]:
    return [
        Battery(f"esc {i}", topic.channel(f"esc[{i}].esc_voltage"), topic.channel(f"esc[{i}].esc_current"))
        for topic in topics.get("esc_status", [])
        for i in range(8)
        if topic.has(f"esc[{i}].esc_current")
    ]


def _motors(topics: dict[str, list[_Topic]]) -> list[Channel]:
    """Return the motor speeds [rev/s] from the speed controllers, or else from RPM sensors."""
    fields = [f"esc[{i}].esc_rpm" for i in range(8)]
    by_controller = [
        topic.channel(field) for topic in topics.get("esc_status", []) for field in fields if topic.has(field)
    ]
    by_sensor = [topic.channel(field) for topic in topics.get("rpm", []) for field in RPM_FIELDS if topic.has(field)]
    speeds = by_controller if any(np.any(channel.value != 0) for channel in by_controller) else by_sensor
    return [Channel(speed.t_s, np.abs(speed.value) / 60) for speed in speeds]


def _thermometers(topics: dict[str, list[_Topic]]) -> dict[str, Channel]:
    sources = (
        ("differential_pressure", "temperature"),
        ("airspeed", "air_temperature_celsius"),
        ("vehicle_air_data", "baro_temp_celcius"),
        ("vehicle_air_data", "ambient_temperature"),
        ("sensor_baro", "temperature"),
    )
    thermometers = {}
    for name, field in sources:
        for topic in topics.get(name, []):
            celsius = topic.channel(field)
            if np.any(celsius.value != 0):  # without a thermometer the value is always exactly 0
                thermometers[f"{name} {topic.instance}"] = Channel(celsius.t_s, celsius.value + 273.15)
    return thermometers
