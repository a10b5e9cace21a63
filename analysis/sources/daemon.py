"""Turns a log into synchronized channels: all on one uniform grid at the tick rate, each corrected for its delay.

Failed, stale and saturated samples are left out. Long gaps are not interpolated: the channel is NaN there.
"""

import math
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.sources.grid import on_grid
from flightpower.analysis.sources.grid_settings import CHANNELS, STATISTICS
from flightpower.analysis.sources.recording import AllChannels, Channel, Event, EventKind, Fix, Position, without_damage
from flightpower.analysis.sources.resolution import step_of
from flightpower.flight import runs
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import NO_ENTRIES, NO_INTEGER, STATUS_CODE, Entries
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Status
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.flight.satellite_time import satellites_minus_log_time_ns

CLIPPED = "at the end of its range"


def times_ns(entries: Entries) -> NDArray[np.int64]:
    """Return the log times of all messages [ns], (n,)."""
    return np.array(entries.time_ns, dtype=np.int64)


def is_good(entries: Entries) -> NDArray[np.bool_]:
    """Return which messages have the status `ok`, (n,)."""
    return np.asarray(np.array(entries.status) == STATUS_CODE[Status.OK])


def values(entries: Entries, field: str) -> Array:
    """Return a field of all messages, (n,): NaN where it is null, or if the message type has no such numeric field."""
    numbers = entries.columns[field].numbers if field in entries.columns else None
    if numbers is None:
        return np.full(len(entries), np.nan)
    array = np.array(numbers)
    return (
        without_damage(array) if numbers.typecode == "d" else np.where(array == NO_INTEGER, np.nan, array.astype(float))
    )


def field_of(log: Log, topic: str, field: str) -> tuple[Array, Array]:
    """Return times since the first good message [s] and the values of a field, both (n,); empty if there are none."""
    entries = log.entries.get(topic, NO_ENTRIES)
    value = values(entries, field)
    good = is_good(entries) & ~np.isnan(value)
    taken_ns = times_ns(entries)[good]
    return (taken_ns - taken_ns[:1]) / 1e9, value[good]


def first_ns(log: Log) -> int:
    """Return the log time of the first message [ns]."""
    return min(entries[0].time_ns for entries in log.entries.values() if entries)


def fix_of_log(log: Log, start_ns: int) -> Fix:
    """Return date and place from GPS; the date is from the computer if GPS gives none and the computer's clock was set.

    start_ns : log time at which the recording's clock is zero
    """
    gps = log.entries.get("/gps", NO_ENTRIES)
    positions = np.stack(
        [(times_ns(gps) - start_ns) / 1e9, values(gps, "latitude_deg"), values(gps, "longitude_deg")], axis=1
    )
    height = values(gps, "height_msl_m")
    ends = tuple(Position(*row) for row in positions[np.isfinite(positions).all(axis=1)].tolist())
    ends = ends[:1] + ends[-1:]
    ahead_ns = satellites_minus_log_time_ns(log)
    unix_s = (start_ns + (ahead_ns or 0)) / 1e9
    clock_is_set = ahead_ns is not None or unix_s > CHANNELS.clock_set_unix_s
    return Fix(
        unix_at_zero_s=unix_s if clock_is_set else None,
        by_satellites=ahead_ns is not None,
        latitude_deg=ends[0].latitude_deg if ends else None,
        longitude_deg=ends[0].longitude_deg if ends else None,
        height_msl_m=next(iter(height[np.isfinite(height)].tolist()), None),
        ends=ends,
    )


def events(log: Log, start_ns: int) -> list[Event]:
    """Return the events that the daemon reported, on the clock that starts at `start_ns`."""
    entries = log.entries.get("/daq/event", NO_ENTRIES)
    reported = zip(times_ns(entries), entries.columns["text"][:], strict=True) if len(entries) else ()
    return [Event((int(t) - start_ns) / 1e9, EventKind.MESSAGE, str(text)) for t, text in reported]


def all_channels(log: Log, start_ns: int) -> AllChannels:
    """Return every numeric field, such as `/imu angular_rate_x_radps`, on the clock that starts at `start_ns`."""

    def read(entries: Entries, field: str) -> Channel:
        return Channel(*samples(entries, field, start_ns))

    return {
        f"{topic} {field}": partial(read, entries, field)
        for topic, entries in log.entries.items()
        for field, column in (entries.columns.items() if len(entries) else ())
        if column.numbers is not None
    }


def samples(entries: Entries, field: str, start_ns: int) -> tuple[Array, Array]:
    """Return times [s] and values of the good messages, both (m,), in order of time, with one value per time."""
    value = values(entries, field)
    good = is_good(entries) & ~np.isnan(value)
    taken_s = ((times_ns(entries) - start_ns) / 1e9 - _delay_s(entries, field))[good]
    taken_s, first = np.unique(taken_s, return_index=True)
    return taken_s, value[good][first]


def _delay_s(entries: Entries, field: str) -> Array:
    """Return the age of the field in each message at its log_time [s], (n,); 0 where the messages do not tell it.

    An IMU may filter its accelerometers differently from its gyroscopes. The delays differ by 1.9 ms in an MPU-9250,
    which made power in gusts 0.8 % too high at 1.1 V_stall.

    A motor speed is the mean over the timed period, and at a tick the newest frame is on average half a frame interval
    old: together 16 ms at 90 rev/s. Without this correction the motor speed would seem to lag. A counter that reports
    how many pulses it timed sends a frame every 10 ms on the pulses since the last frame, if these are more than ten;
    the last pulse is then on average half an electrical period old when the frame is sent.
    """
    timed_s = np.nan_to_num(values(entries, "period_us")) * 1e-6
    timed = timed_s > 0
    # The counter sends at most one period every 10 ms.
    frame_interval_s = timed_s * np.ceil(0.01 / np.where(timed, timed_s, 1.0))
    period_s = timed_s / 10
    pulses = (
        values(entries, "pulses_captured") - values(entries, "pulses_rejected") + values(entries, "pulses_inserted")
    )
    since_last_frame = (pulses > 10) & (timed_s < 0.01)  # false where the number of pulses is not given
    timed_s = np.where(since_last_frame, np.nan_to_num(pulses) * period_s, timed_s)
    frame_interval_s = np.where(since_last_frame, 0.01 + period_s, frame_interval_s)
    delay_s = values(entries, "group_delay_s")
    if field.startswith("specific_force_"):
        group_delay_s = values(entries, "specific_force_group_delay_s")
        delay_s = np.where(np.isnan(group_delay_s), delay_s, group_delay_s)
    return np.where(timed, (timed_s + frame_interval_s) / 2, np.nan_to_num(delay_s))


def losses(topic: str, entries: Entries, start_ns: int) -> list[str]:
    """Return notes on a topic: the share of clipped samples, and long gaps."""
    if not entries:
        return []
    notes = []
    clipped = entries.status.count(STATUS_CODE[Status.SATURATED]) / len(entries)
    if clipped > STATISTICS.unmentioned_gaps:
        notes.append(f"{topic} was {CLIPPED} for {100 * clipped:.1f} % of the log and is left out there.")
    good_s = (times_ns(entries)[is_good(entries)] - start_ns) / 1e9
    if topic == "/rpm" or len(good_s) < 2:
        return notes  # a stopped motor sends no messages; `synchronize` reports a topic without values
    gaps = np.diff(good_s)
    long = np.flatnonzero(gaps > max(CHANNELS.long_gap_s, 5 * float(np.median(gaps))))
    for i in long[np.argsort(gaps[long])[::-1][:3]].tolist():
        notes.append(f"{topic} has a gap of {gaps[i]:.1f} s from {good_s[i]:.0f} s on, which is not interpolated.")
    return notes


def tick_period_s(log: Log) -> float:
    """Return the period of a log's ticks [s].

    It is the nominal period if the log's metadata give it. Otherwise it follows from the time between the first and the
    last tick, so that missed ticks do not matter, or from the median interval if the sequence does not count ticks.
    Raises InputError if the metadata have a wrong rate.
    """
    imu = log.entries["/imu"]
    ticks = np.stack([np.array(imu.tick, dtype=np.int64), times_ns(imu)], axis=1)
    interval_s = float(np.median(np.diff(ticks[:, 1]))) / 1e9
    nominal = log.metadata.get("flightpower", {}).get("tick_rate_Hz")
    if nominal:
        try:
            period_s = 1 / float(nominal)
        except (ValueError, ZeroDivisionError):
            period_s = math.nan
        if not 1 / CHANNELS.gap <= interval_s / period_s <= CHANNELS.gap:
            raise InputError(
                f"{log.path}: metadata flightpower: tick_rate_Hz is {nominal!r}, but /imu has {1 / interval_s:.4g}"
                " messages a second: write that number, or leave it out"
            )
        return period_s
    count, lasted_ns = ticks[-1] - ticks[0]
    return float(lasted_ns) / float(count) / 1e9 if np.median(np.diff(ticks[:, 0])) == 1 else interval_s


def servo_pulses(log: Log, output: int) -> tuple[Array, Array]:
    """Return times since the first pulse [s] and pulses [us] of a servo output, counted from 1; both (n,), or empty."""
    t_s, pulses = [], []
    for entry in log.entries.get("/controls", []):
        pulse_us = getattr(entry.message, "pulse_us", None)
        if pulse_us is not None and len(pulse_us) >= output:
            t_s.append(entry.time_ns / 1e9)
            pulses.append(pulse_us[output - 1])
    return np.array(t_s) - (t_s[0] if t_s else 0.0), np.array(pulses, dtype=float)


# Columns of the table, each with its (topic, field).
COLUMNS = {
    "ax_mps2": ("/imu", "specific_force_x_mps2"),
    "ay_mps2": ("/imu", "specific_force_y_mps2"),
    "az_mps2": ("/imu", "specific_force_z_mps2"),
    "p_radps": ("/imu", "angular_rate_x_radps"),
    "q_radps": ("/imu", "angular_rate_y_radps"),
    "r_radps": ("/imu", "angular_rate_z_radps"),
    "dp_alpha_Pa": ("/probe/alpha", "differential_pressure_Pa"),
    "dp_beta_Pa": ("/probe/beta", "differential_pressure_Pa"),
    "q_c_Pa": ("/probe/airspeed", "differential_pressure_Pa"),
    "static_Pa": ("/static", "pressure_Pa"),
    "static_temperature_K": ("/static", "temperature_K"),
    "n_revps": ("/rpm", "motor_speed_revps"),
    "elevator_rad": ("/controls", "elevator_rad"),
    "throttle": ("/controls", "throttle"),
    "gps_north_mps": ("/gps", "velocity_north_mps"),
    "gps_east_mps": ("/gps", "velocity_east_mps"),
    "gps_down_mps": ("/gps", "velocity_down_mps"),
    "mag_x_T": ("/mag", "field_x_T"),
    "mag_y_T": ("/mag", "field_y_T"),
    "mag_z_T": ("/mag", "field_z_T"),
    "battery_V": ("/battery", "voltage_V"),
    "battery_A": ("/battery", "current_A"),
}
TOPICS = tuple(dict.fromkeys(topic for topic, _ in COLUMNS.values()))


class Channels(NamedTuple):
    """Synchronized channels of a log."""

    table: pd.DataFrame  # index: t_s since the first tick; columns: COLUMNS, NaN where nothing was measured
    rate_Hz: float
    start_ns: int  # Unix time of t_s = 0
    notes: list[str]  # clipping and long gaps, in sentences
    resolution: Mapping[str, float] = MappingProxyType({})  # by column, the step size of its values, if it has one


def synchronize(log: Log, lag_s: dict[str, float] | None = None) -> Channels:
    """Put every channel of a log on one uniform grid.

    log: accepted by `analysis.sources`.
    lag_s: by topic, a known delay of its quantity [s] in addition to the delay that its messages give.
    Raises InputError if the log's metadata have a wrong rate.
    """
    ticks_ns, period_s = times_ns(log.entries["/imu"]), tick_period_s(log)
    start_ns = int(ticks_ns[0])
    t_s: Array = np.arange(int((ticks_ns[-1] - start_ns) / 1e9 / period_s) + 1, dtype=float) * period_s

    table: dict[str, Array] = {}
    resolution: dict[str, float] = {}
    of_topic = {topic: log.entries.get(topic, NO_ENTRIES) for topic in TOPICS}
    notes = [note for topic, entries in of_topic.items() for note in losses(topic, entries, start_ns)]
    for name, (topic, field) in COLUMNS.items():
        taken_s, value = samples(of_topic[topic], field, start_ns)
        table[name] = on_grid(t_s, taken_s - (lag_s or {}).get(topic, 0.0), value)
        if step := step_of(value):
            resolution[name] = step
    return Channels(pd.DataFrame(table, index=pd.Index(t_s, name="t_s")), 1 / period_s, start_ns, notes, resolution)


# Thresholds scale with the size of the aircraft (`flight.runs.AIRCRAFT_SIZE`), which a table of air data carries.
SPEED_SCALE = "speed_scale"  # column of the table from `air_data`; it has the speed ratio in every row


def speed_scale(aircraft: Aircraft) -> float:
    """Return the speed at C_L = 1 over the reference speed, at most 1."""
    return runs.speed_scale(aircraft.mass.weight_N, aircraft.geometry.wing_area_m2)


def speed_ratio_of(table: pd.DataFrame) -> float:
    """Return the speed at C_L = 1 over the reference speed for a table from `air_data`; 1 without the column."""
    return float(table[SPEED_SCALE].iloc[0]) if SPEED_SCALE in table and len(table) else 1.0


def speed_scale_of(table: pd.DataFrame) -> float:
    """Return `speed_ratio_of`, limited to at most 1."""
    return min(1.0, speed_ratio_of(table))


def least_height_m(table: pd.DataFrame) -> float:
    """Return the height above ground [m] below which wind shear matters to the aircraft of a table from `air_data`."""
    return AIRCRAFT_SIZE.least_height_m * speed_scale_of(table)
