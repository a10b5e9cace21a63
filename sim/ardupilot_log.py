"""Writes a simulated flight as ArduPlane would log it, at its default rates."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.sim.autopilot_pitot import AutopilotPitot, indicated_airspeed
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from flightpower.sim.fly import Flight
from flightpower.sim.log_faults import (
    CLOCK_SET_AT,
    CLOCK_SET_US,
    DEAD_A,
    HOVER_A,
    TRUNCATED_TO,
    lifted,
    with_clock_set,
    with_dropouts,
    without,
)
from flightpower.sim.px4_log import AVIONICS_V, RAW_OFFSET_PA, RAW_STEP_PA, airborne_us
from flightpower.sim.sensor_truth import SensorTruth
from flightpower.sim.sensors.budget import DrawnErrors
from flightpower.sim.sensors.noise import white
from flightpower.sim.telemetry_writer import write_telemetry

BOOT_US = 81_000_000
SLOW_HZ, IMU_HZ, GPS_HZ = 10.0, 25.0, 5.0
IDLE_A = 0.05
BAROMETER_K, AIRFLOW_K, KELVIN = 25.0, 2.0, 273.15  # temperatures above that of the air
PARAMETERS = {"ARSPD_RATIO": 2.0, "AIRSPEED_CRUISE": 12.0, "AIRSPEED_MIN": 9.0, "AIRSPEED_MAX": 22.0,
              "SERVO3_FUNCTION": 70.0, "SERVO3_MIN": 1000.0, "SERVO3_MAX": 2000.0}  # fmt: skip
AUTO, QLOITER = 10, 19  # mode numbers in MODE
AT_START = ("MSG", "PARM")  # written at the beginning of each log
ERASED_FLASH = b"\xff" * 4096
AIRSPEED_S = 0.1  # time over which ArduPilot averages the differential pressure


def write_ardupilot_log(
    path: Path, flight: Flight, sensors: SensorTruth, errors: DrawnErrors, faults: Collection[str] = ()
) -> None:
    """Write a flight as a dataflash log, its text (.log) or a ground station's recording (.tlog), depending on the
    file's name.

    faults: of sim.log_faults.FAULTS. Raises OSError if the file cannot be written.
    """
    kinds = _messages(flight, sensors, errors, faults)
    absent = {name for fault, name in (("no-airspeed", "ARSP"), ("no-gps", "GPS")) if fault in faults}
    kinds = [kind for kind in kinds if kind.name not in absent]
    if "dropouts" in faults:
        kinds, _ = with_dropouts(kinds, errors.seed)
    if "airborne-start" in faults:
        late = BOOT_US + airborne_us(flight)
        kinds = [kind if kind.name in AT_START else without(kind, 0, late) for kind in kinds]
    if "clock-jump" in faults:
        kinds = with_clock_set(kinds, BOOT_US + int(CLOCK_SET_AT * sensors.duration_s * 1e6), CLOCK_SET_US)
    if "old-firmware" in faults:
        kinds = [as_in_2014(kind) for kind in kinds if kind.name in OLD]
    {".log": write_text, ".tlog": write_telemetry}.get(path.suffix, write_dataflash)(path, kinds)
    data = path.read_bytes()
    if "appended" in faults:
        path.write_bytes(data + ERASED_FLASH)
    if "truncated" in faults:
        path.write_bytes(data[: int(TRUNCATED_TO * len(data))])


def _messages(
    flight: Flight, sensors: SensorTruth, errors: DrawnErrors, faults: Collection[str]
) -> list[DataflashMessages]:
    pitot = AutopilotPitot(flight, errors)
    slow = np.arange(0.02, sensors.duration_s, 1 / SLOW_HZ)
    imu = np.arange(0.005, sensors.duration_s, 1 / IMU_HZ)
    force, rate = sensors.imu(imu)
    revps = sensors.motor_speed_revps(slow)
    flying = np.where((revps < 1.0) | ("landed" in faults), 0, 1)
    text = b"ArduPlane V3.1.1 (simulated)" if "old-firmware" in faults else b"ArduPlane V4.5.7 (simulated)"
    board = "SimulatedBoard {:08X} {:08X} {:08X}".format(*errors.board).encode()
    return [
        messages("MSG", "QZ", {"TimeUS": np.zeros(2), "Message": np.array([text, board])}),
        *_airspeeds(pitot, slow, errors.seed, faults),
        messages("BARO", "QBfcfB", {"TimeUS": slow, "I": 0 * slow,
                                    "Press": sensors.absolute_pressure_Pa("baro", slow),
                                    "Temp": pitot.air_K(slow) + BAROMETER_K - KELVIN, "GndTemp": 0 * slow,
                                    "Health": 0 * slow + 1}),
        messages("PARM", "QNf", {"TimeUS": np.zeros(len(PARAMETERS)), "Name": np.array([*PARAMETERS], dtype="S16"),
                                 "Value": np.array([*PARAMETERS.values()])}),
        *_power(sensors, slow, faults),
        *_control(flight, slow, lifted(slow, sensors.duration_s, faults)),
        messages("RPM", "QBf", {"TimeUS": slow, "I": 0 * slow, "RPM": 60 * revps}),
        messages("STAT", "QB", {"TimeUS": slow, "isFlying": flying}),
        messages("IMU", "QBffffff", {"TimeUS": imu, "I": 0 * imu,
                                     **{f"Gyr{axis}": x for axis, x in zip("XYZ", rate.T, strict=True)},
                                     **{f"Acc{axis}": x for axis, x in zip("XYZ", force.T, strict=True)}}),
        _gps(sensors),
    ]  # fmt: skip


def _airspeeds(pitot: AutopilotPitot, t_s: Array, seed: int, faults: Collection[str]) -> list[DataflashMessages]:
    """The sensor in use, and with the fault `second-airspeed` also an unused sensor that is connected to nothing."""
    pressure = pitot.pressure_Pa(t_s, AIRSPEED_S)
    if "pressure-offset" in faults:
        pressure = np.round((pressure + RAW_OFFSET_PA) / RAW_STEP_PA) * RAW_STEP_PA
    celsius = np.zeros(len(t_s)) if "no-thermometer" in faults else pitot.air_K(t_s) + AIRFLOW_K - KELVIN
    marks = {"H": 0 * t_s + 1, "Pri": 0 * t_s}

    def sensor(instance: int, pressure_Pa: Array) -> DataflashMessages:
        return messages("ARSP", "QBffcBBB", {"TimeUS": t_s, "I": 0 * t_s + instance, "Airspeed":
                                             np.abs(indicated_airspeed(pressure_Pa)), "DiffPress": pressure_Pa,
                                             "Temp": celsius, "U": 0 * t_s + (instance == 0), **marks})  # fmt: skip

    wild = 300 * np.abs(white(seed, "open port", t_s))
    return [sensor(0, pressure), *([sensor(1, wild)] if "second-airspeed" in faults else [])]


def _power(sensors: SensorTruth, t_s: Array, faults: Collection[str]) -> list[DataflashMessages]:
    """The power monitors: of propulsion and avionics, of two packs, or only the speed controller."""
    voltage, current = sensors.battery(t_s)
    current = current + HOVER_A * lifted(t_s, sensors.duration_s, faults)
    if "dead-meter" in faults:
        current = np.full(len(t_s), DEAD_A)

    def monitor(instance: int, volt: Array, ampere: Array) -> DataflashMessages:
        return messages("BAT", "QBff", {"TimeUS": t_s, "Inst": 0 * t_s + instance, "Volt": volt, "Curr": ampere})

    if "esc-power" in faults:
        fields = {"Volt": voltage, "Curr": current, "RPM": 60 * sensors.motor_speed_revps(t_s)}
        return [messages("ESC", "QBfff", {"TimeUS": t_s, "Instance": 0 * t_s, **fields})]
    if "two-packs" in faults:
        return [monitor(0, voltage, 0.55 * current + IDLE_A), monitor(1, 0.98 * voltage, 0.45 / 0.98 * current)]
    instance = 1 if "wrong-battery-first" in faults else 0
    monitors = [monitor(instance, voltage, current + IDLE_A), monitor(1 - instance, 0 * t_s + AVIONICS_V, 0 * t_s)]
    return monitors[::-1] if instance else monitors


def _control(flight: Flight, t_s: Array, lift: NDArray[np.bool_]) -> list[DataflashMessages]:
    """The autopilot's commands and mode."""
    truth = flight.truth
    throttle = np.interp(t_s, truth["time_s"], np.nan_to_num(truth["throttle"].to_numpy(dtype=float)))
    changes = np.flatnonzero(np.diff(lift, prepend=~lift[0]))
    mode = np.where(lift[changes], QLOITER, AUTO)
    kinds = [
        messages("CTUN", "QcfB", {"TimeUS": t_s, "Pitch": 0 * t_s, "ThO": 100 * throttle, "AsT": 0 * t_s}),
        messages("AETR", "Qf", {"TimeUS": t_s, "Thr": 100 * throttle}),
        messages("RCOU", "QHHH", {"TimeUS": t_s, "C1": 0 * t_s + 1500, "C2": 0 * t_s + 1500,
                                  "C3": np.round(1000 + 1000 * throttle)}),
        messages("MODE", "QMBB", {"TimeUS": t_s[changes], "Mode": mode, "ModeNum": mode, "Rsn": 0 * mode}),
    ]  # fmt: skip
    if lift.any():
        kinds.append(messages("QTUN", "Qf", {"TimeUS": t_s[lift], "ThO": np.full(int(lift.sum()), 0.4)}))
    return kinds


def _gps(sensors: SensorTruth) -> DataflashMessages:
    times_s = np.arange(0.09, sensors.duration_s, 1 / GPS_HZ)
    gps = sensors.gps(times_s)
    north, east, down = gps.velocity_ned_mps.T
    return messages("GPS", "QBBfff", {"TimeUS": times_s, "I": 0 * times_s, "Status": np.where(gps.fix, 3, 0),
                                      "Spd": np.hypot(north, east), "GCrs": np.degrees(np.arctan2(east, north)) % 360,
                                      "VZ": down})  # fmt: skip


# Messages of 2014 firmware, by today's name: name, codes and fields; fields that are missing today are filled in.
OLD = {
    "MSG": ("MSG", "Z", ("Message",)),
    "PARM": ("PARM", "Nf", ("Name", "Value")),
    "ARSP": ("ARSP", "Iffc", ("TimeMS", "Airspeed", "DiffPress", "Temp")),
    "BARO": ("BARO", "Ifc", ("TimeMS", "Press", "Temp")),
    "BAT": ("CURR", "Ihhhh", ("TimeMS", "Thr", "Volt", "Curr", "Vcc")),
    "CTUN": ("CTUN", "Ich", ("TimeMS", "Pitch", "ThrOut")),
    "IMU": ("IMU", "Ifff", ("TimeMS", "AccX", "AccY", "AccZ")),
    "GPS": ("GPS", "BIeEfI", ("Status", "TimeMS", "Spd", "GCrs", "VZ", "T")),
}


def as_in_2014(messages: DataflashMessages) -> DataflashMessages:
    """Convert messages to those of old firmware: a clock in ms (GPS has it in its field T), hundredths as integers."""
    name, codes, fields = OLD[messages.name]
    columns, time_ms = dict(messages.columns), messages.time_us // 1000
    columns |= {"TimeMS": time_ms + (100_000_000 if name == "GPS" else 0), "T": time_ms}
    columns |= {
        "Thr": 0 * time_ms,
        "Vcc": 0 * time_ms,
        "ThrOut": np.round(columns.get("ThO", 0 * time_ms).astype(float)),
    }
    if name == "CURR":
        columns |= {field: np.round(100 * columns[field].astype(float)) for field in ("Volt", "Curr")}
    return DataflashMessages(name, codes, {field: columns[field] for field in fields})


def messages(name: str, codes: str, columns: dict[str, NDArray[np.generic]]) -> DataflashMessages:
    """Messages whose TimeUS is given in seconds since logging began."""
    time_us = BOOT_US + np.round(np.asarray(columns["TimeUS"], dtype=float) * 1e6).astype(np.uint64)
    return DataflashMessages(name, codes, columns | {"TimeUS": time_us})
