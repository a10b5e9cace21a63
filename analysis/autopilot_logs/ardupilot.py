"""Reads an ArduPilot log into the channels of an ordinary flight: dataflash (.BIN), its text (.log), or .tlog."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import zero_Celsius

from analysis.autopilot_logs import recording
from analysis.autopilot_logs.dataflash import DataflashLog
from analysis.autopilot_logs.read import TEXT_MAGIC, is_telemetry
from analysis.autopilot_logs.recording import (
    Battery,
    Channel,
    FlightRecording,
    channel,
    measuring_battery,
    most_varying,
    turning_motor,
    without_clock_jumps,
    without_hover,
)
from analysis.autopilot_logs.settings import READABLE
from analysis.autopilot_logs.telemetry import TelemetryLog
from analysis.autopilot_logs.text_log import TextLog
from flight.errors import InputError

# Messages of one kind: later firmware numbers the instances within one message, earlier firmware has one for each.
AIRSPEED, BATTERY = ("ARSP", "ASP2"), ("BAT", "BAT2", "CURR", "CUR2")
CONTROLLERS, RPM = ("ESC", *(f"ESC{i}" for i in range(1, 9))), ("RPM",)
SIMULATION = ("SIM", "SIM2")
LIFT = ("QTUN",)  # control of a VTOL's lifting motors
BAROMETER, IMU, GPS = ("BARO", "BAR2", "BAR3"), ("IMU", "IMU2", "IMU3"), ("GPS", "GPS2")
FIELDS = {
    **dict.fromkeys(AIRSPEED, ("Airspeed", "DiffPress", "Temp", "U", "H", "Pri")),
    **dict.fromkeys(BATTERY, ("Volt", "Curr")),
    **dict.fromkeys(BAROMETER, ("Press", "Temp", "Health", "H")),
    **dict.fromkeys(IMU, ("AccX", "AccY", "AccZ")),
    **dict.fromkeys(CONTROLLERS, ("RPM",)),
    **dict.fromkeys(RPM, ("RPM", "rpm1")),
    **dict.fromkeys(LIFT, ("ThO",)),
    **dict.fromkeys(GPS, ("Status", "Spd", "GCrs", "VZ")),
}
ENABLED_BY = {
    recording.OF_AIRSPEED: ("ARSPD_TYPE", "ARSPD_USE"),
    recording.OF_BAROMETER: ("BARO_PRIMARY",),
    recording.OF_BATTERY: ("BATT_MONITOR",),
}
# Fields of the time since start, with their units [s]; TimeMS of early GPS messages is that of the week.
CLOCKS = ((("TimeUS", 1e-6), ("TimeMS", 1e-3)), (("TimeUS", 1e-6), ("T", 1e-3)))
INSTANCE = ("I", "Inst", "Instance")
WINGLESS = re.compile(r"Ardu(Copter|Rover|Sub)|APM:(Copter|Rover|Sub)|^(Copter|Rover|Sub|Blimp|AntennaTracker)\b")
KINDS = {"Copter": "a multicopter", "Rover": "a rover or boat", "Sub": "a submarine"}

Table = dict[str, NDArray[np.float64]]  # by field


def read_ardupilot(path: Path) -> FlightRecording:
    """The channels of an ArduPilot log.

    Raises InputError, in one line, when the file cannot be read, and for vehicles without wings.
    """
    tables, parameters, notes = _tables(path)
    channels: dict[str, Channel] = {}
    airspeed, airspeed_notes = _airspeed(tables)
    notes += airspeed_notes
    if airspeed is not None:
        channels[recording.AIRSPEED_PRESSURE] = airspeed
    for name, kinds, field in (
        (recording.STATIC, BAROMETER, "Press"),
        (recording.FORCE_X, IMU, "AccX"),
        (recording.FORCE_Y, IMU, "AccY"),
        (recording.FORCE_Z, IMU, "AccZ"),
    ):
        for table in _working(tables, kinds)[:1]:
            channels[name] = channel(table["t_s"], table[field])
    for table in sorted(_of(tables, GPS), key=lambda one: -np.mean(one["Status"] >= 3))[:1]:
        channels |= _gps(table)
    batteries = [
        Battery(f"{kind} {instance}", channel(table["t_s"], table["Volt"]), channel(table["t_s"], table["Curr"]))
        for (kind, instance), table in tables.items()
        if kind in BATTERY
    ]
    battery, battery_notes = measuring_battery(batteries)
    notes += battery_notes
    if battery:
        channels |= {recording.VOLTAGE: battery.voltage, recording.CURRENT: battery.current}
    motor, motor_notes = turning_motor(_motors(tables))
    if motor is not None:
        channels[recording.MOTOR] = motor
    thermometers = _thermometers(tables, parameters)
    if airspeed is not None:
        both, jumps = without_clock_jumps(airspeed, {**channels, **thermometers})
        channels = {name: both[name] for name in channels if name in both}
        thermometers = {name: both[name] for name in thermometers if name in both}
        notes = jumps + notes
        if recording.AIRSPEED_PRESSURE in channels:
            lifting = [table["t_s"][table["ThO"] > 0] for table in _of(tables, LIFT)]
            wing, hover_notes = without_hover(channels[recording.AIRSPEED_PRESSURE], lifting)
            channels[recording.AIRSPEED_PRESSURE] = wing
            notes += hover_notes
    return FlightRecording(
        path,
        channels,
        thermometers,
        tuple(notes + motor_notes),
        parameters=parameters,
        inside=frozenset(f"{kind} {instance}" for kind, instance in tables if kind in BAROMETER),
        enabled_by={sensor: _as_set(names, parameters) for sensor, names in ENABLED_BY.items()}
        | _without_current(batteries),
    )


def _without_current(batteries: list[Battery]) -> dict[frozenset[str], str]:
    """What a battery shows that gave no current."""
    shown = [one for one in batteries if len(one.voltage.value)]
    return (
        {recording.OF_BATTERY: f" (it shows {np.median(shown[0].voltage.value):.1f} V and no current)"} if shown else {}
    )


def _as_set(names: tuple[str, ...], parameters: dict[str, float]) -> str:
    known = [f"{name} is {parameters[name]:g}" for name in names if name in parameters]
    return f" ({', '.join(known) if known else ', '.join(names)})"


def _of(tables: dict[tuple[str, int], Table], kinds: tuple[str, ...]) -> list[Table]:
    return [table for (kind, _), table in tables.items() if kind in kinds]


def _working(tables: dict[tuple[str, int], Table], kinds: tuple[str, ...]) -> list[Table]:
    """The instances of some kinds, those first that the firmware does not call unhealthy."""

    def unhealthy(table: Table) -> bool:
        return any(float(np.mean(table[name] == 0)) > 0.5 for name in ("Health", "H") if name in table)

    return sorted(_of(tables, kinds), key=unhealthy)


def _airspeed(tables: dict[tuple[str, int], Table]) -> tuple[Channel | None, list[str]]:
    """Differential pressure of the sensor that the autopilot used at each time, and notes; of the one that varies most
    where it used none, or where old firmware does not say.
    """
    sensors = {name: table for name, table in tables.items() if name[0] in AIRSPEED}
    used = []
    for (kind, instance), table in sensors.items():
        number = AIRSPEED.index(kind) + instance
        rows = np.ones(len(table["t_s"]), dtype=bool)
        for name, wanted in (("U", 1), ("H", 1), ("Pri", number)):
            rows &= np.isnan(table[name]) | (table[name] == wanted)
        used.append({name: values[rows] for name, values in table.items()})
    flown = [len(table["t_s"]) for table in used]
    if len(sensors) > 1 and sum(flown) >= READABLE.fewest_samples:
        names = [f"{kind} {number}" for (kind, number), n in zip(sensors, flown, strict=True) if n]
        both = {name: np.concatenate([table[name] for table in used]) for name in used[0]}
        order = np.argsort(both["t_s"], kind="stable")
        return _airspeed_pressure({name: x[order] for name, x in both.items()}), [
            f"Airspeed is that of {' and '.join(names)}, which the autopilot used."
        ]
    if sensors and sum(flown) < READABLE.fewest_samples:
        note = "The autopilot used no airspeed sensor, or called it unhealthy; what it measured is used."
        return most_varying([_airspeed_pressure(table) for table in sensors.values()]), [note]
    return most_varying([_airspeed_pressure(table) for table in used]), []


def _thermometers(tables: dict[tuple[str, int], Table], parameters: dict[str, float]) -> dict[str, Channel]:
    """Exactly 0 °C throughout is what firmware writes without a thermometer. BARO_GND_TEMP is what the user said."""
    shown = {
        f"{kind} {instance}": channel(table["t_s"], np.asarray(table["Temp"], dtype=float) + zero_Celsius)
        for (kind, instance), table in tables.items()
        if kind in (*AIRSPEED, *BAROMETER) and np.any(table["Temp"] != 0)
    }
    ground = parameters.get("BARO_GND_TEMP", 0.0)
    for table in _of(tables, BAROMETER)[:1]:
        if ground:
            shown["BARO_GND_TEMP"] = channel(table["t_s"], np.full(len(table["t_s"]), ground + zero_Celsius))
    return shown


def _motors(tables: dict[tuple[str, int], Table]) -> list[Channel]:
    """Speeds of rotation [rev/s]: by the speed controllers, or by RPM sensors."""
    for kinds in (CONTROLLERS, RPM):
        motors = [channel(table["t_s"], table[name] / 60) for table in _of(tables, kinds) for name in FIELDS[kinds[0]]]
        if any(np.any(one.value > 0) for one in motors):
            return motors
    return []


def _messages(path: Path) -> DataflashLog | TelemetryLog | TextLog:
    """By the first bytes of the file. Raises InputError where it cannot be read."""
    try:
        data = path.read_bytes()
        if data.startswith(TEXT_MAGIC):
            return TextLog(path, (*FIELDS, *SIMULATION, "MSG", "PARM", "DSF"))
        return TelemetryLog(data) if is_telemetry(data[:9]) else DataflashLog(data)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read as an ArduPilot log ({error})") from None


def _tables(path: Path) -> tuple[dict[tuple[str, int], Table], dict[str, float], list[str]]:
    """By kind and instance of message, the times and FIELDS; the autopilot's parameters; and notes."""
    log = _messages(path)
    for text in log.columns("MSG").get("Message", ()):
        _refuse_wingless(path, _text(text))
    tables = {key: table for kind in FIELDS for key, table in _instances(kind, log.columns(kind))}
    for (kind, _), table in tables.items():
        for name in log.whole_numbers(kind) & {"Volt", "Curr"}:  # firmware before 2015: in hundredths
            table[name] = 0.01 * table[name]
    if not tables:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    settings = log.columns("PARM")
    pairs = zip(settings.get("Name", ()), settings.get("Value", ()), strict=False)
    dropped = log.columns("DSF").get("Dp", np.zeros(1))
    lost = int(np.nanmax(np.asarray(dropped, dtype=float))) if len(dropped) else 0
    notes = [*log.notes, *([f"The autopilot dropped {lost} messages."] if lost else [])]
    if any(len(log.columns(name).get("TimeUS", ())) for name in SIMULATION):
        notes.append("The flight is a simulation by ArduPilot; the truth in its SIM messages is not used.")
    return tables, {_text(name): float(value) for name, value in pairs}, notes


def _text(packed: bytes) -> str:
    return packed.decode("ascii", "replace")


def _instances(kind: str, columns: dict[str, NDArray[Any]]) -> Iterator[tuple[tuple[str, int], Table]]:
    """The times [s] and FIELDS of each instance of a kind of message."""
    numbers = {name: values for name, values in columns.items() if values.dtype.kind == "f"}
    clock = next(((name, unit) for name, unit in CLOCKS[kind == "GPS"] if name in numbers), None)
    if clock is None or not set(FIELDS[kind]) & set(numbers):
        return
    t_s = numbers[clock[0]] * clock[1]
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
