"""Writes the log of a simulated flight directly from the sensor inputs, without fake hardware and daemon; much faster.

Decoded values equal those of the default tray on the simulated clock to within one count: same noise (a function of
time), same sample times, same quantisation. Three things are therefore defined here as well as in the fakes and the
drivers, and a test compares both: when a part is read (the daemon's tick plus the bus transfers before it), the
quantisation of each part, and the IMU's low-pass filter. `IndividualParts` has what differs between parts of a kind.

The log has no messages of the first two seconds, in which the daemon starts the parts, no topics of the daemon itself,
and no stick positions.
"""

import heapq
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flight.atmosphere import GRAVITY_MPS2
from flight.complete_aircraft import CompleteAircraft
from flight.log_writer import LogWriter
from flight.messages import (
    AbsolutePressure,
    DifferentialPressure,
    Imu,
    Magnetometer,
    Status,
)
from sim.direct_log_serial import (
    autopilot_messages,
    battery_messages,
    gps_messages,
    rpm_messages,
    time_messages,
)
from sim.direct_log_timing import (
    FIRST_TICK,
    I2C_BYTE_NS,
    IMU_RATE_HZ,
    IMU_SINCE_NS,
    SECOND_NS,
    BarometerPart,
    IndividualParts,
    ReadTimes,
    TimedMessage,
    seconds,
)
from sim.sensor_truth import SensorTruth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# MPU-9250: samples of 14 bytes at 200 Hz since its settings were written, in the fourth tick. RM-MPU-9250A sec. 4.5 and
# 4.7: gyroscope 20 Hz and 9.9 ms, accelerometer 41 Hz and 11.8 ms, at an internal 1 kHz.
IMU_STRIDE, IMU_CHUNK = 5, 6000
ACCEL_FILTER, GYRO_FILTER = (41.0, 11.8e-3), (20.0, 9.9e-3)
ACCEL_MPS2, GYRO_RADPS = GRAVITY_MPS2 / 4096, np.deg2rad(1 / 65.5)  # a count at +-8 g and +-500 deg/s (PS 3.1, 3.2)
IMU_KELVIN, IMU_ZERO_K = 1 / 333.87, 294.15  # PS 3.4.2
# AK8963 (MS1356-E-02): every 10 ms since the seventeenth tick, 7.2 ms each; 4912 uT are 32760 counts.
MAG_TICK, MAG_PERIOD_NS, MAG_LASTS_NS, MAG_T = 16, 10_000_000, 7_200_000, 4912e-6 / 32760
# MS5611, MS5805 (p. 3): 8.22 to 9.04 ms at the highest oversampling; the driver takes the longest. Temperature once a
# second, in the place of a pressure. The fakes know the pressure each millisecond, the temperature each 0.1 s.
CONVERSION_NS, PRESSURE_GRID_S, TEMPERATURE_GRID_S = 9_040_000, 1e-3, 0.1
# MS4515DO type A, 2 inH2O: 10 to 90 % of 16383; SSC 5 inH2O, output A: 1638 to 14746. Temperature -50 to 150 degC over
# 2047 counts. An update each half millisecond. Range [Pa], lowest and highest counts.
INCH_OF_WATER_PA = 249.08891
BRIDGES = {
    "alpha": (2 * INCH_OF_WATER_PA, 1638.3, 14744.7),
    "beta": (2 * INCH_OF_WATER_PA, 1638.3, 14744.7),
    "airspeed": (5 * INCH_OF_WATER_PA, 1638.0, 14746.0),
}
BRIDGE_UPDATE_NS, BRIDGE_KELVIN, BRIDGE_ZERO_K = 500_000, 200 / 2047, 223.15


def write_direct_log(
    log: LogWriter,
    sensor_truth: SensorTruth,
    aircraft: CompleteAircraft,
    parts: IndividualParts,
    *,
    start_unix_ns: int,
    utc_at_start_ns: int,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the messages of a whole flight into `log`.

    start_unix_ns: what the computer takes for Unix time at the start; utc_at_start_ns: what it is.
    """
    read_times = ReadTimes(sensor_truth.duration_s, parts)
    solutions = list(gps_messages(sensor_truth, read_times, utc_at_start_ns))
    streams = [_imu(sensor_truth, read_times), _mag(sensor_truth, read_times, parts)]
    streams += [_barometer(sensor_truth, read_times, name, parts.barometers[name]) for name in ("baro", "static")]
    streams += [_bridge(sensor_truth, read_times, name) for name in BRIDGES]
    streams += [
        (timed for timed in solutions if timed.tick >= FIRST_TICK),
        rpm_messages(sensor_truth, read_times, parts),
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
    starts = range(0, total, IMU_CHUNK)
    counts = np.concatenate([_imu_counts(sensor_truth, read_times, a, min(a + IMU_CHUNK, total)) for a in starts])
    for tick in read_times.ticks():
        taken = counts[read_times.imu_done[tick - 1] : read_times.imu_done[tick]]
        mean = taken.mean(axis=0)
        mean_s = len(taken) / 2 / IMU_RATE_HZ
        saturated = np.abs(taken[:, [0, 1, 2, 4, 5, 6]]).max() >= 32767
        message = Imu(
            status=Status.SATURATED if saturated else Status.OK,
            samples=len(taken),
            group_delay_s=GYRO_FILTER[1] + mean_s,
            specific_force_group_delay_s=ACCEL_FILTER[1] + mean_s,
            temperature_counts=float(mean[3]),
            temperature_K=float(mean[3] * IMU_KELVIN + IMU_ZERO_K),
            **_xyz("accel_{}_counts", mean[:3]),
            **_xyz("gyro_{}_counts", mean[4:]),
            **_xyz("specific_force_{}_mps2", mean[:3] * ACCEL_MPS2),
            **_xyz("angular_rate_{}_radps", mean[4:] * GYRO_RADPS),
        )
        yield TimedMessage(tick, int(read_times.tick_ns[tick]), "/imu", message)


def _xyz(name: str, values: Any) -> dict[str, Any]:
    return {name.format(axis): value for axis, value in zip("xyz", values.tolist(), strict=True)}


def _imu_counts(sensor_truth: SensorTruth, read_times: ReadTimes, first: int, stop: int) -> Array:
    """Samples `first` to `stop`, counts (n, 7): specific force, temperature, angular rate."""
    step_s = read_times.imu_period_ns * 1e-9 / IMU_STRIDE
    since_s = IMU_SINCE_NS * 1e-9
    values = np.empty((stop - first, 7))
    for which, (corner_Hz, delay_s), count, columns in (
        (0, ACCEL_FILTER, ACCEL_MPS2, slice(0, 3)),
        (1, GYRO_FILTER, GYRO_RADPS, slice(4, 7)),
    ):
        pole = float(np.exp(-2 * np.pi * corner_Hz * step_s))
        known = int(np.ceil(10 / (2 * np.pi * corner_Hz * step_s))) + IMU_STRIDE  # ten time constants before
        inside = np.arange(first * IMU_STRIDE + 1 - known, stop * IMU_STRIDE + 1)
        # The low-pass follows a ramp pole / (1 - pole) steps late; the rest of the delay is a pure one.
        input_s = np.asarray(since_s + inside * step_s - (delay_s - pole / (1 - pole) * step_s), dtype=np.float64)
        x = sensor_truth.imu(input_s)[which]
        y = lfilter([1 - pole], [1.0, -pole], x, axis=0, zi=x[:1] * pole)[0]
        values[:, columns] = y[known + IMU_STRIDE - 1 :: IMU_STRIDE] / count
    t_s = seconds(IMU_SINCE_NS + np.arange(first + 1, stop + 1) * read_times.imu_period_ns)
    values[:, 3] = (sensor_truth.imu_temperature_K(t_s) - IMU_ZERO_K) / IMU_KELVIN
    return np.clip(np.rint(values), -32768, 32767)


def _mag(sensor_truth: SensorTruth, read_times: ReadTimes, parts: IndividualParts) -> Iterator[TimedMessage]:
    since_ns = int(read_times.mag[MAG_TICK]) + 3 * I2C_BYTE_NS
    ticks = np.array(read_times.ticks())
    finished = (read_times.mag[ticks] - since_ns - MAG_LASTS_NS) // MAG_PERIOD_NS
    field = sensor_truth.magnetic_field_T(seconds(since_ns + MAG_LASTS_NS / 2 + finished * MAG_PERIOD_NS))
    # The chip's x and y change places with the body's, its z points the other way (PS-MPU-9250A sec. 9.1).
    counts = np.rint(field[:, [1, 0, 2]] * [1, 1, -1] / MAG_T / parts.mag_sensitivity).astype(int)
    decoded = (counts * parts.mag_sensitivity * MAG_T)[:, [1, 0, 2]] * [1, 1, -1]
    for tick, count, value in zip(ticks.tolist(), counts, decoded, strict=True):
        message = Magnetometer(**_xyz("{}_counts", count), **_xyz("field_{}_T", value))
        yield TimedMessage(tick, int(read_times.mag[tick]), "/mag", message)


def _barometer(
    sensor_truth: SensorTruth, read_times: ReadTimes, name: str, part: BarometerPart
) -> Iterator[TimedMessage]:
    """The driver's two kinds of conversion, one a tick; the result of each is read in the tick that follows."""
    began = (getattr(read_times, name) + 8 * I2C_BYTE_NS)[:-1]
    middle_s = seconds(began + part.conversion_ns / 2)
    pressure = sensor_truth.absolute_pressure_Pa(name, np.rint(middle_s / PRESSURE_GRID_S) * PRESSURE_GRID_S).tolist()
    at_s = np.rint(middle_s / TEMPERATURE_GRID_S) * TEMPERATURE_GRID_S
    kelvin = sensor_truth.transducer_temperature_K(name, at_s).tolist()
    now = getattr(read_times, name).tolist()
    D2, due_ns, of_temperature, trend = 0, 0, True, part.trend()
    for tick in range(2, len(now)):
        D1, fresh = part.counts(pressure[tick - 1], kelvin[tick - 1])
        message, time_ns = AbsolutePressure(status=Status.BUSY), now[tick]
        if of_temperature:
            D2, due_ns = fresh, now[tick] + SECOND_NS
            trend.add(now[tick - 1] + CONVERSION_NS // 2, D2)
        else:
            centi_degC, value = part.decoded(D1, trend.at(now[tick - 1] + CONVERSION_NS // 2))
            message = AbsolutePressure(
                pressure_counts=D1, temperature_counts=D2, pressure_Pa=value, temperature_K=centi_degC / 100 + 273.15
            )
            time_ns = now[tick - 1] + CONVERSION_NS // 2
        of_temperature = now[tick] >= due_ns
        if tick >= FIRST_TICK:
            yield TimedMessage(tick, time_ns, f"/{name}", message)


def _bridge(sensor_truth: SensorTruth, read_times: ReadTimes, name: str) -> Iterator[TimedMessage]:
    ticks = np.array(read_times.ticks())
    range_Pa, low, high = BRIDGES[name]
    turn = getattr(read_times, name)[ticks]
    t_s = seconds(turn // BRIDGE_UPDATE_NS * BRIDGE_UPDATE_NS)
    per_count = 2 * range_Pa / (high - low)
    pressure = np.rint(low + (sensor_truth.differential_pressure_Pa(name, t_s) + range_Pa) / per_count)
    pressure = np.clip(pressure, 0, 16383).astype(int)
    kelvin = np.rint((sensor_truth.transducer_temperature_K(name, t_s) - BRIDGE_ZERO_K) / BRIDGE_KELVIN).astype(int)
    for tick, time_ns, p, T in zip(ticks.tolist(), turn.tolist(), pressure.tolist(), kelvin.tolist(), strict=True):
        message = DifferentialPressure(
            status=Status.SATURATED if p in (0, 16383) else Status.OK,
            pressure_counts=p,
            temperature_counts=T,
            differential_pressure_Pa=(p - low) * per_count - range_Pa,
            temperature_K=T * BRIDGE_KELVIN + BRIDGE_ZERO_K,
        )
        yield TimedMessage(tick, time_ns, f"/probe/{name}", message)
