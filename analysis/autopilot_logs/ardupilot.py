"""Reads an ArduPilot dataflash log (.BIN) into the channels of an ordinary flight."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.autopilot_logs import recording
from analysis.autopilot_logs.dataflash import DataflashLog
from analysis.autopilot_logs.recording import (
    Battery,
    Channel,
    FlightRecording,
    channel,
    measuring_battery,
    most_varying,
    turning_motor,
    without_clock_jumps,
)
from flight.errors import InputError

CELSIUS = 273.15
# Messages of one kind: later firmware numbers the instances within one message, earlier firmware has one for each.
AIRSPEED, BATTERY = ("ARSP", "ASP2"), ("BAT", "BAT2", "CURR", "CUR2")
CONTROLLERS, RPM = ("ESC",), ("RPM",)
BAROMETER, IMU, GPS = ("BARO", "BAR2", "BAR3"), ("IMU", "IMU2", "IMU3"), ("GPS", "GPS2")
FIELDS = {
    **dict.fromkeys(AIRSPEED, ("Airspeed", "DiffPress", "Temp")),
    **dict.fromkeys(BATTERY, ("Volt", "Curr")),
    **dict.fromkeys(BAROMETER, ("Press", "Temp")),
    **dict.fromkeys(IMU, ("AccX", "AccY", "AccZ")),
    **dict.fromkeys(CONTROLLERS, ("RPM",)),
    **dict.fromkeys(RPM, ("RPM", "rpm1")),
    **dict.fromkeys(GPS, ("Status", "Spd", "GCrs", "VZ")),
}
INSTANCE = ("I", "Inst", "Instance")
WINGLESS = re.compile(r"Ardu(Copter|Rover|Sub)|APM:(Copter|Rover|Sub)|^(Copter|Rover|Sub|Blimp|AntennaTracker)\b")
KINDS = {"Copter": "a multicopter", "Rover": "a rover or boat", "Sub": "a submarine"}

Table = dict[str, NDArray[np.float64]]  # by field


def read_ardupilot(path: Path) -> FlightRecording:
    """The channels of an ArduPilot log.

    Raises InputError, in one line, when the file cannot be read, and for vehicles without wings.
    """
    tables, parameters = _tables(path)
    channels: dict[str, Channel] = {}
    airspeed = most_varying([_airspeed_pressure(table) for table in _of(tables, AIRSPEED)])
    if airspeed is not None:
        channels[recording.AIRSPEED_PRESSURE] = airspeed
    for name, kinds, field in (
        (recording.STATIC, BAROMETER, "Press"),
        (recording.FORCE_X, IMU, "AccX"),
        (recording.FORCE_Y, IMU, "AccY"),
        (recording.FORCE_Z, IMU, "AccZ"),
    ):
        for table in _of(tables, kinds)[:1]:
            channels[name] = channel(table["t_s"], table[field])
    for table in _of(tables, GPS)[:1]:
        channels |= _gps(table)
    batteries = [
        Battery(f"{kind} {instance}", channel(table["t_s"], table["Volt"]), channel(table["t_s"], table["Curr"]))
        for (kind, instance), table in tables.items()
        if kind in BATTERY
    ]
    battery, notes = measuring_battery(batteries)
    if battery:
        channels |= {recording.VOLTAGE: battery.voltage, recording.CURRENT: battery.current}
    motor, motor_notes = turning_motor(_motors(tables))
    if motor is not None:
        channels[recording.MOTOR] = motor
    thermometers = {
        f"{kind} {instance}": channel(table["t_s"], np.asarray(table["Temp"], dtype=float) + CELSIUS)
        for (kind, instance), table in tables.items()
        if kind in (*AIRSPEED, *BAROMETER)
    }
    if airspeed is not None:
        both, jumps = without_clock_jumps(airspeed, {**channels, **thermometers})
        channels = {name: both[name] for name in channels if name in both}
        thermometers = {name: both[name] for name in thermometers if name in both}
        notes = jumps + notes
    return FlightRecording(path, channels, thermometers, tuple(notes + motor_notes), parameters=parameters)


def _of(tables: dict[tuple[str, int], Table], kinds: tuple[str, ...]) -> list[Table]:
    return [table for (kind, _), table in tables.items() if kind in kinds]


def _motors(tables: dict[tuple[str, int], Table]) -> list[Channel]:
    """Speeds of rotation [rev/s]: by the speed controllers, or by RPM sensors."""
    for kinds in (CONTROLLERS, RPM):
        motors = [channel(table["t_s"], table[name] / 60) for table in _of(tables, kinds) for name in FIELDS[kinds[0]]]
        if any(np.any(one.value > 0) for one in motors):
            return motors
    return []


def _tables(path: Path) -> tuple[dict[tuple[str, int], Table], dict[str, float]]:
    """By kind and instance of message, the times and FIELDS; and the autopilot's parameters."""
    try:
        log = DataflashLog(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    for text in log.columns("MSG").get("Message", ()):
        _refuse_wingless(path, _text(text))
    tables = {key: table for kind in FIELDS for key, table in _instances(kind, log.columns(kind))}
    if not tables:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    settings = log.columns("PARM")
    pairs = zip(settings.get("Name", ()), settings.get("Value", ()), strict=False)
    return tables, {_text(name): float(value) for name, value in pairs}


def _text(packed: bytes) -> str:
    return packed.decode("ascii", "replace")


def _instances(kind: str, columns: dict[str, NDArray[Any]]) -> Iterator[tuple[tuple[str, int], Table]]:
    """The times [s] and FIELDS of each instance of a kind of message."""
    numbers = {name: values for name, values in columns.items() if values.dtype.kind == "f"}
    if "TimeUS" not in numbers or not set(FIELDS[kind]) & set(numbers):
        return
    t_s = numbers["TimeUS"] * 1e-6
    field = next((name for name in INSTANCE if name in numbers), None)
    instance = np.zeros(len(t_s)) if field is None else numbers[field]
    for number in np.unique(instance[np.isfinite(instance)]):
        rows = instance == number
        unknown = np.full(int(rows.sum()), np.nan)
        values = {name: numbers[name][rows] if name in numbers else unknown for name in FIELDS[kind]}
        yield (kind, int(number)), {"t_s": t_s[rows], **values}


def _refuse_wingless(path: Path, text: str) -> None:
    found = WINGLESS.search(text)
    if found:
        kind = KINDS.get(next(group for group in found.groups() if group), "a vehicle without wings")
        raise InputError(f"{path}: the log of {kind}; power required is that of a fixed wing")


def _airspeed_pressure(table: Table) -> Channel:
    """Differential pressure at the density of indicated airspeed. The message's own has not ARSPD_RATIO in it."""
    sign = np.where(np.asarray(table["DiffPress"]) < 0, -1.0, 1.0)
    return channel(table["t_s"], recording.pressure_of_indicated_airspeed(sign * np.asarray(table["Airspeed"])))


def _gps(table: Table) -> dict[str, Channel]:
    status, speed, course, down = (np.asarray(table[field]) for field in FIELDS["GPS"])
    fixed = status >= 3
    t_s, course = np.asarray(table["t_s"])[fixed], np.radians(course[fixed])
    values = (speed[fixed] * np.cos(course), speed[fixed] * np.sin(course), down[fixed])
    return {axis: channel(t_s, value) for axis, value in zip(recording.GPS, values, strict=True)}
