"""Turns a table with a column map into a log of the daemon, so that every method that its sensors allow works on it.

A vane's angle becomes the pressure of an ideal probe, airspeed a dynamic pressure, and height a static pressure. Thrust
becomes the speed of a propeller whose table gives that thrust at every advance ratio.
"""

import json
from array import array
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from flightpower.analysis.sources.check_settings import STRUCTURE
from flightpower.analysis.sources.column_map import DRAFT, Channels, ColumnMap, map_files, map_of, mapped_channels
from flightpower.analysis.sources.daemon_log import gives_electrical_power
from flightpower.analysis.sources.laws import Finding, findings, height_is_checked
from flightpower.analysis.sources.map_draft import map_without_question
from flightpower.analysis.sources.position import velocity_by_position
from flightpower.analysis.sources.quantities import KINDS, Quantity
from flightpower.analysis.sources.recording import Channel, pressure_of_indicated_airspeed
from flightpower.analysis.sources.resolution import without_steps
from flightpower.analysis.sources.table_file import read_columns
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, height_at, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import STATUS_CODE, Entries
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TOPICS_FOR_DRAG, TYPE_OF_TOPIC, Status
from flightpower.flight.probe_maps import ALPHA_PORT_SLOPE

Q = Quantity
IMU = {
    "specific_force_x_mps2": Q.FORCE_FORWARD, "specific_force_y_mps2": Q.FORCE_RIGHT,
    "specific_force_z_mps2": Q.FORCE_DOWN, "angular_rate_x_radps": Q.ROLL_RATE, "angular_rate_y_radps": Q.PITCH_RATE,
    "angular_rate_z_radps": Q.YAW_RATE,
}  # fmt: skip
ATTITUDE = {"roll_rad": Q.ROLL, "pitch_rad": Q.PITCH, "yaw_rad": Q.HEADING}
GPS = {
    "velocity_north_mps": Q.VELOCITY_NORTH,
    "velocity_east_mps": Q.VELOCITY_EAST,
    "velocity_down_mps": Q.VELOCITY_DOWN,
}
# Turns thrust into motor speed: the diameter is one meter, the thrust coefficient one at every advance ratio.
THRUST_AS_SPEED = """# diameter_m = 1.0
rpm,J,cT,cP
100,0,1,1
100,1000,1,1
20000,0,1,1
20000,1000,1,1
"""
STATES_OF_AIR = (Q.HEIGHT, Q.STATIC_PRESSURE, Q.AIR_TEMPERATURE)
Fields = dict[str, Channel]
TABLE = "table"  # name of the metadata of a log that was a table


def log_of_table(path: Path, map_file: Path | None = None) -> Log:
    """Return a table as a log, by the map from the option or next to the table, or by a known program's column names.

    Raises InputError, with a one-line message, if the map is missing or wrong, or its quantities contradict each other.
    """
    columns = read_columns(path)
    if not map_files(path, map_file) and (prepared := map_without_question(path, columns)) is not None:
        column_map, recorder = prepared
        log = as_log(path, mapped_channels(path, columns, column_map))
        used = ", ".join(f"{column.column} as {quantity}" for quantity, column in column_map.columns.items())
        log.metadata[TABLE] = {"note": f"Columns are known by the names of {recorder}: {used}."}
        return log
    column_map = map_of(path, map_file)
    channels = mapped_channels(path, columns, column_map)
    if wrong := findings(channels, column_map.named):
        raise contradiction(path, wrong, column_map)
    log = as_log(path, channels)
    log.metadata[TABLE] = unchecked_units(channels, column_map)
    return log


def unchecked_units(channels: Channels, column_map: ColumnMap) -> dict[str, str]:
    """Return sentences, by quantity, on units that nothing in the table can check."""
    notes = {}
    for quantity, checked in ((Q.HEIGHT, height_is_checked(channels)), (Q.AIR_TEMPERATURE, False)):
        if quantity in channels and not checked:
            unit = column_map.columns[quantity].unit
            notes[str(quantity)] = (
                f"The unit of {column_map.named(quantity)} is not checked: nothing in the table shows whether it is"
                f" {unit}."
            )
    return notes


def refuse_without_method(log: Log) -> None:
    """Raises InputError for a table from which no method can give a curve; the message names what its map lacks."""
    if gives_electrical_power(log) or all(map(log.entries.get, TOPICS_FOR_DRAG)):
        return
    missing = []
    if not log.entries.get("/static"):
        missing.append(f"[{Q.HEIGHT}] or [{Q.STATIC_PRESSURE}]")
    if not log.entries.get("/battery"):
        missing.append(f"[{Q.VOLTAGE}] with [{Q.CURRENT}], or [{Q.POWER}]")
    raise InputError(
        f"{log.path}: the map of its columns lacks {'; '.join(missing)}, which a curve needs: add the columns that"
        f" have it ({DRAFT} {log.path} lists those that are not used)"
    )


def contradiction(path: Path, wrong: list[Finding], column_map: ColumnMap) -> InputError:
    """Return an InputError with the first contradiction and the number of others."""
    more = f" ({len(wrong) - 1} more contradictions)" if len(wrong) > 1 else ""
    return InputError(f"{path}: {wrong[0].text}{more} ({column_map.path})")


def as_log(path: Path, channels: Channels) -> Log:
    """Build a log from quantities in SI units. Raises InputError if neither airspeed nor ground velocity is known."""
    averaged = {quantity: _averaged(_possible(quantity, channel)) for quantity, channel in channels.items()}
    topics: dict[str, Fields] = {}
    attachments = {"zero.json": _zeros()}
    pressure = _static(averaged)
    temperature = averaged.get(Q.AIR_TEMPERATURE)
    if pressure is not None:
        topics["/static"] = {"pressure_Pa": pressure}
        if temperature is None and Q.ANGLE_OF_ATTACK in averaged:  # the drag methods need a temperature
            temperature = Channel(pressure.t_s, np.asarray(temperature_at(_height(pressure.value))))
        if temperature is not None:
            topics["/static"] |= {"temperature_K": temperature}
    q = _dynamic_pressure(averaged, pressure)
    if q is not None:
        topics["/probe/airspeed"] = {"differential_pressure_Pa": q}
        for topic, angle in (("/probe/alpha", Q.ANGLE_OF_ATTACK), ("/probe/beta", Q.SIDESLIP)):
            if (channel := averaged.get(angle)) is not None:
                value = ALPHA_PORT_SLOPE * channel.value * q.at(channel.t_s)
                topics[topic] = {"differential_pressure_Pa": Channel(channel.t_s, value)}
                attachments["probe.json"] = _vane_as_probe()
    for topic, quantities in (("/imu", IMU), ("/attitude", ATTITUDE), ("/gps", GPS)):
        topics[topic] = {field: averaged[quantity] for field, quantity in quantities.items() if quantity in averaged}
    if not {Q.VELOCITY_NORTH, Q.VELOCITY_EAST} & averaged.keys():
        if Q.GROUND_SPEED in averaged and Q.COURSE in averaged:
            topics["/gps"] |= _by_course(averaged[Q.GROUND_SPEED], averaged[Q.COURSE])
        # Velocities from positions are means over some seconds, with dependent errors. They suffice for wind and
        # electrical power, but not for the trajectory of the drag methods.
        elif {Q.LATITUDE, Q.LONGITUDE} <= averaged.keys() and "/probe/alpha" not in topics:
            north, east = velocity_by_position(averaged[Q.LATITUDE], averaged[Q.LONGITUDE])
            topics["/gps"] |= {"velocity_north_mps": north, "velocity_east_mps": east}
        else:
            topics["/gps"] = {}
    if len(topics["/gps"]) == 2 and pressure is not None:
        down = -np.gradient(_height(pressure.value), pressure.t_s)
        topics["/gps"] = {**topics["/gps"], "velocity_down_mps": Channel(pressure.t_s, down)}
    topics["/battery"] = _battery(averaged)
    if (motor := averaged.get(Q.MOTOR_SPEED)) is not None:
        topics["/rpm"] = {"motor_speed_revps": motor}
    elif (thrust := averaged.get(Q.THRUST)) is not None and pressure is not None:
        rho = _density(thrust.t_s, pressure, temperature)
        topics["/rpm"] = {
            "motor_speed_revps": Channel(thrust.t_s, np.sqrt(np.maximum(thrust.value, 0.0) / rho)),
        }
        attachments["propeller.csv"] = THRUST_AS_SPEED.encode()
    if (throttle := averaged.get(Q.THROTTLE)) is not None:
        topics["/controls"] = {"throttle": throttle}
    topics = {topic: fields for topic, fields in topics.items() if fields}
    if not topics.keys() & {"/probe/airspeed", "/gps"}:
        raise InputError(f"{path}: neither airspeed nor ground velocity is in it; a curve needs one of them")
    log = Log(path, attachments=attachments)
    start_s = min(float(channel.t_s[0]) for fields in topics.values() for channel in fields.values())
    for topic, fields in topics.items():
        log.entries[topic] = _entries(topic, fields, start_s)
        log.fields[topic] = frozenset(fields)
    return log


def _possible(quantity: Quantity, channel: Channel) -> Channel:
    """Drop impossible values of height, pressure or temperature, unless half are impossible; keep other quantities."""
    kind = KINDS[quantity]
    rows = (channel.value >= kind.least) & (channel.value <= kind.greatest)
    if quantity not in STATES_OF_AIR or not np.mean(rows) > 0.5:
        return channel
    return Channel(channel.t_s[rows], channel.value[rows])


def _averaged(channel: Channel) -> Channel:
    """Average as many samples as give an interval that a log may have."""
    width = int(np.ceil(STRUCTURE.interval_s[0] / float(np.median(np.diff(channel.t_s))) - 1e-6))
    if width < 2:
        return channel
    n = len(channel.t_s) // width * width
    return Channel(channel.t_s[:n].reshape(-1, width).mean(axis=1), channel.value[:n].reshape(-1, width).mean(axis=1))


def _height(pressure_Pa: Array) -> Array:
    return np.asarray(height_at(pressure_Pa))


def _static(channels: Mapping[Quantity, Channel]) -> Channel | None:
    """Return static pressure as measured, from the height, or from GPS climb that starts at sea level."""
    if (pressure := channels.get(Q.STATIC_PRESSURE)) is not None:
        return without_steps(pressure)
    if (height := channels.get(Q.HEIGHT)) is not None:
        return Channel(height.t_s, np.asarray(pressure_at(without_steps(height).value)))
    if (down := channels.get(Q.VELOCITY_DOWN)) is not None:
        step = np.diff(down.t_s) * (down.value[1:] + down.value[:-1]) / 2
        height_m = -np.concatenate([[0.0], np.cumsum(step)])
        return Channel(down.t_s, np.asarray(pressure_at(height_m)))
    return None


def _density(t_s: Array, pressure: Channel, temperature: Channel | None) -> Array:
    pressure_Pa = pressure.at(t_s)
    if temperature is None:
        return np.asarray(density(pressure_Pa, temperature_at(float(np.median(_height(pressure.value))))))
    return np.asarray(density(pressure_Pa, temperature.at(t_s)))


def _dynamic_pressure(channels: Mapping[Quantity, Channel], pressure: Channel | None) -> Channel | None:
    if (q := channels.get(Q.DYNAMIC_PRESSURE)) is not None:
        return q
    if (indicated := channels.get(Q.INDICATED_AIRSPEED)) is not None:
        return Channel(indicated.t_s, pressure_of_indicated_airspeed(indicated.value))
    true = channels.get(Q.TRUE_AIRSPEED)
    if true is None or pressure is None:
        return None
    rho = _density(true.t_s, pressure, channels.get(Q.AIR_TEMPERATURE))
    return Channel(true.t_s, np.sign(true.value) * rho * true.value**2 / 2)


def _by_course(speed: Channel, course: Channel) -> Fields:
    turned = np.interp(speed.t_s, course.t_s, np.unwrap(course.value))
    return {
        "velocity_north_mps": Channel(speed.t_s, speed.value * np.cos(turned)),
        "velocity_east_mps": Channel(speed.t_s, speed.value * np.sin(turned)),
    }


def _battery(channels: Mapping[Quantity, Channel]) -> Fields:
    """Return voltage and current; if there is power, the current follows from it and the voltage, or else one volt."""
    power, voltage, current = (channels.get(quantity) for quantity in (Q.POWER, Q.VOLTAGE, Q.CURRENT))
    if power is not None:
        volt = np.ones(len(power.t_s)) if voltage is None else voltage.at(power.t_s)
        return {"voltage_V": Channel(power.t_s, volt), "current_A": Channel(power.t_s, power.value / volt)}
    return {"voltage_V": voltage, "current_A": current} if voltage is not None and current is not None else {}


def _entries(topic: str, fields: Fields, start_s: float) -> Entries:
    """Make entries at the times of the densest field; the other fields are interpolated."""
    densest = max(fields.values(), key=lambda channel: len(channel.t_s))
    entries = Entries(TYPE_OF_TOPIC[topic])
    n = len(densest.t_s)
    entries.time_ns = array("Q", np.round((densest.t_s - start_s) * 1e9).astype(np.uint64).tolist())
    entries.tick = array("L", range(n))
    entries.status = array("B", [STATUS_CODE[Status.OK]]) * n
    for name, column in entries.columns.items():
        channel = fields.get(name)
        column.extend([None] * n if channel is None else channel.at(densest.t_s).tolist())
    return entries


def _zeros() -> bytes:
    """Return zeros of 0 Pa, because table values are already corrected for the zeros of the sensors."""
    still = {"mean": 0.0, "standard_deviation": 0.0, "samples": 1}
    readings = {f"/probe/{name}": {"differential_pressure_Pa": still} for name in ("alpha", "beta", "airspeed")}
    return json.dumps({"format": "flightpower-zero-1", "readings": readings}).encode()


def _vane_as_probe() -> bytes:
    """Return a probe calibration for pressures that are ALPHA_PORT_SLOPE times angle times dynamic pressure."""

    def linear(powers: list[tuple[int, int]], coefficient: float) -> dict[str, object]:
        return {"powers": powers, "coefficients": [coefficient], "residual_rms": 0.0, "order": 1}

    maps = {
        "alpha_rad": linear([(1, 0)], 1 / ALPHA_PORT_SLOPE),
        "beta_rad": linear([(0, 1)], 1 / ALPHA_PORT_SLOPE),
        "q_ratio": linear([(0, 0)], 1.0),
    }
    hull = [(-3, -3), (3, -3), (3, 3), (-3, 3)]
    head = {"format": "flightpower-probe-2", "source": "vane", "points": 1, "alpha_scale_sigma": 0.0, "hull": hull}
    return json.dumps(head | maps).encode()
