"""Writes the log of a simulated flight directly from the sensor inputs, much faster than through buses and daemon.

Decoded values equal those of the default tray on the simulated clock within one count: they have the same noise (a
function of time), the same sample times, and the fakes' counts. Two things are defined here as well as in daemon and
drivers, and a test compares both logs: when a part is read (the daemon's tick plus the bus transfers before it), and
how counts become SI values.

The log has no messages of the first two seconds, in which the daemon starts the parts, no topics of the daemon itself,
and no stick positions.
"""

import heapq
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.flight.complete_aircraft import CompleteAircraft
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import (
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
from flightpower.hw_fakes import ak8963, bridge, mpu9250, ms56xx
from flightpower.hw_fakes.esc_counter import BAUD, FakeEscCounter
from flightpower.hw_fakes.ms56xx import FakeMS56xx, pressure_counts, temperature_counts
from flightpower.hw_fakes.tray import FakeTray
from flightpower.hw_fakes.ublox import GPS_EPOCH, LEAP_SECONDS, WEEK_MS
from flightpower.sim.sensor_truth import SensorTruth

Ints = NDArray[np.int64]

TICK_NS = 40_000_000
FIRST_TICK = 50
I2C_BYTE_NS = 22_500  # nine bits at 400 kHz
SECOND_NS = 1_000_000_000
# The MPU-9250 samples at 200 Hz once its settings are written, in the fourth tick.
IMU_TICK, AUDIT_TICKS = 5, 50  # first tick with samples; two in so many ticks audit other registers
IMU_SINCE_NS, IMU_RATE_HZ = 120_225_000, 200.0


class Compensation(NamedTuple):
    """The driver's compensation of a barometer's counts."""

    decoded: Callable[[int, float], tuple[float, float]]  # temperature [0.01 degC] and pressure [Pa] from (D1, D2)
    trend: Callable[[], Any]  # makes its extrapolation of D2, with add(time_ns, D2) and at(time_ns)


def seconds(ns: Any) -> Array:
    return np.asarray(ns, dtype=np.float64) * 1e-9


class TimedMessage(NamedTuple):
    tick: int
    time_ns: int  # time since the start
    topic: str
    message: Message


class ReadTimes:
    """The time at which each part is read in each tick [ns since the start], (n,): in sequence on the bus."""

    def __init__(self, duration_s: float, imu_clock_error: float):
        self.tick_ns: Ints = np.arange(int(np.ceil(duration_s * 1e9 / TICK_NS)), dtype=np.int64) * TICK_NS
        self.imu_period_ns = 1e9 / IMU_RATE_HZ / (1 + imu_clock_error)
        done = np.maximum(self.tick_ns - IMU_SINCE_NS, 0) / self.imu_period_ns
        self.imu_done: Ints = done.astype(np.int64)  # number of samples so far
        taken = np.diff(self.imu_done, prepend=0)
        # The driver's audit reads ranges and filters; in one tick of AUDIT_TICKS it reads up to FIFO_EN, in another
        # only the bypass.
        in_turn = (np.arange(len(self.tick_ns)) - IMU_TICK + 1) % AUDIT_TICKS
        audited = np.where(in_turn == 0, 1, np.where(in_turn == AUDIT_TICKS // 2, 11, 5))
        # Transfers of status, count and identity registers, of the samples, and of the count again, with addresses and
        # register.
        self.mag = self.tick_ns + (13 + 3 + 14 * taken + 5 + 3 + audited) * I2C_BYTE_NS
        self.baro = self.mag + 12 * I2C_BYTE_NS
        self.static = self.baro + 8 * I2C_BYTE_NS
        self.alpha = self.static + 8 * I2C_BYTE_NS
        self.beta = self.alpha + 5 * I2C_BYTE_NS
        self.airspeed = self.beta + 5 * I2C_BYTE_NS
        self.serial = self.airspeed + 5 * I2C_BYTE_NS

        self.twice = {name: np.zeros(len(self.tick_ns), dtype=bool) for name in BRIDGES}

    def read_twice(self, sensor_truth: SensorTruth) -> None:
        """Delay the reads that follow on the bus when a transducer is read twice because its pressure jumped."""
        for i, name in enumerate(BRIDGES):
            part = BRIDGES[name]
            pressure, _ = _bridge_counts(sensor_truth, getattr(self, name), name)
            most = BRIDGE_JUMP_PA * (part.high_counts - part.low_counts) / (2 * part.range_Pa)
            self.twice[name] = np.abs(np.diff(pressure.astype(np.int64), prepend=pressure[0])) > most
            for later in (*[*BRIDGES][i + 1 :], "serial"):
                setattr(self, later, getattr(self, later) + 5 * I2C_BYTE_NS * self.twice[name])

    def ticks(self) -> range:
        return range(FIRST_TICK, len(self.tick_ns))


BRIDGE_JUMP_PA = 10.0  # a jump between two ticks after which the driver reads a transducer again
IMU_CHUNK = 6000  # number of samples computed at once
# The driver's settings: gyroscope 20 Hz and +-500 deg/s, accelerometer 41 Hz and +-8 g, 200 Hz of the internal 1 kHz.
IMU = mpu9250.Sampling(
    gyro=mpu9250.GYRO_FILTERS[4],
    accel=mpu9250.ACCEL_FILTERS[3],
    gyro_count_radps=mpu9250.gyro_count_radps(1),
    accel_count_mps2=mpu9250.accel_count_mps2(2),
    stride=5,
)
MAG_TICK = 16  # the magnetometer's first measurement begins in the seventeenth tick
MAG_PERIOD_NS, MAG_T = ak8963.PERIOD_NS[ak8963.CONTINUOUS_100_HZ], ak8963.FULL_SCALE_T / ak8963.FULL_SCALE_COUNTS
# The drivers wait for the slowest part at the highest oversampling. Once a second they read temperature instead of
# pressure.
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

    tray: parts of this flight. compensations: of "baro" and "static". start_unix_ns: Unix time at the start as the
    computer believes it; the tray has the true time.
    """
    read_times = ReadTimes(sensor_truth.duration_s, tray.imu.clock_error)
    read_times.read_twice(sensor_truth)
    solutions = list(gps_messages(sensor_truth, read_times, int(tray.utc_at_start.timestamp() * 1e9)))
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
    """Simulate the driver's two kinds of conversion, one per tick; the result of each is read in the next tick."""
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


def _bridge_counts(sensor_truth: SensorTruth, read_ns: Ints, name: str) -> tuple[Ints, Ints]:
    """Pressure and temperature (n,) [counts] of a transducer that is read at times read_ns (n,)."""
    t_s = seconds(read_ns // bridge.UPDATE_NS * bridge.UPDATE_NS)
    return bridge.counts(
        BRIDGES[name],
        sensor_truth.differential_pressure_Pa(name, t_s),
        sensor_truth.transducer_temperature_K(name, t_s),
    )


def _bridge(sensor_truth: SensorTruth, read_times: ReadTimes, name: str) -> Iterator[TimedMessage]:
    ticks = np.array(read_times.ticks())
    part = BRIDGES[name]
    turn = getattr(read_times, name)[ticks]
    per_count = 2 * part.range_Pa / (part.high_counts - part.low_counts)
    last_ns = turn + 5 * I2C_BYTE_NS * read_times.twice[name][ticks]
    pressure, kelvin = _bridge_counts(sensor_truth, last_ns, name)
    for tick, time_ns, p, T in zip(ticks.tolist(), turn.tolist(), pressure.tolist(), kelvin.tolist(), strict=True):
        message = DifferentialPressure(
            status=Status.SATURATED if p in (0, bridge.FULL_COUNT) else Status.OK,
            pressure_counts=p,
            temperature_counts=T,
            differential_pressure_Pa=(p - part.low_counts) * per_count - part.range_Pa,
            temperature_K=T * BRIDGE_KELVIN + bridge.TEMPERATURE_LOW_K,
        )
        yield TimedMessage(tick, time_ns, f"/probe/{name}", message)


# u-blox M8: NAV-PVT, 100 bytes at 38400 baud, each 0.1 s; units of 1e-7 deg, mm and mm/s.
GPS_PERIOD_NS, GPS_ARRIVES_NS = 100_000_000, round(100 * 10e9 / 38400)
GPS_EPOCH_UNIX_S = round(GPS_EPOCH.timestamp())
# Pulse counter: frames of four bytes; the driver accepts periods of up to 1 s, and reports silence of 0.5 s as no data.
RPM_ARRIVES_NS, RPM_SILENCE_NS, RPM_LONGEST_US = round(4 * 10e9 / BAUD), 500_000_000, 1_000_000
# The driver withholds a period that jumps until the next period agrees.
RPM_STEP, RPM_RATIO, RPM_FORGOTTEN_NS = 0.05, 1.25, 300_000_000
# Autopilot at 57600 baud: attitude and servos for each tick, sent 20 ms before it, and battery every 0.5 s, as the
# daemon requested at the first heartbeat; some 90 bytes of other messages precede the battery's.
AUTOPILOT_SINCE_NS, AUTOPILOT_EARLIER_NS = 1_060_000_000, 20_000_000
BATTERY_PERIOD_NS, BATTERY_ARRIVES_NS, CELLS = 500_000_000, round(90 * 10e9 / 57600), 4


AIRBORNE_4G = 8  # CFG-NAV5 dynModel, which the daemon sets


def _arrivals(read_times: ReadTimes, arrived_ns: Ints) -> Ints:
    """The ticks in which data that arrive at these instants are read."""
    return np.searchsorted(read_times.serial, arrived_ns)


def gps_messages(sensor_truth: SensorTruth, read_times: ReadTimes, utc_at_start_ns: int) -> Iterator[TimedMessage]:
    sent_ns: Ints = np.arange(read_times.tick_ns[-1] // GPS_PERIOD_NS + 1, dtype=np.int64) * GPS_PERIOD_NS
    ticks = _arrivals(read_times, sent_ns + GPS_ARRIVES_NS)
    fixes = sensor_truth.gps(seconds(sent_ns))
    for i, tick in enumerate(ticks.tolist()):
        if tick >= len(read_times.serial):
            return
        valid_us = round(fixes.valid_at_s[i] * 1e6)
        utc_ns = utc_at_start_ns + valid_us * 1000
        itow_ms = round((utc_ns - (GPS_EPOCH_UNIX_S - LEAP_SECONDS) * SECOND_NS) / 1e6) % WEEK_MS
        if fixes.fix[i]:
            north, east, down = (round(v * 1e3) / 1e3 for v in fixes.velocity_ned_mps[i].tolist())
            height = round(fixes.height_msl_m[i] * 1e3) / 1e3
            message = Gps(
                itow_ms=itow_ms,
                fix_type=3,
                satellites=12,
                utc_ns=utc_ns,
                latitude_deg=round(fixes.latitude_deg[i] * 1e7) / 1e7,
                longitude_deg=round(fixes.longitude_deg[i] * 1e7) / 1e7,
                height_m=height,
                height_msl_m=height,
                velocity_north_mps=north,
                velocity_east_mps=east,
                velocity_down_mps=down,
                horizontal_accuracy_m=round(fixes.horizontal_accuracy_m[i] * 1e3) / 1e3,
                vertical_accuracy_m=round(fixes.vertical_accuracy_m[i] * 1e3) / 1e3,
                speed_accuracy_mps=round(fixes.speed_accuracy_mps[i] * 1e3) / 1e3,
                dynamic_model=AIRBORNE_4G,
            )
        else:
            message = Gps(status=Status.NO_DATA, itow_ms=itow_ms, fix_type=0, satellites=2)
        yield TimedMessage(tick, int(read_times.serial[tick]), "/gps", message)


def rpm_messages(counter: FakeEscCounter, read_times: ReadTimes, pole_pairs: int) -> Iterator[TimedMessage]:
    """Messages with the newest period of each tick, from a counter that sends legacy frames."""
    frames = [(at_ns, int.from_bytes(frame[1:], "big")) for at_ns, frame in counter.output(int(read_times.serial[-1]))]
    sent = [(at_ns, period_us) for at_ns, period_us in frames if period_us <= RPM_LONGEST_US]
    newest: dict[int, int] = {}
    arrived = np.array([at_ns + RPM_ARRIVES_NS for at_ns, _ in sent], dtype=np.int64)
    before_us, odd_us, framed_ns = 0, 0, 0
    for tick, (_, period_us) in zip(_arrivals(read_times, arrived).tolist(), sent, strict=True):
        if tick >= len(read_times.serial):
            break
        now_ns = int(read_times.serial[tick])
        if now_ns - framed_ns > RPM_FORGOTTEN_NS:
            before_us = odd_us = 0
        framed_ns = now_ns
        follows = before_us == 0 or abs(period_us / before_us - 1) <= RPM_STEP
        if follows or (odd_us and max(period_us, odd_us) <= RPM_RATIO * min(period_us, odd_us)):
            newest[tick], before_us, odd_us = period_us, period_us, 0
        else:  # the driver withholds a period that jumps until the next period agrees
            odd_us = period_us
    last_ns = 0
    for tick in read_times.ticks():
        now_ns = int(read_times.serial[tick])
        period_us = newest.get(tick, 0)
        if period_us:
            last_ns = now_ns
            speed = 10 * 1e6 / (period_us * pole_pairs)
            yield TimedMessage(tick, now_ns, "/rpm", Rpm(period_us=period_us, motor_speed_revps=speed))
        elif now_ns - last_ns >= RPM_SILENCE_NS:
            yield TimedMessage(tick, now_ns, "/rpm", Rpm(status=Status.NO_DATA))


def autopilot_messages(
    sensor_truth: SensorTruth, read_times: ReadTimes, aircraft: CompleteAircraft
) -> Iterator[TimedMessage]:
    sent_s = seconds(read_times.tick_ns - AUTOPILOT_EARLIER_NS)
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


def battery_messages(sensor_truth: SensorTruth, read_times: ReadTimes) -> Iterator[TimedMessage]:
    sent_ns: Ints = np.arange(AUTOPILOT_SINCE_NS, int(read_times.tick_ns[-1]), BATTERY_PERIOD_NS, dtype=np.int64)
    voltage, current = sensor_truth.battery(seconds(sent_ns))
    for i, tick in enumerate(_arrivals(read_times, sent_ns + BATTERY_ARRIVES_NS).tolist()):
        if FIRST_TICK <= tick < len(read_times.serial):
            cell_mV, centiampere = round(voltage[i] * 1e3) // CELLS, round(current[i] * 1e2)
            message = Battery(
                voltage_V=cell_mV * CELLS / 1e3, current_A=centiampere / 1e2 if centiampere >= 0 else None
            )
            yield TimedMessage(tick, int(read_times.serial[tick]), "/battery", message)


def time_messages(read_times: ReadTimes, solutions: list[TimedMessage], start_unix_ns: int) -> Iterator[TimedMessage]:
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
