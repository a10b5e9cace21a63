"""Writes the log of a simulated flight directly from the sensor inputs, without buses and daemon; much faster.

Decoded values equal those of the default tray on the simulated clock to within one count: same noise (a function of
time), same sample times, and the counts of the fakes. Two things are defined here as well as in daemon and drivers, and
a test compares both logs: when a part is read (the daemon's tick plus the bus transfers before it), and how counts
become SI values.

The log has no messages of the first two seconds, in which the daemon starts the parts, no topics of the daemon itself,
and no stick positions.
"""

import heapq
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.complete_aircraft import CompleteAircraft
from flight.log_writer import LogWriter
from flight.messages import (
    AbsolutePressure,
    DifferentialPressure,
    Imu,
    Magnetometer,
    Status,
)
from hw_fakes import ak8963, bridge, mpu9250, ms56xx
from hw_fakes.direct_log_serial import (
    autopilot_messages,
    battery_messages,
    gps_messages,
    rpm_messages,
    time_messages,
)
from hw_fakes.direct_log_timing import (
    FIRST_TICK,
    I2C_BYTE_NS,
    IMU_RATE_HZ,
    IMU_SINCE_NS,
    SECOND_NS,
    Compensation,
    ReadTimes,
    TimedMessage,
    seconds,
)
from hw_fakes.ms56xx import FakeMS56xx, pressure_counts, temperature_counts
from hw_fakes.tray import UTC_AT_START, FakeTray
from sim.sensor_truth import SensorTruth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

IMU_CHUNK = 6000  # samples at once
# As the driver sets it: gyroscope 20 Hz and +-500 deg/s, accelerometer 41 Hz and +-8 g, 200 Hz of the internal 1 kHz.
IMU = mpu9250.Sampling(
    gyro=mpu9250.GYRO_FILTERS[4],
    accel=mpu9250.ACCEL_FILTERS[3],
    gyro_count_radps=mpu9250.gyro_count_radps(1),
    accel_count_mps2=mpu9250.accel_count_mps2(2),
    stride=5,
)
MAG_TICK = 16  # its first measurement begins in the seventeenth
MAG_PERIOD_NS, MAG_T = ak8963.PERIOD_NS[ak8963.CONTINUOUS_100_HZ], ak8963.FULL_SCALE_T / ak8963.FULL_SCALE_COUNTS
# The drivers wait for the slowest part at the highest oversampling. Temperature once a second, in place of a pressure.
OVERSAMPLING = 0x8
CONVERSION_NS = ms56xx.CONVERSION_NS[OVERSAMPLING][1]
BRIDGES = {
    "alpha": bridge.MS4515DO_DS5A002DP,
    "beta": bridge.MS4515DO_DS5A002DP,
    "airspeed": bridge.SSCDRRN005ND2A5,
}
BRIDGE_KELVIN = bridge.TEMPERATURE_SPAN_K / bridge.TEMPERATURE_COUNTS


def write_direct_log(
    log: LogWriter,
    sensor_truth: SensorTruth,
    tray: FakeTray,
    aircraft: CompleteAircraft,
    compensations: dict[str, Compensation],
    *,
    start_unix_ns: int,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the messages of a whole flight into `log`.

    tray: parts of this flight. compensations: of "baro" and "static". start_unix_ns: what the computer takes for Unix
    time at the start; it is `hw_fakes.tray.UTC_AT_START`.
    """
    read_times = ReadTimes(sensor_truth.duration_s, tray.imu.clock_error)
    solutions = list(gps_messages(sensor_truth, read_times, int(UTC_AT_START.timestamp() * 1e9)))
    streams = [_imu(sensor_truth, read_times), _mag(sensor_truth, read_times, tray.magnetometer.adjustment)]
    for name, part in (("baro", tray.baro), ("static", tray.static)):
        streams.append(_barometer(sensor_truth, read_times, name, part, compensations[name]))
    streams += [_bridge(sensor_truth, read_times, name) for name in BRIDGES]
    streams += [
        (timed for timed in solutions if timed.tick >= FIRST_TICK),
        rpm_messages(tray.esc_counter, read_times, aircraft.propulsion.pole_pairs),
        autopilot_messages(sensor_truth, read_times, aircraft),
        battery_messages(sensor_truth, read_times),
    ]
    streams.append(time_messages(read_times, solutions, start_unix_ns))
    for i, timed in enumerate(heapq.merge(*streams, key=lambda timed: timed.tick)):
        log.write(timed.topic, timed.message, time_ns=timed.time_ns + start_unix_ns, tick=timed.tick)
        if progress is not None and i % 4096 == 0:
            progress(timed.time_ns / 1e9)


def _imu(sensor_truth: SensorTruth, read_times: ReadTimes) -> Iterator[TimedMessage]:
    total = int(read_times.imu_done[-1])
    t_s = seconds(IMU_SINCE_NS + np.arange(1, total + 1) * read_times.imu_period_ns)
    period_s = read_times.imu_period_ns * 1e-9
    chunks = [t_s[begin : begin + IMU_CHUNK] for begin in range(0, total, IMU_CHUNK)]
    counts = np.concatenate([mpu9250.counts(sensor_truth, chunk, period_s, IMU) for chunk in chunks])
    for tick in read_times.ticks():
        taken = counts[read_times.imu_done[tick - 1] : read_times.imu_done[tick]]
        mean = taken.mean(axis=0)
        mean_s = len(taken) / 2 / IMU_RATE_HZ
        saturated = np.abs(taken[:, [0, 1, 2, 4, 5, 6]]).max() >= 32767
        message = Imu(
            status=Status.SATURATED if saturated else Status.OK,
            samples=len(taken),
            group_delay_s=IMU.gyro[1] + mean_s,
            specific_force_group_delay_s=IMU.accel[1] + mean_s,
            temperature_counts=float(mean[3]),
            temperature_K=float(mean[3] / mpu9250.TEMPERATURE_COUNTS_PER_K + mpu9250.TEMPERATURE_ZERO_K),
            **_xyz("accel_{}_counts", mean[:3]),
            **_xyz("gyro_{}_counts", mean[4:]),
            **_xyz("specific_force_{}_mps2", mean[:3] * IMU.accel_count_mps2),
            **_xyz("angular_rate_{}_radps", mean[4:] * IMU.gyro_count_radps),
        )
        yield TimedMessage(tick, int(read_times.tick_ns[tick]), "/imu", message)


def _xyz(name: str, values: Any) -> dict[str, Any]:
    return {name.format(axis): value for axis, value in zip("xyz", values.tolist(), strict=True)}


def _mag(sensor_truth: SensorTruth, read_times: ReadTimes, adjustment: Ints) -> Iterator[TimedMessage]:
    since_ns = int(read_times.mag[MAG_TICK]) + 3 * I2C_BYTE_NS
    ticks = np.array(read_times.ticks())
    finished = (read_times.mag[ticks] - since_ns - ak8963.MEASUREMENT_NS) // MAG_PERIOD_NS
    field = sensor_truth.magnetic_field_T(seconds(since_ns + ak8963.MEASUREMENT_NS / 2 + finished * MAG_PERIOD_NS))
    counts = ak8963.counts(field, adjustment)
    decoded = counts * ak8963.sensitivity(adjustment) * MAG_T @ ak8963.BODY_TO_CHIP
    for tick, count, value in zip(ticks.tolist(), counts, decoded, strict=True):
        message = Magnetometer(**_xyz("{}_counts", count), **_xyz("field_{}_T", value))
        yield TimedMessage(tick, int(read_times.mag[tick]), "/mag", message)


def _barometer(
    sensor_truth: SensorTruth, read_times: ReadTimes, name: str, part: FakeMS56xx, compensation: Compensation
) -> Iterator[TimedMessage]:
    """The driver's two kinds of conversion, one a tick; the result of each is read in the tick that follows."""
    began = (getattr(read_times, name) + 8 * I2C_BYTE_NS)[:-1]
    middle_s = seconds(began + part.conversion_ns(OVERSAMPLING) / 2)
    at_s = np.rint(middle_s / ms56xx.PRESSURE_GRID_S) * ms56xx.PRESSURE_GRID_S
    pressure = sensor_truth.absolute_pressure_Pa(name, at_s).tolist()
    at_s = np.rint(middle_s / ms56xx.TEMPERATURE_GRID_S) * ms56xx.TEMPERATURE_GRID_S
    kelvin = sensor_truth.transducer_temperature_K(name, at_s).tolist()
    now = getattr(read_times, name).tolist()
    D2, due_ns, of_temperature, trend = 0, 0, True, compensation.trend()
    for tick in range(2, len(now)):
        fresh = temperature_counts(part.part, part.prom, kelvin[tick - 1])
        D1 = pressure_counts(part.part, part.prom, pressure[tick - 1], fresh)
        message, time_ns = AbsolutePressure(status=Status.BUSY), now[tick]
        if of_temperature:
            D2, due_ns = fresh, now[tick] + SECOND_NS
            trend.add(now[tick - 1] + CONVERSION_NS // 2, D2)
        else:
            centi_degC, value = compensation.decoded(D1, trend.at(now[tick - 1] + CONVERSION_NS // 2))
            message = AbsolutePressure(
                pressure_counts=D1, temperature_counts=D2, pressure_Pa=value, temperature_K=centi_degC / 100 + 273.15
            )
            time_ns = now[tick - 1] + CONVERSION_NS // 2
        of_temperature = now[tick] >= due_ns
        if tick >= FIRST_TICK:
            yield TimedMessage(tick, time_ns, f"/{name}", message)


def _bridge(sensor_truth: SensorTruth, read_times: ReadTimes, name: str) -> Iterator[TimedMessage]:
    ticks = np.array(read_times.ticks())
    part = BRIDGES[name]
    turn = getattr(read_times, name)[ticks]
    t_s = seconds(turn // bridge.UPDATE_NS * bridge.UPDATE_NS)
    per_count = 2 * part.range_Pa / (part.high_counts - part.low_counts)
    pressure, kelvin = bridge.counts(
        part, sensor_truth.differential_pressure_Pa(name, t_s), sensor_truth.transducer_temperature_K(name, t_s)
    )
    for tick, time_ns, p, T in zip(ticks.tolist(), turn.tolist(), pressure.tolist(), kelvin.tolist(), strict=True):
        message = DifferentialPressure(
            status=Status.SATURATED if p in (0, bridge.FULL_COUNT) else Status.OK,
            pressure_counts=p,
            temperature_counts=T,
            differential_pressure_Pa=(p - part.low_counts) * per_count - part.range_Pa,
            temperature_K=T * BRIDGE_KELVIN + bridge.TEMPERATURE_LOW_K,
        )
        yield TimedMessage(tick, time_ns, f"/probe/{name}", message)
