"""Reads a telemetry log of Paparazzi (.data) into the channels of an ordinary flight.

A line has the time of reception in seconds, the number of the aircraft, the name of a message and its fields. Names,
order and units of the fields are from Paparazzi's messages.xml.
"""

import gzip
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.position import fix_of, unix_of_week
from flightpower.analysis.sources.recording import (
    AllChannels,
    Channel,
    Fix,
    FlightRecording,
    channel,
    in_order,
    modes,
    without_jumps,
)
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import pressure_at
from flightpower.flight.errors import InputError
from flightpower.flight.formats import GZIP_MAGIC
from flightpower.flight.units import number_or_nan

Table = Mapping[str, Array]

WEEK = ("week", "week_ms")  # fields that early firmware does not send
# Fields of each message, in order; a list ends before fields that are not used.
FIELDS: dict[str, tuple[str, ...]] = {
    "AIR_DATA": ("static_Pa", "differential_Pa", "temperature_degC", "qnh_hPa", "amsl_m", "airspeed_mps", "tas_mps"),
    "AIRSPEED": ("airspeed_mps", "setpoint_mps"),
    "BARO_RAW": ("static_Pa", "differential_Pa"),
    "ENERGY": ("throttle_percent", "voltage_V", "current_A", "power_W", "charge_Ah", "energy_Wh"),
    "GPS": ("mode", "east_cm", "north_cm", "course_decideg", "height_mm", "speed_cmps", "climb_cmps", *WEEK),
    "IMU_ACCEL": ("x_mps2", "y_mps2", "z_mps2"),
    "IMU_ACCEL_SCALED": ("x_raw", "y_raw", "z_raw"),
    "PPRZ_MODE": ("mode",),
}
MODES = ("MANUAL", "AUTO1", "AUTO2", "HOME", "NOGPS", "FAILSAFE")  # modes of PPRZ_MODE, in the order of their numbers
IMUS = ("IMU_ACCEL", "IMU_ACCEL_SCALED")
NOTE = "The log is telemetry: its times are those of reception, and what the radio lost is missing."
FROM_GPS = "No barometer in the telemetry: static pressure is that of the standard atmosphere at the height by GPS."
TWO_MESSAGES = "Airspeed is that of AIR_DATA and AIRSPEED, which come from one sensor, together."
DISAGREE = "AIRSPEED does not follow the pressure of AIR_DATA, and is not used."


def read_paparazzi(path: Path) -> FlightRecording:
    """Return the channels of a telemetry log.

    Raises InputError, with a one-line message, if the file cannot be read or has more than one aircraft in it.
    """
    tables = _tables(path)
    channels: dict[str, Channel] = {}
    airspeed, notes = _airspeed(tables)
    if airspeed is not None:
        channels[recording.AIRSPEED_PRESSURE] = airspeed
    gps = tables.get("GPS")
    static, static_notes = _static(tables)
    if static is not None:
        channels[recording.STATIC] = static
    if gps is not None:
        channels |= _gps(gps)
    if (energy := tables.get("ENERGY")) is not None:
        channels[recording.VOLTAGE] = channel(energy["t_s"], energy["voltage_V"])
        channels[recording.CURRENT] = channel(energy["t_s"], energy["current_A"])
        channels[recording.THROTTLE] = channel(energy["t_s"], energy["throttle_percent"] / 100)
    for name in IMUS:
        if (imu := tables.get(name)) is not None:
            factor = 1.0 if name == "IMU_ACCEL" else 2.0**-10  # the other message has integers in units of 2^-10 m/s²
            axes = zip((recording.FORCE_X, recording.FORCE_Y, recording.FORCE_Z), FIELDS[name], strict=True)
            channels |= {axis: channel(imu["t_s"], factor * imu[field]) for axis, field in axes}
            break
    thermometers: dict[str, Channel] = {}
    air = tables.get("AIR_DATA")
    if air is not None and np.any(air["temperature_degC"] > -1.0):  # without a thermometer the value is always -1
        thermometers["AIR_DATA"] = channel(air["t_s"], air["temperature_degC"] + 273.15)
    (channels, thermometers, place), jumps = without_jumps(channels, thermometers, {} if gps is None else _place(gps))
    notes = [NOTE, *jumps, *notes, *static_notes]
    flown = tables.get("PPRZ_MODE")
    events = [] if flown is None else modes(flown["t_s"], flown["mode"], dict(enumerate(MODES)))
    return FlightRecording(
        path, channels, thermometers, tuple(notes), by_radio=True, place=place, events=in_order(events),
        fix=Fix() if gps is None else _date(gps),
    )  # fmt: skip


def _lines(path: Path) -> Iterator[list[bytes]]:
    with path.open("rb") as raw:
        packed = raw.read(2) == GZIP_MAGIC
    with gzip.open(path) if packed else path.open("rb") as stream:
        for line in stream:
            yield line.split()


def all_channels(path: Path) -> AllChannels:
    """Return every number of every message, such as GPS.speed_cmps; fields with unknown names by place: DL_VALUE.2.

    Raises InputError if the log cannot be read.
    """
    rows: dict[str, list[list[float]]] = defaultdict(list)
    try:
        for words in _lines(path):
            if len(words) > 3:
                rows[words[2].decode("ascii", "replace")].append(
                    [number_or_nan(word) for word in (words[0], *words[3:])]
                )
    except (OSError, EOFError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    channels: dict[str, Callable[[], Channel]] = {}
    for message, values in sorted(rows.items()):
        table = np.array(list(zip_longest(*values, fillvalue=np.nan)))
        names = FIELDS.get(message, ())
        for i, column in enumerate(table[1:]):
            if np.isfinite(column).any():
                name = names[i] if i < len(names) else i + 1
                channels[f"{message}.{name}"] = partial(channel, table[0], column)
    return channels


def _tables(path: Path) -> dict[str, Table]:
    """Return the messages in FIELDS by name, each with t_s and its fields, (n,). Damaged lines are left out."""
    rows: dict[str, list[list[float]]] = defaultdict(list)
    aircraft: Counter[bytes] = Counter()
    other_length: Counter[str] = Counter()
    try:
        for words in _lines(path):
            name = words[2].decode("ascii", "replace") if len(words) > 3 else ""
            if name not in FIELDS:
                continue
            missing = len(FIELDS[name]) + 3 - len(words)
            if missing > (len(WEEK) if name == "GPS" else 0):
                other_length[name] += 1
                continue
            try:
                row = [float(word) for word in (words[0], *words[3 : 3 + len(FIELDS[name])])] + [np.nan] * missing
            except ValueError:
                other_length[name] += 1
                continue
            aircraft[words[1]] += 1
            rows[name].append(row)
    except (OSError, EOFError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    seen = [number.decode("ascii", "replace") for number, count in aircraft.most_common() if count > 50]
    if len(seen) > 1:
        raise InputError(
            f"{path}: holds the telemetry of {len(seen)} aircraft, {', '.join(seen)}; keep the lines of one, whose"
            " number is the second word of a line"
        )
    for name, count in other_length.items():
        if count > len(rows[name]):
            raise InputError(
                f"{path}: {name} does not have the fields of messages.xml that this program knows"
                f" ({', '.join(FIELDS[name])}); write a CSV file and a map of its columns (flightpower new columns)"
            )
    tables: dict[str, Table] = {}
    for name, lines in rows.items():
        columns = recording.without_damage(lines).T
        tables[name] = dict(zip(("t_s", *FIELDS[name]), columns, strict=True))
    return tables


def _airspeed(tables: Mapping[str, Table]) -> tuple[Channel | None, list[str]]:
    """Return the differential pressure, and notes. Both messages show one sensor, less the autopilot's zero."""
    air, airspeed = tables.get("AIR_DATA"), tables.get("AIRSPEED")
    measured = channel([], []) if air is None else channel(air["t_s"], air["differential_Pa"])
    by_speed = channel([], [])
    if airspeed is not None and np.any(airspeed["airspeed_mps"] > 0):
        by_speed = channel(airspeed["t_s"], recording.pressure_of_indicated_airspeed(airspeed["airspeed_mps"]))
    if not len(measured.t_s) or not np.any(measured.value > 0):
        return (by_speed if len(by_speed.t_s) else None), []
    if not len(by_speed.t_s):
        return measured, []
    flying = by_speed.value > 0  # the log has zero for any negative pressure
    by_pressure = measured.at(by_speed.t_s[flying])
    difference = by_speed.value[flying] - by_pressure
    zero_Pa = float(np.median(difference))
    if np.std(difference) > np.std(by_pressure):
        return measured, [DISAGREE]
    t_s = np.concatenate([measured.t_s, by_speed.t_s[flying]])
    pressure_Pa = np.concatenate([measured.value, by_speed.value[flying] - zero_Pa])
    order = np.argsort(t_s, kind="stable")
    return Channel(t_s[order], pressure_Pa[order]), [TWO_MESSAGES]


def _static(tables: Mapping[str, Table]) -> tuple[Channel | None, list[str]]:
    """Return the static pressure from a barometer, or else from GPS height."""
    for name in ("BARO_RAW", "AIR_DATA"):
        table = tables.get(name)
        if table is not None and np.mean(table["static_Pa"] > 0) > 0.5:
            return channel(table["t_s"], table["static_Pa"]), []
    gps = tables.get("GPS")
    if gps is None:
        return None, []
    has_fix = _has_fix(gps)
    return channel(gps["t_s"][has_fix], pressure_at(1e-3 * gps["height_mm"][has_fix])), [FROM_GPS]


def _gps(gps: Table) -> dict[str, Channel]:
    has_fix = _has_fix(gps)
    t_s, course = gps["t_s"][has_fix], np.radians(gps["course_decideg"][has_fix] / 10)
    speed, down = 1e-2 * gps["speed_cmps"][has_fix], -1e-2 * gps["climb_cmps"][has_fix]
    values = (speed * np.cos(course), speed * np.sin(course), down)
    return {axis: channel(t_s, value) for axis, value in zip(recording.GPS, values, strict=True)}


def _place(gps: Table) -> dict[str, Channel]:
    has_fix = _has_fix(gps)
    if not has_fix.any():
        return {}
    position = (1e-2 * gps[field][has_fix] for field in ("north_cm", "east_cm"))
    return {name: channel(gps["t_s"][has_fix], x - x[0]) for name, x in zip(recording.PLACE, position, strict=True)}


def _date(gps: Table) -> Fix:
    """Return the date alone, because positions are in a map projection."""
    has_fix = _has_fix(gps)
    nowhere = np.full(int(has_fix.sum()), np.nan)
    unix_s = unix_of_week(gps["week"][has_fix], 1e-3 * gps["week_ms"][has_fix])
    return fix_of(gps["t_s"][has_fix], nowhere, nowhere, unix_s=unix_s)


def _has_fix(gps: Table) -> NDArray[np.bool_]:
    complete = np.all([np.isfinite(x) for name, x in gps.items() if name not in WEEK], axis=0)
    return np.asarray(complete & (gps["mode"] >= 3))  # a three-dimensional fix
