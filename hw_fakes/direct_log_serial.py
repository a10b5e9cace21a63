"""Messages of the parts on serial lines, and of the clocks, for `hw_fakes.direct_log`."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flight.complete_aircraft import CompleteAircraft
from flight.messages import Attitude, Battery, Controls, Gps, Rpm, Status, Time
from hw_fakes.direct_log_timing import FIRST_TICK, SECOND_NS, TICK_NS, ReadTimes, TimedMessage, seconds
from hw_fakes.esc_counter import BAUD, FakeEscCounter
from sim.sensor_truth import SensorTruth

Ints = NDArray[np.int64]

# u-blox M8: NAV-PVT, 100 bytes at 38400 baud, each 0.1 s; units of 1e-7 deg, mm and mm/s.
GPS_PERIOD_NS, GPS_ARRIVES_NS = 100_000_000, round(100 * 10e9 / 38400)
GPS_EPOCH_UNIX_S, LEAP_SECONDS, WEEK_MS = 315_964_800, 18, 604_800_000
# Pulse counter: frames of four bytes; the driver takes periods of up to 1 s, and silence for 0.5 s as no data.
RPM_ARRIVES_NS, RPM_SILENCE_NS, RPM_LONGEST_US = round(4 * 10e9 / BAUD), 500_000_000, 1_000_000
# Autopilot at 57600 baud: attitude and servos each tick, sent 20 ms before it, and battery each 0.5 s, since the daemon
# asked for them at the first heartbeat; some 90 bytes of others come before the battery's.
AUTOPILOT_SINCE_NS, AUTOPILOT_EARLIER_NS = 1_060_000_000, 20_000_000
BATTERY_PERIOD_NS, BATTERY_ARRIVES_NS, CELLS = 500_000_000, round(90 * 10e9 / 57600), 4


AIRBORNE_4G = 8  # CFG-NAV5 dynModel, which the daemon sets


def _arrivals(read_times: ReadTimes, arrived_ns: Ints) -> Ints:
    """The tick in which something that arrived at these instants is read."""
    return np.searchsorted(read_times.serial, arrived_ns)


def gps_messages(sensor_truth: SensorTruth, read_times: ReadTimes, utc_at_start_ns: int) -> Iterator[TimedMessage]:
    sent_ns: Ints = np.arange(read_times.tick_ns[-1] // GPS_PERIOD_NS + 1, dtype=np.int64) * GPS_PERIOD_NS
    ticks = _arrivals(read_times, sent_ns + GPS_ARRIVES_NS)
    found = sensor_truth.gps(seconds(sent_ns))
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
                dynamic_model=AIRBORNE_4G,
            )
        else:
            message = Gps(status=Status.NO_DATA, itow_ms=itow_ms, fix_type=0, satellites=2)
        yield TimedMessage(tick, int(read_times.serial[tick]), "/gps", message)


def rpm_messages(counter: FakeEscCounter, read_times: ReadTimes, pole_pairs: int) -> Iterator[TimedMessage]:
    """The newest period of a tick, of a counter that sends legacy frames."""
    frames = [(at_ns, int.from_bytes(frame[1:], "big")) for at_ns, frame in counter.output(int(read_times.serial[-1]))]
    sent = [(at_ns, period_us) for at_ns, period_us in frames if period_us <= RPM_LONGEST_US]
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
