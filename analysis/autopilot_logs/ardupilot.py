"""Reads an ArduPilot dataflash log (.BIN) into the channels of an ordinary flight."""

import contextlib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink import DFReader

from analysis.autopilot_logs import recording
from analysis.autopilot_logs.instances import Battery, measuring_battery, most_varying, turning_motor
from analysis.autopilot_logs.recording import Channel, FlightRecording, channel, without_clock_jumps
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
    **dict.fromkeys(IMU, ("AccZ",)),
    **dict.fromkeys(CONTROLLERS, ("RPM",)),
    **dict.fromkeys(RPM, ("RPM", "rpm1")),
    **dict.fromkeys(GPS, ("Status", "Spd", "GCrs", "VZ")),
}
INSTANCE = ("I", "Inst", "Instance")
WINGLESS = re.compile(r"Ardu(Copter|Rover|Sub)|APM:(Copter|Rover|Sub)|^(Copter|Rover|Sub|Blimp|AntennaTracker)\b")
KINDS = {"Copter": "a multicopter", "Rover": "a rover or boat", "Sub": "a submarine"}

# Codes of packed fields, as NumPy types. Those of cCeE are in hundredths.
PACKED = {"a": "(32,)<i2", "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4",
          "d": "<f8", "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4",
          "L": "<i4", "q": "<i8", "Q": "<u8"}  # fmt: skip
HEADER_BYTES, HUNDREDTH = 3, 0.01

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
        with contextlib.ExitStack() as files:
            files.enter_context(_silence())
            reader = DFReader.DFReader_binary(str(path))
            files.callback(reader.filehandle.close)
            while (message := reader.recv_match(type="MSG")) is not None:
                _refuse_wingless(path, str(getattr(message, "Message", "")))
            reader.rewind()
            parameters: dict[str, float] = {}
            while (message := reader.recv_match(type="PARM")) is not None:
                parameters[str(getattr(message, "Name", ""))] = float(getattr(message, "Value", np.nan))
            data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
            rows = {one.name: _rows(data, reader.offsets[number], one) for number, one in reader.formats.items()}
    except InputError:
        raise
    except Exception as error:  # a torn or altered file raises whatever its bytes lead to
        line = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: cannot be read as an ArduPilot log ({type(error).__name__}: {line})") from None
    tables = {key: table for kind in FIELDS for key, table in _instances(kind, rows.get(kind))}
    if not tables:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    return tables, parameters


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Nothing is printed: the reader prints a line for each damaged byte, part of it from C."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        with Path(os.devnull).open("w") as text, contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
            yield
    finally:
        for number, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)
        os.close(nowhere)


def _rows(data: NDArray[np.uint8], offsets: Sequence[int], kind: Any) -> NDArray[np.void] | None:
    """All messages of one kind (n,), as they are packed; None where it is none of FIELDS or has unknown fields."""
    if kind.name not in FIELDS or len(kind.columns) != len(kind.format) or not set(kind.format) <= set(PACKED):
        return None
    names = {f"{i} {name}": name for i, name in enumerate(kind.columns)}  # damaged formats repeat names
    dtype = np.dtype([(key, PACKED[code]) for key, code in zip(names, kind.format, strict=True)])
    starts = np.asarray(offsets, dtype=np.int64) + HEADER_BYTES
    starts = starts[starts + dtype.itemsize <= len(data)]
    packed = data[starts[:, None] + np.arange(dtype.itemsize)]
    rows = np.ascontiguousarray(packed).view(dtype).reshape(-1)
    scaled = {name: HUNDREDTH if code in "cCeE" else 1.0 for name, code in zip(kind.columns, kind.format, strict=True)}
    wanted = [old for old, name in names.items() if name in ("TimeUS", *INSTANCE, *FIELDS[kind.name])]
    out = np.zeros(len(rows), dtype=[(names[old], np.float64) for old in dict.fromkeys(wanted)])
    for old in wanted:
        if rows[old].ndim == 1 and rows[old].dtype.kind in "iuf":
            out[names[old]] = rows[old] * scaled[names[old]]
    return out


def _instances(kind: str, rows: NDArray[np.void] | None) -> Iterator[tuple[tuple[str, int], Table]]:
    """The times [s] and FIELDS of each instance of a kind of message."""
    names = () if rows is None else rows.dtype.names or ()
    if rows is None or "TimeUS" not in names or not set(FIELDS[kind]) & set(names):
        return
    field = next((name for name in INSTANCE if name in names), None)
    instance = np.zeros(len(rows)) if field is None else rows[field]
    for number in np.unique(instance[np.isfinite(instance)]):
        one = rows[instance == number]
        unknown = np.full(len(one), np.nan)
        values = {name: one[name] if name in names else unknown for name in FIELDS[kind]}
        yield (kind, int(number)), {"t_s": one["TimeUS"] * 1e-6, **values}


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
