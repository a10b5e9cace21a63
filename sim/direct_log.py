"""The log of a flight straight from what the sensors feel, without fake parts and daemon, at many times the pace.

Decoded values are those of the default tray on the simulated clock, to within one count: the same noise (a function of
time), taken at the same instants, in the same steps. So this module knows three things that are written elsewhere too,
in the fake parts and the drivers, and a test holds them together: when a part is read (the daemon's tick, and the time
that transfers take on the bus before it), the part's steps, and the IMU's low-pass filter. What moves the instants of
one individual part is given as `IndividualParts`.

The first two seconds, in which the daemon brings the parts up, are left out; so are its own topics, and the sticks.
"""

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2
from flight.log_writer import LogWriter
from flight.messages import (
    AbsolutePressure,
    Attitude,
    Battery,
    Controls,
    DifferentialPressure,
    Gps,
    Imu,
    Magnetometer,
    Message,
    Rpm,
    Status,
    Time,
)
from sim.sensor_truth import SensorTruth

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

TICK_NS = 40_000_000
FIRST_TICK = 50
I2C_BYTE_NS = 22_500  # nine bits at 400 kHz
SECOND_NS = 1_000_000_000

# MPU-9250: samples of 14 bytes at 200 Hz since its settings were written, in the fourth tick. RM-MPU-9250A sec. 4.5 and
# 4.7: gyroscope 20 Hz and 9.9 ms, accelerometer 41 Hz and 11.8 ms, at an internal 1 kHz.
IMU_SINCE_NS, IMU_RATE_HZ, IMU_STRIDE, IMU_CHUNK = 120_225_000, 200.0, 5, 6000
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
# u-blox M8: NAV-PVT, 100 bytes at 38400 baud, each 0.1 s; units of 1e-7 deg, mm and mm/s.
GPS_PERIOD_NS, GPS_ARRIVES_NS = 100_000_000, round(100 * 10e9 / 38400)
GPS_EPOCH_UNIX_S, LEAP_SECONDS, WEEK_MS = 315_964_800, 18, 604_800_000
# Pulse counter: four bytes at 115200 baud for ten electrical periods, each 10 ms at most; silent for 0.5 s is no data.
RPM_ARRIVES_NS, RPM_INTERVAL_NS, RPM_SILENCE_NS, RPM_GRID_S = round(4 * 10e9 / 115200), 10_000_000, 500_000_000, 2e-3
RPM_LONGEST_US = 1_000_000
# Autopilot at 57600 baud: attitude and servos each tick, sent 20 ms before it, and battery each 0.5 s, since the daemon
# asked for them at the first heartbeat; some 90 bytes of others come before the battery's.
AUTOPILOT_SINCE_NS, AUTOPILOT_EARLIER_NS = 1_060_000_000, 20_000_000
BATTERY_PERIOD_NS, BATTERY_ARRIVES_NS, CELLS = 500_000_000, round(90 * 10e9 / 57600), 4


@dataclass(frozen=True)
class BarometerPart:
    """One individual. conversion_ns: how long it takes; counts: (D1, D2) for pressure [Pa] and temperature [K];
    decoded: temperature [0.01 degC] and pressure [Pa] of (D1, D2); trend: how the driver carries D2 on in between."""

    conversion_ns: int
    counts: Callable[[float, float], tuple[int, int]]
    decoded: Callable[[int, float], tuple[float, float]]
    trend: Callable[[], Any]  # add(time_ns, D2), at(time_ns)


@dataclass(frozen=True)
class IndividualParts:
    """What differs between two parts of a kind."""

    imu_clock_error: float  # its samples come so much too fast
    mag_sensitivity: Array  # (3,), chip axes
    barometers: dict[str, BarometerPart]
    pole_pairs: int


def _seconds(ns: Any) -> Array:
    return np.asarray(ns, dtype=np.float64) * 1e-9


class TimedMessage(NamedTuple):
    tick: int
    time_ns: int  # since the start
    topic: str
    message: Message


class ReadTimes:
    """When each part's turn is in each tick [ns since the start], (n,): one after the other on the bus."""

    def __init__(self, duration_s: float, parts: IndividualParts):
        self.tick_ns: Ints = np.arange(int(np.ceil(duration_s * 1e9 / TICK_NS))) * TICK_NS
        self.imu_period_ns = 1e9 / IMU_RATE_HZ / (1 + parts.imu_clock_error)
        done = np.maximum(self.tick_ns - IMU_SINCE_NS, 0) / self.imu_period_ns
        self.imu_done: Ints = done.astype(np.int64)  # samples so far
        taken = np.diff(self.imu_done, prepend=0)
        # Status, count and identity registers; the samples; each transfer with addresses and register.
        self.mag = self.tick_ns + (13 + 3 + 14 * taken) * I2C_BYTE_NS
        self.baro = self.mag + 12 * I2C_BYTE_NS
        self.static = self.baro + 8 * I2C_BYTE_NS
        self.alpha = self.static + 8 * I2C_BYTE_NS
        self.beta = self.alpha + 5 * I2C_BYTE_NS
        self.airspeed = self.beta + 5 * I2C_BYTE_NS
        self.serial = self.airspeed + 5 * I2C_BYTE_NS

    def ticks(self) -> range:
        return range(FIRST_TICK, len(self.tick_ns))


def write_direct_log(
    log: LogWriter,
    sensor_truth: SensorTruth,
    aircraft: Aircraft,
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
    solutions = list(_gps(sensor_truth, read_times, utc_at_start_ns))
    streams = [_imu(sensor_truth, read_times), _mag(sensor_truth, read_times, parts)]
    streams += [_barometer(sensor_truth, read_times, name, parts.barometers[name]) for name in ("baro", "static")]
    streams += [_bridge(sensor_truth, read_times, name) for name in BRIDGES]
    streams += [
        (timed for timed in solutions if timed.tick >= FIRST_TICK),
        _rpm(sensor_truth, read_times, parts),
        _autopilot(sensor_truth, read_times, aircraft),
        _battery(sensor_truth, read_times),
    ]
    streams.append(_time(read_times, solutions, start_unix_ns))
    for i, timed in enumerate(heapq.merge(*streams, key=lambda timed: timed.tick)):
        log.write(timed.topic, timed.message, time_ns=timed.time_ns + start_unix_ns, tick=timed.tick)
        if progress is not None and i % 4096 == 0:
            progress(timed.time_ns / 1e9)


def _imu(sensor_truth: SensorTruth, read_times: ReadTimes) -> Iterator[TimedMessage]:
    total = int(read_times.imu_done[-1])
    starts = range(0, total, IMU_CHUNK)
    counts = np.concatenate([_imu_counts(sensor_truth, read_times, a, min(a + IMU_CHUNK, total)) for a in starts])
    delay_s = (ACCEL_FILTER[1] + GYRO_FILTER[1]) / 2
    for tick in read_times.ticks():
        taken = counts[read_times.imu_done[tick - 1] : read_times.imu_done[tick]]
        mean = taken.mean(axis=0)
        saturated = np.abs(taken[:, [0, 1, 2, 4, 5, 6]]).max() >= 32767
        message = Imu(
            status=Status.SATURATED if saturated else Status.OK,
            samples=len(taken),
            group_delay_s=delay_s + len(taken) / 2 / IMU_RATE_HZ,
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
    t_s = _seconds(IMU_SINCE_NS + np.arange(first + 1, stop + 1) * read_times.imu_period_ns)
    values[:, 3] = (sensor_truth.imu_temperature_K(t_s) - IMU_ZERO_K) / IMU_KELVIN
    return np.clip(np.rint(values), -32768, 32767)


def _mag(sensor_truth: SensorTruth, read_times: ReadTimes, parts: IndividualParts) -> Iterator[TimedMessage]:
    since_ns = int(read_times.mag[MAG_TICK]) + 3 * I2C_BYTE_NS
    ticks = np.array(read_times.ticks())
    finished = (read_times.mag[ticks] - since_ns - MAG_LASTS_NS) // MAG_PERIOD_NS
    field = sensor_truth.magnetic_field_T(_seconds(since_ns + MAG_LASTS_NS / 2 + finished * MAG_PERIOD_NS))
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
    middle_s = _seconds(began + part.conversion_ns / 2)
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
    t_s = _seconds(turn // BRIDGE_UPDATE_NS * BRIDGE_UPDATE_NS)
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


def _arrivals(read_times: ReadTimes, arrived_ns: Ints) -> Ints:
    """The tick in which something that arrived at these instants is read."""
    return np.searchsorted(read_times.serial, arrived_ns)


def _gps(sensor_truth: SensorTruth, read_times: ReadTimes, utc_at_start_ns: int) -> Iterator[TimedMessage]:
    sent_ns: Ints = np.arange(read_times.tick_ns[-1] // GPS_PERIOD_NS + 1) * GPS_PERIOD_NS
    ticks = _arrivals(read_times, sent_ns + GPS_ARRIVES_NS)
    found = sensor_truth.gps(_seconds(sent_ns))
    for i, tick in enumerate(ticks.tolist()):
        if tick >= len(read_times.serial):
            return
        valid_us = round(found.valid_at_s[i] * 1e6)
        utc_ns = utc_at_start_ns + valid_us * 1000
        itow_ms = round((utc_ns - (GPS_EPOCH_UNIX_S - LEAP_SECONDS) * SECOND_NS) / 1e6) % WEEK_MS
        if found.fix[i]:
            north, east, down = (round(v * 1e3) / 1e3 for v in found.velocity_ned_mps[i].tolist())
            height = round(found.height_msl_m[i] * 1e3) / 1e3
            message = Gps(
                itow_ms=itow_ms,
                fix_type=3,
                satellites=12,
                utc_ns=utc_ns,
                latitude_deg=round(found.latitude_deg[i] * 1e7) / 1e7,
                longitude_deg=round(found.longitude_deg[i] * 1e7) / 1e7,
                height_m=height,
                height_msl_m=height,
                velocity_north_mps=north,
                velocity_east_mps=east,
                velocity_down_mps=down,
                horizontal_accuracy_m=round(found.horizontal_accuracy_m[i] * 1e3) / 1e3,
                vertical_accuracy_m=round(found.vertical_accuracy_m[i] * 1e3) / 1e3,
                speed_accuracy_mps=round(found.speed_accuracy_mps[i] * 1e3) / 1e3,
            )
        else:
            message = Gps(status=Status.NO_DATA, itow_ms=itow_ms, fix_type=0, satellites=2)
        yield TimedMessage(tick, int(read_times.serial[tick]), "/gps", message)


def _rpm(sensor_truth: SensorTruth, read_times: ReadTimes, parts: IndividualParts) -> Iterator[TimedMessage]:
    """Every tenth commutation pulse; the newest period of a tick."""
    t_s = np.arange(int(read_times.serial[-1] * 1e-9 / RPM_GRID_S) + 2).astype(np.float64) * RPM_GRID_S
    rate_Hz = np.maximum(sensor_truth.motor_speed_revps(t_s), 0.0) * parts.pole_pairs / 10
    phase = np.concatenate([[0.0], np.cumsum((rate_Hz[:-1] + rate_Hz[1:]) * RPM_GRID_S / 2)])
    pulses_s = np.interp(np.arange(1, np.floor(phase[-1]) + 1), phase, t_s)
    periods_us = np.rint(np.diff(pulses_s) * 1e6).astype(int).tolist()
    sent: list[tuple[int, int]] = []
    for at_ns, period_us in zip(np.rint(pulses_s[1:] * 1e9).astype(int).tolist(), periods_us, strict=True):
        if period_us <= RPM_LONGEST_US and (not sent or at_ns - sent[-1][0] >= RPM_INTERVAL_NS):
            sent.append((at_ns, period_us))
    newest: dict[int, int] = {}
    arrived = np.array([at_ns + RPM_ARRIVES_NS for at_ns, _ in sent], dtype=np.int64)
    for tick, (_, period_us) in zip(_arrivals(read_times, arrived).tolist(), sent, strict=True):
        newest[tick] = period_us
    last_ns = 0
    for tick in read_times.ticks():
        now_ns = int(read_times.serial[tick])
        period_us = newest.get(tick, 0)
        if period_us:
            last_ns = now_ns
            speed = 10 * 1e6 / (period_us * parts.pole_pairs)
            yield TimedMessage(tick, now_ns, "/rpm", Rpm(period_us=period_us, motor_speed_revps=speed))
        elif now_ns - last_ns >= RPM_SILENCE_NS:
            yield TimedMessage(tick, now_ns, "/rpm", Rpm(status=Status.NO_DATA))


def _autopilot(sensor_truth: SensorTruth, read_times: ReadTimes, aircraft: Aircraft) -> Iterator[TimedMessage]:
    sent_s = _seconds(read_times.tick_ns - AUTOPILOT_EARLIER_NS)
    pulses = np.rint(sensor_truth.servo_pulses_us(sent_s)).astype(int).tolist()
    attitude = sensor_truth.autopilot_attitude_rad(sent_s).astype(np.float32).tolist()
    surfaces = (aircraft.elevator, aircraft.aileron, aircraft.rudder)
    for tick in read_times.ticks():
        now_ns, pulse_us = int(read_times.serial[tick]), pulses[tick]
        roll, pitch, yaw = attitude[tick]
        yield TimedMessage(tick, now_ns, "/attitude", Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw))
        elevator, aileron, rudder = (s.angle_of_pulse_rad(pulse_us[s.channel - 1]) for s in surfaces)
        throttle = (pulse_us[aircraft.propulsion.throttle_channel - 1] - 1000) / 1000
        message = Controls(
            pulse_us=pulse_us,
            elevator_rad=elevator,
            aileron_rad=aileron,
            rudder_rad=rudder,
            throttle=min(max(throttle, 0.0), 1.0),
        )
        yield TimedMessage(tick, now_ns, "/controls", message)


def _battery(sensor_truth: SensorTruth, read_times: ReadTimes) -> Iterator[TimedMessage]:
    sent_ns: Ints = np.arange(AUTOPILOT_SINCE_NS, int(read_times.tick_ns[-1]), BATTERY_PERIOD_NS)
    voltage, current = sensor_truth.battery(_seconds(sent_ns))
    for i, tick in enumerate(_arrivals(read_times, sent_ns + BATTERY_ARRIVES_NS).tolist()):
        if FIRST_TICK <= tick < len(read_times.serial):
            cell_mV, centiampere = round(voltage[i] * 1e3) // CELLS, round(current[i] * 1e2)
            message = Battery(
                voltage_V=cell_mV * CELLS / 1e3, current_A=centiampere / 1e2 if centiampere >= 0 else None
            )
            yield TimedMessage(tick, int(read_times.serial[tick]), "/battery", message)


def _time(read_times: ReadTimes, solutions: list[TimedMessage], start_unix_ns: int) -> Iterator[TimedMessage]:
    latest = {timed.tick: timed for timed in solutions}
    gps: TimedMessage | None = None
    for tick in range(len(read_times.serial)):
        gps = latest.get(tick, gps)
        if tick >= FIRST_TICK and tick % (SECOND_NS // TICK_NS) == 0:
            now_ns = int(read_times.serial[tick])
            utc_ns = None
            if gps is not None and isinstance(gps.message, Gps) and gps.message.utc_ns is not None:
                utc_ns = gps.message.utc_ns + now_ns - gps.time_ns
            message = Time(monotonic_ns=now_ns, system_ns=now_ns + start_unix_ns, gps_utc_ns=utc_ns)
            yield TimedMessage(tick, now_ns, "/time", message)
