"""Reads a ground station's recording of telemetry (.tlog), of ArduPilot or PX4, as if it were a dataflash log.

Each message has the time of reception in microseconds since 1970 (8 bytes, big-endian) and a MAVLink frame of version 1
or 2. pymavlink decodes the frames. Damaged frames, and frames not sent by the autopilot, are skipped.
"""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.flight.formats import is_telemetry
from flightpower.flight.units import GRAVITY_MPS2 as g

USED = ("VFR_HUD", "SCALED_PRESSURE", "BATTERY_STATUS", "SYS_STATUS", "RAW_IMU", "GPS_RAW_INT", "GLOBAL_POSITION_INT",
        "RPM", "PARAM_VALUE", "HEARTBEAT", "STATUSTEXT", "HIGHRES_IMU", "EXTENDED_SYS_STATE",
        "SYSTEM_TIME")  # fmt: skip
USED_IDS = frozenset(number for number, kind in mavlink.mavlink_map.items() if kind.msgname in USED)
# Firmware by MAV_TYPE, with the names used in dataflash logs.
FIRMWARE = {
    mavlink.MAV_TYPE_QUADROTOR: b"ArduCopter",
    mavlink.MAV_TYPE_COAXIAL: b"ArduCopter",
    mavlink.MAV_TYPE_HELICOPTER: b"ArduCopter",
    mavlink.MAV_TYPE_HEXAROTOR: b"ArduCopter",
    mavlink.MAV_TYPE_OCTOROTOR: b"ArduCopter",
    mavlink.MAV_TYPE_TRICOPTER: b"ArduCopter",
    mavlink.MAV_TYPE_DODECAROTOR: b"ArduCopter",
    mavlink.MAV_TYPE_DECAROTOR: b"ArduCopter",
    mavlink.MAV_TYPE_GROUND_ROVER: b"ArduRover",
    mavlink.MAV_TYPE_SURFACE_BOAT: b"ArduRover",
    mavlink.MAV_TYPE_SUBMARINE: b"ArduSub",
    mavlink.MAV_TYPE_FIXED_WING: b"ArduPlane",
}
AUTOPILOTS = (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4)
INTEGERS = (mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_UINT32)  # PX4 sends their bytes as a float
LIFTED = (mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW, mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC, mavlink.MAV_VTOL_STATE_MC)

Columns = dict[str, NDArray[Any]]


class TelemetryLog:
    """The messages of a recording under the names, and in the units, of a dataflash log."""

    notes = ("The log is a ground station's: its times are those of reception, and what the radio lost is missing.",)

    def __init__(self, data: bytes):
        rows: dict[str, list[list[Any]]] = defaultdict(list)
        for time_us, message in _messages(data, USED_IDS):
            if message.get_type() == "BATTERY_STATUS":
                cells = [x for x in message.voltages if x != 65535]  # UINT16_MAX means no such cell
                more = [x for x in message.voltages_ext if x not in (0, 65535)]  # cells 11 to 14
                volt = 1e-3 * sum(cells + more) if cells else np.nan
                current = np.nan if message.current_battery == -1 else 0.01 * message.current_battery
                rows["BAT"].append([time_us, message.id, volt, current])
            else:
                rows[message.get_type()].append([time_us, *(getattr(message, name) for name in message.fieldnames)])
        self._columns = _as_dataflash({name: _table(name, many) for name, many in rows.items()})

    def form(self, name: str) -> None:
        """Return nothing: messages are not packed, and units are already SI."""

    def columns(self, name: str) -> Columns:
        """Return the fields of all messages of a name, (n,)."""
        return self._columns.get(name, {})


class RawTelemetryLog:
    """All messages of a recording, under MAVLink's names and in its units."""

    def __init__(self, data: bytes):
        rows: dict[str, list[list[Any]]] = defaultdict(list)
        for time_us, message in _messages(data, frozenset(mavlink.mavlink_map)):
            values = [getattr(message, name) for name in message.fieldnames]
            rows[message.get_type()].append([time_us, *(x if isinstance(x, int | float) else np.nan for x in values)])
        self._columns = {name: _as_numbers(_table(name, many)) for name, many in rows.items()}

    def names(self) -> list[str]:
        """Return the kinds of message that the recording holds."""
        return list(self._columns)

    def columns(self, name: str) -> Columns:
        """Return the fields of all messages of a name, (n,); NaN throughout for texts and arrays."""
        return self._columns.get(name, {})


def _messages(data: bytes, ids: frozenset[int]) -> Iterator[tuple[int, Any]]:
    """Yield the time of reception and the message, from the autopilot only. ids : numbers of the kinds to decode"""
    decoder = mavlink.MAVLink(None)
    offset, autopilot = 0, None
    while offset + 20 <= len(data):
        if not is_telemetry(data[offset : offset + 9]):
            offset += 1
            continue
        start = offset + 8
        second = data[start] == mavlink.PROTOCOL_MARKER_V2
        length = data[start + 1] + (12 + 13 * (data[start + 2] & mavlink.MAVLINK_IFLAG_SIGNED) if second else 8)
        number = int.from_bytes(data[start + 7 : start + 10], "little") if second else data[start + 5]
        sender = data[start + 5 if second else start + 3]
        try:
            wanted = number in ids and autopilot in (None, sender)
            message = decoder.decode(bytearray(data[start : start + length])) if wanted else None
        except Exception:  # altered bytes raise errors of many kinds
            offset += 1
            continue
        if message is None:
            offset = start + length
            continue
        heartbeat = isinstance(message, mavlink.MAVLink_heartbeat_message)
        if heartbeat and message.autopilot in AUTOPILOTS:
            autopilot = sender
        if autopilot == sender:
            yield int.from_bytes(data[offset:start], "big"), message
        offset = start + length


def _table(name: str, rows: list[list[Any]]) -> Columns:
    if name == "BAT":
        fields = ["Inst", "Volt", "Curr"]
    else:
        fields = next(kind.fieldnames for kind in mavlink.mavlink_map.values() if kind.msgname == name)
    columns = zip(*rows, strict=True)
    return {field: np.array(values) for field, values in zip(["TimeUS", *fields], columns, strict=True)}


def _as_dataflash(tables: dict[str, Columns]) -> dict[str, Columns]:
    """Return tables under dataflash names. VFR_HUD's airspeed counts only if there is differential pressure."""
    out: dict[str, Columns] = {}
    _complete(tables)
    beats = tables.get("HEARTBEAT")
    px4 = beats is not None and np.any(beats["autopilot"] == mavlink.MAV_AUTOPILOT_PX4)
    pressure, hud = tables.get("SCALED_PRESSURE"), tables.get("VFR_HUD")
    if pressure is not None:
        t = pressure["TimeUS"]
        out["BARO"] = {"TimeUS": t, "Press": 100.0 * pressure["press_abs"], "Temp": 0.01 * pressure["temperature"]}
        if hud is not None and np.any(pressure["press_diff"] != 0):
            difference_Pa = np.interp(hud["TimeUS"], t, 100.0 * pressure["press_diff"])
            celsius = 0.01 * np.interp(hud["TimeUS"], t, pressure["temperature_press_diff"])
            airspeed = {"TimeUS": hud["TimeUS"], "Airspeed": hud["airspeed"], "DiffPress": difference_Pa}
            out["ARSP"] = airspeed | {"Temp": celsius}
    status = tables.get("SYS_STATUS")
    if "BAT" in tables:
        out["BAT"] = tables["BAT"]
        if status is not None:  # it also has the voltage of the first battery
            unknown = np.isnan(out["BAT"]["Volt"]) & (out["BAT"]["Inst"] == 0)
            volt = np.interp(out["BAT"]["TimeUS"], status["TimeUS"], 1e-3 * status["voltage_battery"])
            out["BAT"]["Volt"] = np.where(unknown, volt, out["BAT"]["Volt"])
    elif status is not None:
        volt, current = 1e-3 * status["voltage_battery"], 0.01 * status["current_battery"]
        out["BAT"] = {"TimeUS": status["TimeUS"], "Volt": volt, "Curr": current}
    if (imu := tables.get("RAW_IMU")) is not None:
        force = {f"Acc{axis.upper()}": 1e-3 * g * imu[f"{axis}acc"] for axis in "xyz"}
        out["IMU"] = {"TimeUS": imu["TimeUS"]} | force
    if (gps := tables.get("GPS_RAW_INT")) is not None and (motion := tables.get("GLOBAL_POSITION_INT")) is not None:
        out["GPS"] = {"TimeUS": gps["TimeUS"], "Status": gps["fix_type"], "Spd": 0.01 * gps["vel"],
                      "GCrs": 0.01 * gps["cog"],
                      "VZ": np.interp(gps["TimeUS"], motion["TimeUS"], 0.01 * motion["vz"]),
                      "Lat": gps["lat"], "Lng": gps["lon"], "Alt": 1e-3 * gps["alt"]}  # fmt: skip
        if (clock := tables.get("SYSTEM_TIME")) is not None and len(dated := np.flatnonzero(clock["time_unix_usec"])):
            received_us, told_us = (clock[name][dated].astype(float) for name in ("TimeUS", "time_unix_usec"))
            out["GPS"]["Unix"] = 1e-6 * (gps["TimeUS"] + np.interp(gps["TimeUS"], received_us, told_us - received_us))
    if (rpm := tables.get("RPM")) is not None:
        out["RPM"] = {"TimeUS": rpm["TimeUS"], "rpm1": rpm["rpm1"]}
    if (parameters := tables.get("PARAM_VALUE")) is not None:
        are_integers = np.isin(parameters["param_type"], INTEGERS) & px4
        value = parameters["param_value"].astype(np.float32)
        out["PARM"] = {
            "Name": parameters["param_id"].astype("S16"), "Value": np.where(are_integers, value.view(np.int32), value)
        }  # fmt: skip
    if hud is not None:
        out["CTUN"] = {"TimeUS": hud["TimeUS"], "ThO": hud["throttle"]}
    if beats is not None and not px4:
        out["MODE"] = {"TimeUS": beats["TimeUS"], "ModeNum": beats["custom_mode"]}
    if (vtol := tables.get("EXTENDED_SYS_STATE")) is not None:
        out["QTUN"] = {"TimeUS": vtol["TimeUS"], "ThO": np.isin(vtol["vtol_state"], LIFTED)}
    kinds = [] if beats is None else np.unique(beats["type"]).tolist()
    firmware = [name for kind in kinds if (name := _firmware(kind))]
    status_texts = tables.get("STATUSTEXT", {"TimeUS": np.zeros(0), "text": np.zeros(0, dtype=str)})
    times_us = np.concatenate([np.full(len(firmware), np.nan), status_texts["TimeUS"]])
    texts = [str(text).encode("ascii", "replace") for text in status_texts["text"]]
    out["MSG"] = {"TimeUS": times_us, "Message": np.array([*firmware, *texts], dtype="S64")}
    return {name: _as_numbers(columns) for name, columns in out.items()}


def _firmware(kind: int) -> bytes:
    """Return the firmware for a MAV_TYPE; empty for other types. 19 to 25 are VTOLs, whose names have changed."""
    return FIRMWARE.get(kind, b"ArduPlane" if 19 <= kind <= 25 else b"")


def _complete(tables: dict[str, Columns]) -> None:
    """Fill in missing pressure and acceleration from HIGHRES_IMU, in which PX4 sends both."""
    imu = tables.get("HIGHRES_IMU")
    if imu is None:
        return
    t = imu["TimeUS"]
    tables.setdefault("SCALED_PRESSURE", {
        "TimeUS": t, "press_abs": imu["abs_pressure"], "press_diff": imu["diff_pressure"],
        "temperature": 100.0 * imu["temperature"], "temperature_press_diff": np.zeros(len(t)),
    })  # fmt: skip
    tables.setdefault("RAW_IMU", {"TimeUS": t} | {f"{axis}acc": imu[f"{axis}acc"] * (1e3 / g) for axis in "xyz"})


def _as_numbers(columns: Columns) -> Columns:
    return {name: x if x.dtype.kind == "S" else x.astype(np.float64) for name, x in columns.items()}
