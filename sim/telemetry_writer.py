"""Writes the messages of a dataflash log as a ground station would record them by radio (.tlog).

Each message consists of the time of reception in microseconds since 1970 (8 bytes, big-endian) and a MAVLink 2 frame.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.dataflash_writer import DataflashMessages

BOOTED_US = 1_700_000_000_000_000  # in November 2023
HEARTBEAT_US = 1_000_000
NO_CELL = 65535  # UINT16_MAX
AUTOPILOT, GROUND_STATION = 1, 255

Row = Mapping[str, Any]


def write_telemetry(path: Path, kinds: Sequence[DataflashMessages]) -> None:
    """Write a recording. Raises OSError if it cannot be written."""
    senders = {AUTOPILOT: mavlink.MAVLink(None, AUTOPILOT, 1), GROUND_STATION: mavlink.MAVLink(None, GROUND_STATION, 1)}
    pitots = [kind for kind in kinds if kind.name == "ARSP"][:1]
    control = [kind for kind in kinds if kind.name == "CTUN"]
    of_pitot, of_control = {"DiffPress": "DiffPress", "AirTemp": "Temp"}, {"ThO": "ThO"}
    joined = {"BARO": (pitots, of_pitot), "ARSP": (control, of_control)}  # two messages of a dataflash log are one here
    kinds = [*pitots, *(kind for kind in kinds if kind.name != "ARSP")]
    kinds = [_with_fields(kind, *joined[kind.name]) if kind.name in joined else kind for kind in kinds]
    sent = [
        (time_us, AUTOPILOT, message)
        for kind in kinds
        if kind.name in ENCODERS
        for time_us, message in _timed_messages(kind)
    ]
    last_us = max((time_us for time_us, _, _ in sent), default=0)
    for time_us in range(min((time_us for time_us, _, _ in sent), default=0), last_us, HEARTBEAT_US):
        station, plane = mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_FIXED_WING
        sent.append((time_us, GROUND_STATION, _heartbeat(station, mavlink.MAV_AUTOPILOT_INVALID)))
        sent.append((time_us, AUTOPILOT, _heartbeat(plane, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)))
    # The first message at each time is the heartbeat, which identifies the sender.
    sent.sort(key=lambda entry: (entry[0], not isinstance(entry[2], mavlink.MAVLink_heartbeat_message)))
    path.write_bytes(
        b"".join(
            (BOOTED_US + sent_us).to_bytes(8, "big") + bytes(message.pack(senders[who]))
            for sent_us, who, message in sent
        )
    )


def _timed_messages(kind: DataflashMessages) -> Iterator[tuple[int, Any]]:
    names = [*kind.columns]
    for values in zip(*(column.tolist() for column in kind.columns.values()), strict=True):
        row = dict(zip(names, values, strict=True))
        for message in ENCODERS[kind.name](row):
            yield int(row["TimeUS"]), message


def _heartbeat(kind: int, autopilot: int) -> Any:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3)


def _airspeed(row: Row) -> list[Any]:
    return [mavlink.MAVLink_vfr_hud_message(row["Airspeed"], 0.0, 0, round(row["ThO"]), 0.0, 0.0)]


def _pressure(row: Row) -> list[Any]:
    """Make the one message that holds both pressures."""
    milliseconds, difference = int(row["TimeUS"]) // 1000, row["DiffPress"] / 100
    inside, outside = round(100 * row["Temp"]), round(100 * row["AirTemp"])
    return [mavlink.MAVLink_scaled_pressure_message(milliseconds, row["Press"] / 100, difference, inside, outside)]


def _with_fields(
    kind: DataflashMessages, others: Sequence[DataflashMessages], fields: Mapping[str, str]
) -> DataflashMessages:
    """Add values of another kind, if any, at the messages' times; fields: the other kind's fields, by new name."""
    at_us, more = kind.columns["TimeUS"].astype(float), {}
    for name, column in fields.items():
        matching = [
            np.interp(at_us, messages.columns["TimeUS"].astype(float), messages.columns[column].astype(float))
            for messages in others
        ]
        more[name] = matching[0] if matching else np.zeros(len(at_us))
    return replace(kind, columns=kind.columns | more)


def _battery(row: Row) -> list[Any]:
    cells = [round(1000 * row["Volt"]), *[NO_CELL] * 9]
    current = round(100 * row["Curr"])
    return [mavlink.MAVLink_battery_status_message(int(row["Inst"]), 0, 0, 0, cells, current, 0, 0, -1)]


def _imu(row: Row) -> list[Any]:
    force = [round(1000 * row[f"Acc{axis}"] / GRAVITY_MPS2) for axis in "XYZ"]
    return [mavlink.MAVLink_raw_imu_message(int(row["TimeUS"]), *force, 0, 0, 0, 0, 0, 0)]


def _gps(row: Row) -> list[Any]:
    speed, course = round(100 * row["Spd"]), round(100 * row["GCrs"]) % 36000
    fix = mavlink.MAVLink_gps_raw_int_message(int(row["TimeUS"]), int(row["Status"]), 0, 0, 0, 0, 0, speed, course, 10)
    down = round(100 * row["VZ"])
    return [fix, mavlink.MAVLink_global_position_int_message(int(row["TimeUS"]) // 1000, 0, 0, 0, 0, 0, 0, down, 0)]


def _rpm(row: Row) -> list[Any]:
    return [mavlink.MAVLink_rpm_message(row["RPM"], 0.0)]


def _parameter(row: Row) -> list[Any]:
    return [mavlink.MAVLink_param_value_message(row["Name"], row["Value"], 9, 1, 0)]


ENCODERS: dict[str, Callable[[Row], list[Any]]] = {"ARSP": _airspeed, "BARO": _pressure, "BAT": _battery, "IMU": _imu,
                                                   "GPS": _gps, "RPM": _rpm, "PARM": _parameter}  # fmt: skip
