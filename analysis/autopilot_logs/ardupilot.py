"""Reads an ArduPilot dataflash log (.BIN) into the channels of an ordinary flight."""

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink import DFReader

from analysis.autopilot_logs import recording
from analysis.autopilot_logs.instances import Battery, measuring_battery, most_varying
from analysis.autopilot_logs.recording import Channel, FlightRecording, channel, without_clock_jumps
from flight.errors import InputError

CELSIUS = 273.15
# Messages of one kind: later firmware numbers the instances within one message, earlier firmware has one for each.
AIRSPEED, BATTERY = ("ARSP", "ASP2"), ("BAT", "BAT2", "CURR", "CUR2")
BAROMETER, IMU, GPS = ("BARO", "BAR2", "BAR3"), ("IMU", "IMU2", "IMU3"), ("GPS", "GPS2")
FIELDS = {
    **dict.fromkeys(AIRSPEED, ("Airspeed", "DiffPress", "Temp")),
    **dict.fromkeys(BATTERY, ("Volt", "Curr")),
    **dict.fromkeys(BAROMETER, ("Press", "Temp")),
    **dict.fromkeys(IMU, ("AccZ",)),
    **dict.fromkeys(GPS, ("Status", "Spd", "GCrs", "VZ")),
}
INSTANCE = ("I", "Inst", "Instance")
WINGLESS = re.compile(r"Ardu(Copter|Rover|Sub)|APM:(Copter|Rover|Sub)|^(Copter|Rover|Sub|Blimp|AntennaTracker)\b")
KINDS = {"Copter": "a multicopter", "Rover": "a rover or boat", "Sub": "a submarine"}

Table = dict[str, Any]  # by field, a list of values


def read_ardupilot(path: Path) -> FlightRecording:
    """The channels of an ArduPilot log.

    Raises InputError, in one line, when the file cannot be read, and for vehicles without wings.
    """
    tables = _tables(path)
    channels: dict[str, Channel] = {}
    airspeed = most_varying([_airspeed_pressure(table) for table in _of(tables, AIRSPEED)])
    if airspeed is not None:
        channels[recording.AIRSPEED_PRESSURE] = airspeed
    for name, kinds, field in ((recording.STATIC, BAROMETER, "Press"), (recording.FORCE_Z, IMU, "AccZ")):
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
    return FlightRecording(path, channels, thermometers, tuple(notes))


def _of(tables: dict[tuple[str, int], Table], kinds: tuple[str, ...]) -> list[Table]:
    return [table for (kind, _), table in tables.items() if kind in kinds]


def _tables(path: Path) -> dict[tuple[str, int], Table]:
    """By kind and instance of message, the times and FIELDS."""
    tables: dict[tuple[str, int], Table] = {}
    try:
        with (
            contextlib.ExitStack() as files,
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
        ):
            reader = DFReader.DFReader_binary(str(path))
            files.callback(reader.filehandle.close)
            while (message := reader.recv_match(type=[*FIELDS, "MSG"])) is not None:
                kind = message.get_type()
                if kind == "MSG":
                    _refuse_wingless(path, str(getattr(message, "Message", "")))
                else:
                    _append(tables, kind, message)
    except InputError:
        raise
    except Exception as error:  # a torn or altered file raises whatever its bytes lead to
        line = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: cannot be read as an ArduPilot log ({type(error).__name__}: {line})") from None
    if not tables:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    return tables


def _append(tables: dict[tuple[str, int], Table], kind: str, message: Any) -> None:
    fields = FIELDS[kind]
    time_us = getattr(message, "TimeUS", None)
    values = [getattr(message, field, None) for field in fields]
    if not isinstance(time_us, int) or values[0] is None:
        return
    instance = next((int(getattr(message, name)) for name in INSTANCE if hasattr(message, name)), 0)
    table = tables.setdefault((kind, instance), {name: [] for name in ("t_s", *fields)})
    table["t_s"].append(time_us * 1e-6)
    for field, value in zip(fields, values, strict=True):
        table[field].append(float(value) if isinstance(value, int | float) else float("nan"))


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
