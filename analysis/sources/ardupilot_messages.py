"""Reads the messages that an analysis needs from an ArduPilot log, by kind and instance, in SI or the fields' units."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources.dataflash import DataflashLog, Form
from flightpower.analysis.sources.matlab_log import MatlabLog
from flightpower.analysis.sources.recording import AllChannels, Channel, channel, vehicle_of, without_damage
from flightpower.analysis.sources.unpacked import unpacked
from flightpower.flight.errors import InputError
from flightpower.flight.formats import Format, format_of

if TYPE_CHECKING:  # both load pymavlink, which takes a third of a second and is not needed for dataflash logs
    from flightpower.analysis.sources.telemetry import RawTelemetryLog, TelemetryLog
    from flightpower.analysis.sources.text_log import TextLog

# Message types for one kind of sensor: later firmware numbers the instances within one message type, earlier firmware
# has one type per instance.
AIRSPEED, BATTERY = ("ARSP", "ASP2"), ("BAT", "BAT2", "CURR", "CUR2")
SECOND_MONITOR = ("BAT2", "CUR2")
CONTROLLERS, RPM = ("ESC", *(f"ESC{i}" for i in "12345678")), ("RPM",)
SIMULATION = ("SIM", "SIM2")
LIFT = ("QTUN",)  # messages on the control of a VTOL's lifting motors
# Fields for the GPS week and the milliseconds within it, in today's and early firmware; for Unix time [s] in telemetry.
GPS_WEEK, EARLY_WEEK, UNIX = ("GWk", "GMS"), ("Week", "TimeMS"), "Unix"
BAROMETER, IMU, GPS = ("BARO", "BAR2", "BAR3"), ("IMU", "IMU2", "IMU3"), ("GPS", "GPS2")
# The fields that are read from each message type; an empty list means all.
FIELDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(AIRSPEED, ("Airspeed", "DiffPress", "Temp", "U", "H", "Pri")),
    **dict.fromkeys(BATTERY, ("Volt", "Curr")),
    **dict.fromkeys(BAROMETER, ("Press", "Temp", "Health", "H")),
    **dict.fromkeys(IMU, ("AccX", "AccY", "AccZ")),
    **dict.fromkeys(CONTROLLERS, ("RPM", "Volt", "Curr")),
    **dict.fromkeys(RPM, ("RPM", "rpm1")),
    **dict.fromkeys(LIFT, ("ThO",)),
    **dict.fromkeys(GPS, ("Status", "Spd", "GCrs", "VZ", "Lat", "Lng", "Alt", *GPS_WEEK, *EARLY_WEEK, UNIX)),
    "CTUN": ("ThO", "ThrOut"),
    "AETR": ("Thr",),
    "RCOU": (),
    "MODE": ("ModeNum", "Mode"),
    "SIM": ("Alt",),
    "SIM2": ("As",),
}
# Fields with the time since the start, and their units [s]. In early GPS messages TimeMS is the time of the week.
CLOCKS = ((("TimeUS", 1e-6), ("TimeMS", 1e-3)), (("TimeUS", 1e-6), ("T", 1e-3)))
INSTANCE = ("I", "Inst", "Instance", "C")
KINDS_READ = (*FIELDS, "MSG", "PARM", "DSF", "FMTU", "MULT", "VER", "TECS")
WINGED = re.compile(r"Ardu ?Plane|APM:Plane|^Plane\b")
# Prefixes of controller parameters that only ArduPlane logs. Its energy controller also logs TECS messages.
OF_PLANES = ("TECS_", "RLL2SRV_", "PTCH2SRV_", "RLL_RATE_", "PTCH_RATE_")
WINGLESS = re.compile(r"Ardu(Copter|Rover|Sub)|APM:(Copter|Rover|Sub)|^(Copter|Rover|Sub|Blimp|AntennaTracker)\b")
# Name of the board and the 96-bit serial number of its processor: "CubeOrange 0041002B 3038511A 32383232".
SERIAL_NUMBER = re.compile(r"^\S+ ([0-9A-F]{8} [0-9A-F]{8} [0-9A-F]{8})\s*$")
KINDS = {"Copter": "a multicopter", "Rover": "a rover or boat", "Sub": "a submarine"}

Table = dict[str, NDArray[np.float64]]  # columns by field


@dataclass(frozen=True)
class Messages:
    """tables : by kind and instance, t_s and FIELDS, each (n,)          parameters : the autopilot's, by name
    notes : on the log, in sentences          vehicle : from `recording.vehicle_of`; empty where it is not known
    texts : times [s], NaN where the log has none, and texts for the pilot
    on_unix_time : whether times are from a ground station's clock
    """

    tables: dict[tuple[str, int], Table]
    parameters: dict[str, float]
    notes: list[str]
    vehicle: str = ""
    texts: tuple[tuple[float, str], ...] = ()
    on_unix_time: bool = False

    def of(self, kinds: tuple[str, ...]) -> list[Table]:
        return [table for (kind, _), table in self.tables.items() if kind in kinds]


def all_channels(path: Path) -> AllChannels:
    """Return every field of every message: `BARO.Alt`, for later instances `BARO 1.Alt`, for telemetry MAVLink's names.

    Raises InputError where the log cannot be read.
    """
    log = _read(path, _raw_telemetry, ())
    channels: dict[str, Callable[[], Channel]] = {}
    for kind in log.names():
        for (_, number), table in _instances(kind, log.columns(kind), ()):
            name = f"{kind} {number}" if number else kind
            channels |= {
                f"{name}.{field}": partial(channel, table["t_s"], table[field]) for field in table if field != "t_s"
            }
    return channels


Telemetry = TypeVar("Telemetry")


def _telemetry(data: bytes) -> "TelemetryLog":
    from flightpower.analysis.sources.telemetry import TelemetryLog

    return TelemetryLog(data)


def _raw_telemetry(data: bytes) -> "RawTelemetryLog":
    from flightpower.analysis.sources.telemetry import RawTelemetryLog

    return RawTelemetryLog(data)


def _read(
    path: Path, telemetry: Callable[[bytes], Telemetry], kinds: tuple[str, ...]
) -> "Telemetry | DataflashLog | TextLog | MatlabLog":
    """telemetry : reads a .tlog     kinds : message types to read from a text or .mat file; empty means all

    Raises InputError where the file cannot be read.
    """
    form = format_of(path)
    try:
        with unpacked(path) as plain:
            match form:
                case Format.DATAFLASH_TEXT:
                    from flightpower.analysis.sources.text_log import TextLog

                    return TextLog(plain, kinds)
                case Format.TELEMETRY:
                    return telemetry(plain.read_bytes())
                case Format.MAT:
                    return MatlabLog(plain, kinds)
                case _:
                    return DataflashLog(plain if plain == path else plain.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read as an ArduPilot log ({error})") from None


def read_messages(path: Path) -> Messages:
    """Return the messages of a log. Raises InputError if it cannot be read or is from a vehicle without wings."""
    log = _read(path, _telemetry, KINDS_READ)
    messages = log.columns("MSG")
    texts = [_text(text) for text in messages.get("Message", ())]
    versions = [_text(text) for text in log.columns("VER").get("FWS", ())]
    for text in (*texts, *versions):
        _refuse_wingless(path, text)
    boards = (match[1] for text in texts if (match := SERIAL_NUMBER.match(text)))
    vehicle = next((vehicle_of(number) for number in boards), "")
    tables = {key: table for kind in FIELDS for key, table in _instances(kind, _columns(log, kind), FIELDS[kind])}
    units, multipliers = log.columns("FMTU"), log.columns("MULT")
    for (kind, _), table in tables.items():
        for field, unit in _units(log.form(kind), units, multipliers).items():
            if field in table:
                table[field] = unit * table[field]
    if not tables:
        raise InputError(f"{path}: holds no message of airspeed, battery or barometer; is the log complete?")
    settings = log.columns("PARM")
    names = [_text(name) for name in settings.get("Name", ())]
    if not any(map(WINGED.search, (*texts, *versions))) and not any(name.startswith(OF_PLANES) for name in names):
        _refuse_unknown(path, log.columns("TECS"))
    pairs = zip(names, settings.get("Value", ()), strict=False)
    dropped = log.columns("DSF").get("Dp", np.zeros(1))
    finite = dropped[np.isfinite(dropped)] if dropped.dtype.kind == "f" else np.zeros(0)
    lost = int(np.max(finite, initial=0.0))
    notes = [*log.notes, *([f"The autopilot dropped {lost} message{'s' * (lost != 1)}."] if lost else [])]
    parameters = {_text(name): float(x) for name, x in pairs if isinstance(x, float)}
    timed = tuple(zip(_times_s("MSG", messages, len(texts)), texts, strict=True))
    return Messages(tables, parameters, notes, vehicle, timed, format_of(path) is Format.TELEMETRY)


def _columns(log: "DataflashLog | TelemetryLog | TextLog | MatlabLog", kind: str) -> dict[str, NDArray[Any]]:
    """Return the columns of a message type; from a dataflash log, only those that are needed."""
    if not isinstance(log, DataflashLog) or not FIELDS[kind]:
        return log.columns(kind)
    clocks = (name for clocks in CLOCKS for name, _ in clocks)
    return log.columns(kind, {*FIELDS[kind], *INSTANCE, *clocks})


def _units(form: Form | None, units: dict[str, NDArray[Any]], multipliers: dict[str, NDArray[Any]]) -> dict[str, float]:
    """Return the factor to SI units for each unscaled integer field, from FMTU and MULT.

    Firmware before 2015 writes no FMTU; its voltages and currents are in hundredths.
    """
    if form is None:
        return {}
    if not len(units.get("FmtType", ())):
        return {field: 0.01 for field in form.whole_numbers() if field in ("Volt", "Curr")}
    pairs = zip(units["FmtType"], units.get("MultIds", ()), strict=False)
    of_form = [ids for number, ids in pairs if number == form.number and isinstance(ids, bytes)]
    ids, factors = (multipliers.get(name, np.zeros(0)) for name in ("Id", "Mult"))
    usable = without_damage(factors) if factors.dtype.kind == "f" else np.zeros(0)
    by_id = dict(zip(ids.tolist(), usable.tolist(), strict=False))
    told_factors = [by_id.get(identity, 0.0) for identity in (of_form[-1] if of_form else b"")]
    nonzero = {field: x for field, x in zip(form.fields, told_factors, strict=False) if x != 0 and np.isfinite(x)}
    return {field: nonzero[field] for field in form.whole_numbers() if field in nonzero}


def _text(packed: Any) -> str:
    """Return a text; if the definition of the message is damaged, `packed` may be anything."""
    return packed.decode("ascii", "replace") if isinstance(packed, bytes) else str(packed)


def _clock(kind: str, columns: Mapping[str, NDArray[Any]]) -> tuple[str, float] | None:
    """Return the time field of a kind of message, and its unit [s]."""
    return next(((name, unit) for name, unit in CLOCKS[kind == "GPS"] if name in columns), None)


def _times_s(kind: str, columns: Mapping[str, NDArray[Any]], count: int) -> list[float]:
    clock = _clock(kind, columns)
    if clock is None or columns[clock[0]].dtype.kind != "f":
        return [np.nan] * count
    return [float(t) for t in columns[clock[0]] * clock[1]]


def _instances(
    kind: str, columns: dict[str, NDArray[Any]], fields: tuple[str, ...]
) -> Iterator[tuple[tuple[str, int], Table]]:
    """Yield the times [s] and fields of each instance of a message type; an empty list of fields means all."""
    numbers = {name: without_damage(values) for name, values in columns.items() if values.dtype.kind == "f"}
    clock = _clock(kind, numbers)
    fields = fields or tuple(numbers)
    if clock is None or not set(fields) & set(numbers):
        return
    t_s = numbers[clock[0]] * clock[1]
    field = next((name for name in INSTANCE if name in numbers and _are_instances(numbers[name])), None)
    instance = np.zeros(len(t_s)) if field is None else numbers[field]
    for number in np.unique(instance[np.isfinite(instance)]):
        rows = instance == number
        unknown = np.full(int(rows.sum()), np.nan)
        values = {name: numbers[name][rows] if name in numbers else unknown for name in fields}
        yield (kind, int(number)), {"t_s": t_s[rows], **values}


def _are_instances(numbers: NDArray[np.float64]) -> bool:
    """Return whether these values are instance numbers, of which a few may be damaged.

    The field name I is also used for the integral term of a controller.
    """
    finite = numbers[np.isfinite(numbers)]
    return bool(np.mean((finite == np.round(finite)) & (finite >= 0) & (finite < 256)) > 0.5) if len(finite) else True


def _refuse_unknown(path: Path, energy_control: dict[str, NDArray[Any]]) -> None:
    """Raises InputError if there are no messages of a plane's energy controller."""
    if not energy_control:
        raise InputError(
            f"{path}: the log does not say which vehicle wrote it (no readable text of its firmware, no parameter of"
            " ArduPlane alone), and a multicopter's log cannot give the power of a fixed wing: give"
            " the complete log as the autopilot wrote it (.BIN)"
        )


def _refuse_wingless(path: Path, text: str) -> None:
    match = WINGLESS.search(text)
    if match:
        kind = KINDS.get(next(group for group in match.groups() if group), "a vehicle without wings")
        raise InputError(f"{path}: the log of {kind}; power required is computed for fixed wings only")
