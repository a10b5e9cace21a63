"""Writes a simulated flight as PX4 would log it, at its default rates, with the pitfalls of real logs as faults."""

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.sim.autopilot_pitot import AutopilotPitot, indicated_airspeed
from flightpower.sim.fly import Flight
from flightpower.sim.log_faults import (
    CLOCK_SET_AT,
    CLOCK_SET_US,
    DEAD_A,
    HOVER_A,
    TRUNCATED_TO,
    Dropout,
    begun_at,
    lifted,
    with_clock_set,
    with_dropouts,
)
from flightpower.sim.sensor_truth import SensorTruth
from flightpower.sim.sensors.budget import DrawnErrors
from flightpower.sim.sensors.noise import white
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog

BOOT_US = 35_000_000  # the autopilot's clock when logging begins
RATES_HZ = {"vehicle_angular_velocity": 50.0, "vehicle_acceleration": 20.0, "vehicle_attitude": 20.0,
            "airspeed_validated": 5.0, "differential_pressure": 1.0, "battery_status": 5.0,
            "vehicle_air_data": 5.0, "vehicle_gps_position": 5.0, "vehicle_status": 2.0,
            "vehicle_land_detected": 1.0, "rpm": 10.0, "actuator_controls_0": 10.0}  # fmt: skip
AVIONICS_V, IDLE_A = 5.1, 0.05
RAW_OFFSET_PA, RAW_STEP_PA = 100.0, 6.3
HOT_K, AIRFLOW_WARMTH_K, KELVIN = 25.0, 2.0, 273.15  # temperature excess of barometer and pitot sensor over the air
VALIDATED_S = 0.2  # time over which PX4 averages the differential pressure
GPS_JITTER_S = 0.04
PARAMETERS = {"FW_AIRSPD_TRIM": 15.0, "FW_AIRSPD_MIN": 10.0, "FW_AIRSPD_MAX": 20.0}  # PX4's defaults
CRASH_TEXT = "[hardfault_log] a message written at the next start"


def write_px4_log(
    path: Path, flight: Flight, sensors: SensorTruth, errors: DrawnErrors, faults: Collection[str] = ()
) -> None:
    """Write a flight as ULog. faults: of sim.log_faults.FAULTS. Raises OSError where the file cannot be written."""
    topics = [
        *_sensor_topics(sensors),
        *_air_topics(AutopilotPitot(flight, errors), sensors, "no-thermometer" in faults),
        *_status_topics(sensors, faults),
        _rpm_topic(sensors),
        _throttle_topic(flight, sensors),
    ]
    topics += _battery_topics(sensors, faults)
    if "second-airspeed" in faults:
        topics.append(_unused_airspeed(sensors, errors.seed))
    if "old-firmware" in faults:
        topics = [as_in_2018(topic) for topic in topics]
    absent = {
        "no-airspeed": ("airspeed_validated", "differential_pressure"),
        "pressure-offset": ("airspeed_validated",),  # leaves only the raw pressure
        "no-gps": ("vehicle_gps_position",),
    }
    for fault in absent.keys() & set(faults):
        topics = [topic for topic in topics if topic.name not in absent[fault]]
    dropouts: list[Dropout] = []
    if "dropouts" in faults:
        topics, dropouts = with_dropouts(topics, errors.seed)
    if "airborne-start" in faults:
        topics = begun_at(topics, BOOT_US + airborne_us(flight))
    if "clock-jump" in faults:
        topics = with_clock_set(topics, BOOT_US + int(CLOCK_SET_AT * sensors.duration_s * 1e6), CLOCK_SET_US)
    appended = [CRASH_TEXT] if "appended" in faults else []
    written = [topic for topic in topics if len(topic.time_us)]
    info = {"sys_name": "PX4", "sys_uuid": "0002" + "".join(f"{word:08x}" for word in errors.board).zfill(32)}
    write_ulog(path, UlogContents(written, info, dropouts, PARAMETERS, appended))
    if "truncated" in faults:
        data = path.read_bytes()
        path.write_bytes(data[: int(TRUNCATED_TO * len(data))])


def _times(name: str, sensors: SensorTruth, phase_s: float = 0.0) -> Array:
    return np.asarray(np.arange(phase_s, sensors.duration_s, 1 / RATES_HZ[name]))


def _topic(name: str, t_s: Array, columns: dict[str, Array], instance: int = 0, **integers: Array) -> UlogTopic:
    """Make a topic. columns: written as float; integers: written as uint8."""
    fields: dict[str, NDArray[np.generic]] = {key: np.asarray(x, dtype=np.float32) for key, x in columns.items()}
    fields |= {key: np.asarray(x, dtype=np.uint8) for key, x in integers.items()}
    return UlogTopic(name, BOOT_US + np.round(t_s * 1e6).astype(np.uint64), fields, instance)


def _sensor_topics(sensors: SensorTruth) -> list[UlogTopic]:
    topics = []
    measurements: tuple[tuple[str, Callable[[Array], Array]], ...] = (
        ("vehicle_acceleration", lambda t: sensors.imu(t)[0]),
        ("vehicle_angular_velocity", lambda t: sensors.imu(t)[1]),
    )
    for name, signal in measurements:
        t_s = _times(name, sensors, 0.003)
        topics.append(_topic(name, t_s, {f"xyz[{i}]": part for i, part in enumerate(signal(t_s).T)}))
    t_s = _times("vehicle_attitude", sensors, 0.003)
    roll, pitch, yaw = sensors.autopilot_attitude_rad(t_s).T
    topics.append(_topic("vehicle_attitude", t_s, _quaternion(roll, pitch, yaw)))
    t_s = _times("vehicle_gps_position", sensors, 0.07)
    t_s = t_s + GPS_JITTER_S * np.sin(np.arange(len(t_s)) * 2.4)  # unevenly spaced, but ascending
    gps = sensors.gps(t_s)
    names = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
    velocity = dict(zip(names, gps.velocity_ned_mps.T, strict=True))
    topics.append(_topic("vehicle_gps_position", t_s, velocity, fix_type=np.where(gps.fix, 3, 0)))
    return topics


def _rpm_topic(sensors: SensorTruth) -> UlogTopic:
    t_s = _times("rpm", sensors, 0.03)
    return _topic("rpm", t_s, {"rpm_estimate": 60 * sensors.motor_speed_revps(t_s)})


def _throttle_topic(flight: Flight, sensors: SensorTruth) -> UlogTopic:
    t_s, truth = _times("actuator_controls_0", sensors, 0.01), flight.truth
    throttle = np.interp(t_s, truth["time_s"], np.nan_to_num(truth["throttle"].to_numpy(dtype=float)))
    return _topic("actuator_controls_0", t_s, {f"control[{i}]": throttle if i == 3 else 0 * t_s for i in range(8)})


def _quaternion(roll: Array, pitch: Array, yaw: Array) -> dict[str, Array]:
    (cr, cp, cy), (sr, sp, sy) = ([function(x / 2) for x in (roll, pitch, yaw)] for function in (np.cos, np.sin))
    q = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return {f"q[{i}]": part for i, part in enumerate(q)}


def _air_topics(pitot: AutopilotPitot, sensors: SensorTruth, no_thermometer: bool) -> list[UlogTopic]:
    t_s = _times("airspeed_validated", sensors, 0.05)
    indicated = indicated_airspeed(pitot.pressure_Pa(t_s, VALIDATED_S))
    validated = _topic("airspeed_validated", t_s, {"indicated_airspeed_m_s": indicated},
                       selected_airspeed_index=np.ones(len(t_s)))  # fmt: skip
    t_s = _times("differential_pressure", sensors, 0.31)
    raw = np.round((pitot.pressure_Pa(t_s, 0.0) + RAW_OFFSET_PA) / RAW_STEP_PA) * RAW_STEP_PA
    celsius = 0 * t_s if no_thermometer else pitot.air_K(t_s) + AIRFLOW_WARMTH_K - KELVIN
    differential = _topic("differential_pressure", t_s, {"differential_pressure_pa": raw, "temperature": celsius})
    t_s = _times("vehicle_air_data", sensors, 0.11)
    static, hot = sensors.absolute_pressure_Pa("baro", t_s), pitot.air_K(t_s) + HOT_K - KELVIN
    return [
        validated,
        differential,
        _topic("vehicle_air_data", t_s, {"baro_pressure_pa": static, "baro_temp_celcius": hot}),
    ]


def _unused_airspeed(sensors: SensorTruth, seed: int) -> UlogTopic:
    """Airspeed topic of a second sensor that is connected to nothing."""
    t_s = _times("airspeed_validated", sensors, 0.06)
    wild = 300 * np.abs(white(seed, "open port", t_s))
    return _topic("airspeed", t_s, {"indicated_airspeed_m_s": indicated_airspeed(wild)}, 1)


def _battery_topics(sensors: SensorTruth, faults: Collection[str]) -> list[UlogTopic]:
    t_s = _times("battery_status", sensors, 0.17)
    voltage, current = sensors.battery(t_s)
    current = current + HOVER_A * lifted(t_s, sensors.duration_s, faults)
    if "dead-meter" in faults:
        current = np.full(len(t_s), DEAD_A)

    def battery(instance: int, volt: Array, ampere: Array) -> UlogTopic:
        return _topic("battery_status", t_s, {"voltage_v": volt, "current_a": np.maximum(ampere, 0)}, instance)

    if "esc-power" in faults:
        fields = {"esc_rpm": 60 * sensors.motor_speed_revps(t_s), "esc_voltage": voltage, "esc_current": current}
        return [_topic("esc_status", t_s, {f"esc[0].{name}": x for name, x in fields.items()})]
    if "two-packs" in faults:
        return [battery(0, voltage, 0.55 * current + IDLE_A), battery(1, 0.98 * voltage, 0.45 / 0.98 * current)]
    instance = 1 if "wrong-battery-first" in faults else 0
    batteries = [battery(instance, voltage, current + IDLE_A), battery(1 - instance, 0 * t_s + AVIONICS_V, 0 * t_s)]
    return sorted(batteries, key=lambda battery: battery.instance)


def _status_topics(sensors: SensorTruth, faults: Collection[str]) -> list[UlogTopic]:
    t_s = _times("vehicle_status", sensors)
    kind = np.where(lifted(t_s, sensors.duration_s, faults), 1, 2)
    fixed_wing = _topic("vehicle_status", t_s, {}, vehicle_type=kind, system_type=1 + 0 * t_s)
    t_s = _times("vehicle_land_detected", sensors)
    landed = np.where(sensors.motor_speed_revps(t_s) < 1.0, 1.0, 1.0 if "landed" in faults else 0.0)
    return [fixed_wing, _topic("vehicle_land_detected", t_s, {}, landed=landed)]


# Names in the firmware of 2018, by today's topic and field.
OLD = {
    ("airspeed_validated", "indicated_airspeed_m_s"): ("airspeed", "indicated_airspeed_m_s", 1.0),
    ("vehicle_air_data", "baro_pressure_pa"): ("sensor_baro", "pressure", 0.01),
    ("vehicle_air_data", "baro_temp_celcius"): ("sensor_baro", "temperature", 1.0),
    **{("vehicle_acceleration", f"xyz[{i}]"): ("sensor_combined", f"accelerometer_m_s2[{i}]", 1.0) for i in range(3)},
    ("differential_pressure", "differential_pressure_pa"):
        ("differential_pressure", "differential_pressure_raw_pa", 1.0),
    ("differential_pressure", "temperature"): ("differential_pressure", "temperature", 1.0),
}  # fmt: skip


def as_in_2018(topic: UlogTopic) -> UlogTopic:
    """Convert a topic to the form of old firmware, with static pressure in hPa, and other names."""
    if topic.name not in {name for name, _ in OLD}:
        return topic
    renamed = [(field, *OLD[topic.name, field]) for field in topic.columns if (topic.name, field) in OLD]
    columns: dict[str, NDArray[np.generic]] = {
        name: np.asarray(unit * topic.columns[field].astype(float), dtype=np.float32)
        for field, _, name, unit in renamed
    }
    return replace(topic, name=renamed[0][1], columns=columns)


def airborne_us(flight: Flight) -> int:
    """Time from the beginning of the flight until the aircraft is well above the ground [us]."""
    flying = flight.truth["height_m"].to_numpy() > 15.0
    return int(1e6 * float(flight.truth["time_s"].to_numpy()[int(np.argmax(flying))]))
