"""A simulated flight as ArduPlane would log it, at its default rates."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.autopilot_pitot import AutopilotPitot, indicated_airspeed
from sim.dataflash_writer import DataflashMessages, write_dataflash
from sim.fly import Flight
from sim.sensor_truth import SensorTruth
from sim.sensors.budget import DrawnErrors

Array = NDArray[np.float64]

BOOT_US = 81_000_000
SLOW_HZ, IMU_HZ, GPS_HZ = 10.0, 25.0, 5.0
IDLE_A = 0.05
BAROMETER_K, AIRFLOW_K, KELVIN = 25.0, 2.0, 273.15  # above the air
AIRSPEED_S = 0.1  # over which ArduPilot averages the differential pressure


def write_ardupilot_log(path: Path, flight: Flight, sensors: SensorTruth, errors: DrawnErrors) -> None:
    """Write a flight as dataflash log. Raises OSError where the file cannot be written."""
    pitot = AutopilotPitot(flight, errors)
    slow = np.arange(0.02, sensors.duration_s, 1 / SLOW_HZ)
    pressure = pitot.pressure_Pa(slow, AIRSPEED_S)
    voltage, current = sensors.battery(slow)
    imu = np.arange(0.005, sensors.duration_s, 1 / IMU_HZ)
    force, rate = sensors.imu(imu)
    asked = np.arange(0.09, sensors.duration_s, 1 / GPS_HZ)
    gps = sensors.gps(asked)
    north, east, down = gps.velocity_ned_mps.T
    kinds = [
        messages("MSG", "QZ", {"TimeUS": np.zeros(1), "Message": np.array([b"ArduPlane V4.5.7 (simulated)"])}),
        messages("ARSP", "QBffc", {"TimeUS": slow, "I": 0 * slow, "Airspeed": np.abs(indicated_airspeed(pressure)),
                                   "DiffPress": pressure, "Temp": pitot.air_K(slow) + AIRFLOW_K - KELVIN}),
        messages("BARO", "QBfc", {"TimeUS": slow, "I": 0 * slow, "Press": sensors.absolute_pressure_Pa("baro", slow),
                                  "Temp": pitot.air_K(slow) + BAROMETER_K - KELVIN}),
        messages("BAT", "QBff", {"TimeUS": slow, "Inst": 0 * slow, "Volt": voltage, "Curr": current + IDLE_A}),
        messages("IMU", "QBffffff", {"TimeUS": imu, "I": 0 * imu,
                                     **{f"Gyr{axis}": x for axis, x in zip("XYZ", rate.T, strict=True)},
                                     **{f"Acc{axis}": x for axis, x in zip("XYZ", force.T, strict=True)}}),
        messages("GPS", "QBBfff", {"TimeUS": asked, "I": 0 * asked, "Status": np.where(gps.fix, 3, 0),
                                   "Spd": np.hypot(north, east), "GCrs": np.degrees(np.arctan2(east, north)) % 360,
                                   "VZ": down}),
    ]  # fmt: skip
    write_dataflash(path, kinds)


def messages(name: str, codes: str, columns: dict[str, NDArray[np.generic]]) -> DataflashMessages:
    """Messages whose TimeUS is given in seconds since logging began."""
    time_us = BOOT_US + np.round(np.asarray(columns["TimeUS"], dtype=float) * 1e6).astype(np.uint64)
    return DataflashMessages(name, codes, columns | {"TimeUS": time_us})
