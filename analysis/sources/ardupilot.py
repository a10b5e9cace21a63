"""Reads an ArduPilot log into the channels of an ordinary flight: dataflash (.BIN), its text form (.log), or .tlog."""

from collections.abc import Mapping
from enum import IntEnum
from functools import partial
from pathlib import Path

import numpy as np

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot_messages import (
    AIRSPEED,
    BAROMETER,
    BATTERY,
    CONTROLLERS,
    EARLY_WEEK,
    FIELDS,
    GPS,
    GPS_WEEK,
    IMU,
    LIFT,
    RPM,
    SECOND_MONITOR,
    UNIX,
    Messages,
    Table,
    read_messages,
)
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.position import fix_of, places, unix_of_week
from flightpower.analysis.sources.recording import (
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
    without_hover,
    without_jumps,
)
from flightpower.flight.arrays import Array

ENABLED_BY = {
    recording.OF_AIRSPEED: ("ARSPD_TYPE", "ARSPD_USE"),
    recording.OF_BAROMETER: ("BARO_PRIMARY",),
    recording.OF_BATTERY: ("BATT_MONITOR",),
}


class FlightMode(IntEnum):
    """Mode numbers in MODE messages; in modes whose names begin with Q, a QuadPlane flies on its lifting motors."""

    MANUAL = 0
    CIRCLE = 1
    STABILIZE = 2
    TRAINING = 3
    ACRO = 4
    FBWA = 5
    FBWB = 6
    CRUISE = 7
    AUTOTUNE = 8
    AUTO = 10
    RTL = 11
    LOITER = 12
    TAKEOFF = 13
    AVOID_ADSB = 14
    GUIDED = 15
    INITIALISING = 16  # codespell:ignore initialising
    QSTABILIZE = 17
    QHOVER = 18
    QLOITER = 19
    QLAND = 20
    QRTL = 21
    QAUTOTUNE = 22
    QACRO = 23
    THERMAL = 24


LIFTED = tuple(mode for mode in FlightMode if FlightMode.QSTABILIZE <= mode <= FlightMode.QACRO)


class BatteryMonitor(IntEnum):
    """Value of the parameter BATTn_MONITOR."""

    SUM = 10


class ServoFunction(IntEnum):
    """Value of the parameter SERVOn_FUNCTION."""

    THROTTLE = 70


def read_ardupilot(path: Path) -> FlightRecording:
    """Return the channels of an ArduPilot log.

    Raises InputError, with a one-line message, when the file cannot be read, and for vehicles without wings.
    """
    log = read_messages(path)
    tables, parameters, notes = log.tables, log.parameters, log.notes
    channels: dict[str, Channel] = {}
    airspeed, airspeed_notes = _airspeed(tables)
    if airspeed is not None:
        channels[recording.AIRSPEED_PRESSURE] = airspeed
    for name, kinds, field in (
        (recording.STATIC, BAROMETER, "Press"),
        (recording.FORCE_X, IMU, "AccX"),
        (recording.FORCE_Y, IMU, "AccY"),
        (recording.FORCE_Z, IMU, "AccZ"),
    ):
        for table in _working(log.of(kinds))[:1]:
            channels[name] = channel(table["t_s"], table[field])
    place: dict[str, Channel] = {}
    fix = Fix()
    for table in sorted(log.of(GPS), key=lambda receiver: -np.mean(receiver["Status"] >= 3))[:1]:
        channels |= _gps(table)
        fixed = table["Status"] >= 3
        place = places(table["t_s"][fixed], table["Lat"][fixed], table["Lng"][fixed])
        fix = _fix({name: x[fixed] for name, x in table.items()})
    if fix.unix_at_zero_s is None and log.on_unix_time:
        fix = fix._replace(unix_at_zero_s=0.0, by_satellites=False)
    batteries = _with_sums(_batteries(tables, BATTERY), parameters)
    controllers = list(_batteries(tables, CONTROLLERS).values())
    driven, battery_notes, motor_notes = propulsion(batteries, controllers, _motors(log), _throttle(log))
    channels |= driven
    (channels, thermometers, truth, place), jumps = without_jumps(channels, _thermometers(log), _truth(log), place)
    channels, hover_notes = without_hover(channels, partial(_lifting_s, log))
    return FlightRecording(
        path,
        channels,
        thermometers,
        (*jumps, *notes, *airspeed_notes, *battery_notes, *hover_notes, *motor_notes),
        parameters=parameters,
        inside=frozenset(f"{kind} {instance}" for kind, instance in tables if kind in BAROMETER),
        enabled_by={sensor: _as_set(names, parameters) for sensor, names in ENABLED_BY.items()}
        | _without_current(batteries),
        truth=truth,
        vehicle=log.vehicle,
        place=place,
        fix=fix,
        events=in_order([*_modes(log), *(Event(t_s, EventKind.MESSAGE, text) for t_s, text in log.texts)]),
    )


def _batteries(tables: Mapping[tuple[str, int], Table], kinds: tuple[str, ...]) -> dict[tuple[str, int], Battery]:
    return {
        (kind, instance): Battery(
            f"{kind} {instance}", channel(table["t_s"], table["Volt"]), channel(table["t_s"], table["Curr"])
        )
        for (kind, instance), table in tables.items()
        if kind in kinds
    }


def _with_sums(batteries: Mapping[tuple[str, int], Battery], parameters: Mapping[str, float]) -> list[Battery]:
    """Return the battery monitors. BATTn_MONITOR marks a monitor that shows the sum of other monitors: those in
    BATTn_SUM_MASK, or all that follow it."""
    numbers = [instance + (kind in SECOND_MONITOR) for kind, instance in batteries]
    sums = []
    for number, battery in zip(numbers, batteries.values(), strict=True):
        prefix = f"BATT{'' if number == 0 else number + 1}"
        mask = int(np.nan_to_num(parameters.get(f"{prefix}_SUM_MASK", 0.0)))
        chosen = {i for i in range(mask.bit_length()) if mask >> i & 1} if mask else {i for i in numbers if i > number}
        summed = [
            battery.name for i, battery in zip(numbers, batteries.values(), strict=True) if i in chosen - {number}
        ]
        is_sum = parameters.get(f"{prefix}_MONITOR") == BatteryMonitor.SUM
        sums.append(battery._replace(sum_of=frozenset(summed)) if is_sum else battery)
    return sums


def _throttle(log: Messages) -> Channel | None:
    """Return the throttle, 0 to 1, as commanded, or else as the motor's servo channel shows it."""
    for kind in ("CTUN", "AETR"):
        for table in log.of((kind,)):
            for field in FIELDS[kind]:
                if len((throttle := channel(table["t_s"], table[field] / 100)).value):
                    return throttle
    number = next((i for i in range(1, 15) if log.parameters.get(f"SERVO{i}_FUNCTION") == ServoFunction.THROTTLE), 3)
    ends = [log.parameters.get(f"SERVO{number}_{end}", log.parameters.get(f"RC3_{end}")) for end in ("MIN", "MAX")]
    for table in log.of(("RCOU",)):
        for field in (f"C{number}", f"Ch{number}", f"Chan{number}"):
            pulses = channel(table["t_s"], table[field]) if field in table else channel([], [])
            if len(pulses.value) and ends[0] is not None and ends[1] is not None and ends[1] > ends[0]:
                share = (pulses.value - ends[0]) / (ends[1] - ends[0])
                backward = log.parameters.get(f"SERVO{number}_REVERSED", 0.0) == 1
                return Channel(pulses.t_s, 1 - share if backward else share)
    return None


def _lifting_s(log: Messages, t_s: Array) -> list[Array]:
    """Return times with lift-motor throttle above zero, and the times in t_s (n,) in modes that use the lift motors."""
    times = [table["t_s"][table["ThO"] > 0] for table in log.of(LIFT)]
    for table in log.of(("MODE",)):
        numbers = _mode_numbers(table)
        latest = np.searchsorted(table["t_s"], t_s, side="right") - 1
        times.append(t_s[(latest >= 0) & np.isin(numbers[np.clip(latest, 0, None)], LIFTED)])
    return times


def _mode_numbers(table: Table) -> Array:
    return np.where(np.isfinite(table["ModeNum"]), table["ModeNum"], table["Mode"])


def _modes(log: Messages) -> list[Event]:
    names = {int(mode): mode.name for mode in FlightMode}
    return [event for table in log.of(("MODE",))[:1] for event in modes(table["t_s"], _mode_numbers(table), names)]


def _truth(log: Messages) -> dict[str, Channel]:
    """Return the true airspeed and height from ArduPilot's own simulation, where logged."""
    names = (("SIM2", "As", recording.TRUE_AIRSPEED), ("SIM", "Alt", recording.TRUE_HEIGHT))
    return {name: channel(table["t_s"], table[field]) for kind, field, name in names for table in log.of((kind,))[:1]}


def _without_current(batteries: list[Battery]) -> dict[frozenset[str], str]:
    """Describe, for a message, a battery that shows a voltage but no current."""
    with_voltage = [battery for battery in batteries if len(battery.voltage.value)]
    return (
        {recording.OF_BATTERY: f" (it shows {np.median(with_voltage[0].voltage.value):.1f} V and no current)"}
        if with_voltage
        else {}
    )


def _as_set(names: tuple[str, ...], parameters: dict[str, float]) -> str:
    settings_text = [f"{name} is {parameters[name]:g}" for name in names if name in parameters]
    return f" ({', '.join(settings_text) if settings_text else ', '.join(names)})"


def _working(tables: list[Table]) -> list[Table]:
    """Return the instances of one kind of sensor; those that the firmware calls unhealthy come last."""

    def unhealthy(table: Table) -> bool:
        return any(float(np.mean(table[name] == 0)) > 0.5 for name in ("Health", "H") if name in table)

    return sorted(tables, key=unhealthy)


def _airspeed(tables: dict[tuple[str, int], Table]) -> tuple[Channel | None, list[str]]:
    """Return the differential pressure of the sensor that the autopilot used at each time, and notes.

    If it used none, or old firmware does not record which, this is the sensor that varies most.
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
        joined = {name: np.concatenate([table[name] for table in used]) for name in used[0]}
        order = np.argsort(joined["t_s"], kind="stable")
        return _airspeed_pressure({name: x[order] for name, x in joined.items()}), [
            f"Airspeed is that of {' and '.join(names)}, which the autopilot used."
        ]
    if sensors and sum(flown) < READABLE.fewest_samples:
        note = "The autopilot used no airspeed sensor, or called it unhealthy; what it measured is used."
        return most_varying([_airspeed_pressure(table) for table in sensors.values()]), [note]
    return most_varying([_airspeed_pressure(table) for table in used]), []


def _thermometers(log: Messages) -> dict[str, Channel]:
    """Return temperatures [K]. Exactly 0 °C throughout means no thermometer; the user enters BARO_GND_TEMP."""
    channels = {
        f"{kind} {instance}": channel(table["t_s"], np.asarray(table["Temp"], dtype=float) + 273.15)
        for (kind, instance), table in log.tables.items()
        if kind in (*AIRSPEED, *BAROMETER) and np.any(table["Temp"] != 0)
    }
    ground = log.parameters.get("BARO_GND_TEMP", 0.0)
    for table in log.of(BAROMETER)[:1]:
        if ground:
            channels["BARO_GND_TEMP"] = channel(table["t_s"], np.full(len(table["t_s"]), ground + 273.15))
    return channels


def _motors(log: Messages) -> list[Channel]:
    """Return the motor speeds [rev/s] from the speed controllers, or else from RPM sensors."""
    for kinds in (CONTROLLERS, RPM):
        fields = [field for field in FIELDS[kinds[0]] if field.upper().startswith("RPM")]
        motors = [channel(table["t_s"], table[field] / 60) for table in log.of(kinds) for field in fields]
        if any(np.any(motor.value > 0) for motor in motors):
            return motors
    return []


def _airspeed_pressure(table: Table) -> Channel:
    """Return the differential pressure that gives the logged airspeed at sea-level density, with the sign of DiffPress.

    DiffPress itself does not include ARSPD_RATIO.
    """
    sign = np.where(np.asarray(table["DiffPress"]) < 0, -1.0, 1.0)
    return channel(table["t_s"], recording.pressure_of_indicated_airspeed(sign * np.asarray(table["Airspeed"])))


def _fix(table: Table) -> Fix:
    unix_s = table[UNIX]
    for week, milliseconds in (GPS_WEEK, EARLY_WEEK):
        unix_s = np.where(np.isfinite(unix_s), unix_s, unix_of_week(table[week], 1e-3 * table[milliseconds]))
    return fix_of(table["t_s"], table["Lat"], table["Lng"], table["Alt"], unix_s)


def _gps(table: Table) -> dict[str, Channel]:
    status, speed, course, down = (np.asarray(table[field]) for field in ("Status", "Spd", "GCrs", "VZ"))
    fixed = status >= 3
    t_s, course = np.asarray(table["t_s"])[fixed], np.radians(course[fixed])
    values = (speed[fixed] * np.cos(course), speed[fixed] * np.sin(course), down[fixed])
    return {axis: channel(t_s, value) for axis, value in zip(recording.GPS, values, strict=True)}
