"""A simulated flight as ArduPlane would log it, at its default rates."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.autopilot_pitot import AutopilotPitot, indicated_airspeed
from sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from sim.fly import Flight
from sim.log_faults import CLOCK_SET_AT, CLOCK_SET_US, TRUNCATED_TO, with_clock_set, with_dropouts, without
from sim.px4_log import AVIONICS_V, RAW_OFFSET_PA, RAW_STEP_PA, airborne_us
from sim.sensor_truth import SensorTruth
from sim.sensors.budget import DrawnErrors
from sim.telemetry_writer import write_telemetry

Array = NDArray[np.float64]

BOOT_US = 81_000_000
SLOW_HZ, IMU_HZ, GPS_HZ = 10.0, 25.0, 5.0
IDLE_A = 0.05
BAROMETER_K, AIRFLOW_K, KELVIN = 25.0, 2.0, 273.15  # above the air
PARAMETERS = {"ARSPD_RATIO": 2.0, "AIRSPEED_CRUISE": 12.0, "AIRSPEED_MIN": 9.0, "AIRSPEED_MAX": 22.0}
AT_START = ("MSG", "PARM")  # written at the beginning of each log
ERASED_FLASH = b"\xff" * 4096
AIRSPEED_S = 0.1  # over which ArduPilot averages the differential pressure


def write_ardupilot_log(
    path: Path, flight: Flight, sensors: SensorTruth, errors: DrawnErrors, faults: Collection[str] = ()
) -> None:
    """Write a flight as dataflash log, its text (.log) or a ground station's recording (.tlog), by the file's name.

    faults: of sim.log_faults.FAULTS. Raises OSError where it cannot be written.
    """
    kinds = _messages(flight, sensors, errors, faults)
    if "no-airspeed" in faults:
        kinds = [one for one in kinds if one.name != "ARSP"]
    if "dropouts" in faults:
        kinds, _ = with_dropouts(kinds, errors.seed)
    if "airborne-start" in faults:
        late = BOOT_US + airborne_us(flight)
        kinds = [one if one.name in AT_START else without(one, 0, late) for one in kinds]
    if "clock-jump" in faults:
        kinds = with_clock_set(kinds, BOOT_US + int(CLOCK_SET_AT * sensors.duration_s * 1e6), CLOCK_SET_US)
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
    pressure = pitot.pressure_Pa(slow, AIRSPEED_S)
    if "pressure-offset" in faults:
        pressure = np.round((pressure + RAW_OFFSET_PA) / RAW_STEP_PA) * RAW_STEP_PA
    voltage, current = sensors.battery(slow)
    imu = np.arange(0.005, sensors.duration_s, 1 / IMU_HZ)
    force, rate = sensors.imu(imu)
    asked = np.arange(0.09, sensors.duration_s, 1 / GPS_HZ)
    gps = sensors.gps(asked)
    north, east, down = gps.velocity_ned_mps.T
    revps = sensors.motor_speed_revps(slow)
    instance = 1 if "wrong-battery-first" in faults else 0
    other = messages("BAT", "QBff", {"TimeUS": slow, "Inst": 0 * slow + 1 - instance, "Volt": 0 * slow + AVIONICS_V,
                                     "Curr": 0 * slow})  # fmt: skip
    propulsion = messages("BAT", "QBff", {"TimeUS": slow, "Inst": 0 * slow + instance, "Volt": voltage,
                                          "Curr": current + IDLE_A})  # fmt: skip
    flying = np.where((revps < 1.0) | ("landed" in faults), 0, 1)
    return [
        messages("MSG", "QZ", {"TimeUS": np.zeros(1), "Message": np.array([b"ArduPlane V4.5.7 (simulated)"])}),
        messages("ARSP", "QBffc", {"TimeUS": slow, "I": 0 * slow, "Airspeed": np.abs(indicated_airspeed(pressure)),
                                   "DiffPress": pressure, "Temp": pitot.air_K(slow) + AIRFLOW_K - KELVIN}),
        messages("BARO", "QBfc", {"TimeUS": slow, "I": 0 * slow, "Press": sensors.absolute_pressure_Pa("baro", slow),
                                  "Temp": pitot.air_K(slow) + BAROMETER_K - KELVIN}),
        messages("PARM", "QNf", {"TimeUS": np.zeros(len(PARAMETERS)), "Name": np.array([*PARAMETERS], dtype="S16"),
                                 "Value": np.array([*PARAMETERS.values()])}),
        *((other, propulsion) if instance else (propulsion, other)),
        messages("RPM", "QBf", {"TimeUS": slow, "I": 0 * slow, "RPM": 60 * revps}),
        messages("STAT", "QB", {"TimeUS": slow, "isFlying": flying}),
        messages("IMU", "QBffffff", {"TimeUS": imu, "I": 0 * imu,
                                     **{f"Gyr{axis}": x for axis, x in zip("XYZ", rate.T, strict=True)},
                                     **{f"Acc{axis}": x for axis, x in zip("XYZ", force.T, strict=True)}}),
        messages("GPS", "QBBfff", {"TimeUS": asked, "I": 0 * asked, "Status": np.where(gps.fix, 3, 0),
                                   "Spd": np.hypot(north, east), "GCrs": np.degrees(np.arctan2(east, north)) % 360,
                                   "VZ": down}),
    ]  # fmt: skip


def messages(name: str, codes: str, columns: dict[str, NDArray[np.generic]]) -> DataflashMessages:
    """Messages whose TimeUS is given in seconds since logging began."""
    time_us = BOOT_US + np.round(np.asarray(columns["TimeUS"], dtype=float) * 1e6).astype(np.uint64)
    return DataflashMessages(name, codes, columns | {"TimeUS": time_us})
