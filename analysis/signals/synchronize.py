"""Log to synchronised data: every channel on one grid of the tick rate, each with its own delay taken out.

A sample that failed, was stale or saturated is left out; across a gap longer than `GAP_TICKS` the channel is NaN, so
that nothing is invented where nothing was measured.
"""

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flight.errors import InputError
from flight.log_reader import Log, LogEntry
from flight.messages import Status

Array = NDArray[np.float64]
GAP_TICKS = 3.5
LONG_GAP_S, MENTIONED_SHARE, MENTIONED_GAPS = 2.0, 0.002, 3
CLIPPED = "at the end of its range"

# Column of the table: (topic, field). The field's symbols are words of the analysis from here on.
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
COUNTER_S = 0.01  # the pulse counter sends a period no sooner after the last
TOPICS = tuple(dict.fromkeys(topic for topic, _ in COLUMNS.values()))
NEEDED = ("/imu", "/probe/alpha", "/probe/airspeed", "/static", "/rpm")


class Channels(NamedTuple):
    """Synchronised data and where it came from."""

    table: pd.DataFrame  # index: t_s since the first tick; columns: COLUMNS, NaN where nothing was measured
    rate_Hz: float
    start_ns: int  # Unix time of t_s = 0
    notes: list[str]  # what was lost and why, where it was more than a moment


def synchronize(log: Log, lag_s: dict[str, float] | None = None) -> Channels:
    """Every channel of a log on one uniform grid.

    lag_s: known delay of a topic's quantity behind its log_time [s], on top of what the messages say of themselves.
    Raises InputError when a topic that nothing can replace is missing or never carried a value.
    """
    for topic in NEEDED:
        if topic not in log.entries or not log.entries[topic]:
            raise InputError(f"{log.path}: no topic {topic}, which the power curve needs")
    ticks = np.array([(entry.tick, entry.time_ns) for entry in log.entries["/imu"]], dtype=np.int64)
    period_s = _period_s(ticks, log)
    start_ns = int(ticks[0, 1])
    t_s: Array = np.arange(int((ticks[-1, 1] - start_ns) / 1e9 / period_s) + 1, dtype=float) * period_s

    table: dict[str, Array] = {}
    notes = [note for topic in TOPICS for note in _losses(topic, log.entries.get(topic, []), start_ns, period_s)]
    for name, (topic, field) in COLUMNS.items():
        entries = log.entries.get(topic, [])
        taken_s, value = _samples(entries, field, start_ns)
        if topic in NEEDED and not len(value):
            statuses = sorted({str(entry.message.status) for entry in entries})
            raise InputError(f"{log.path}: {topic} never carried a value (its status: {', '.join(statuses)})")
        table[name] = on_grid(t_s, taken_s - (lag_s or {}).get(topic, 0.0), value)
    return Channels(pd.DataFrame(table, index=pd.Index(t_s, name="t_s")), 1 / period_s, start_ns, notes)


def on_grid(t_s: Array, taken_s: Array, value: Array) -> Array:
    """`value` taken at `taken_s`, interpolated by a cubic spline onto the grid; NaN across gaps and beyond the ends."""
    if len(value) < 4:
        return np.full_like(t_s, np.nan)
    interval = max(float(np.median(np.diff(taken_s))), t_s[1] - t_s[0])
    after = np.clip(np.searchsorted(taken_s, t_s), 1, len(taken_s) - 1)
    before = after - 1
    bridged = taken_s[after] - taken_s[before] <= GAP_TICKS * interval
    distance = np.minimum(np.abs(t_s - taken_s[before]), np.abs(taken_s[after] - t_s))
    within = (t_s >= taken_s[0]) & (t_s <= taken_s[-1])
    known = (bridged & within) | (distance <= 0.01 * interval)
    return np.where(known, CubicSpline(taken_s, value)(t_s), np.nan)


def _losses(topic: str, entries: list[LogEntry], start_ns: int, period_s: float) -> list[str]:
    """In words: how much of a topic was clipped, and when it was silent for long."""
    if not entries:
        return []
    notes = []
    clipped = sum(entry.message.status is Status.SATURATED for entry in entries) / len(entries)
    if clipped > MENTIONED_SHARE:
        notes.append(f"{topic} was {CLIPPED} for {100 * clipped:.1f} % of the log: not measured there.")
    good_s = np.array([(entry.time_ns - start_ns) / 1e9 for entry in entries if entry.message.status is Status.OK])
    if topic == "/rpm" or len(good_s) < 2:
        return notes  # a motor that stands says nothing, and a topic that never spoke is somebody else's to tell
    gaps = np.diff(good_s)
    long = np.flatnonzero(gaps > max(LONG_GAP_S, 5 * float(np.median(gaps))))
    for i in long[np.argsort(gaps[long])[::-1][:MENTIONED_GAPS]].tolist():
        notes.append(f"{topic} has a gap of {gaps[i]:.1f} s from {good_s[i]:.0f} s on: nothing is invented there.")
    return notes


def _samples(entries: list[LogEntry], field: str, start_ns: int) -> tuple[Array, Array]:
    """Times [s] and values of the good messages, in order, one for each instant."""
    good = [
        ((time_ns - start_ns) / 1e9 - _behind_s(message), value)
        for time_ns, _, message in entries
        if message.status is Status.OK and (value := getattr(message, field)) is not None
    ]
    if not good:
        return np.empty(0), np.empty(0)
    taken_s, value = np.array(good).T
    taken_s, first = np.unique(taken_s, return_index=True)
    return taken_s, value[first]


def _behind_s(message: object) -> float:
    """By how much a message's quantity is older than its log_time [s], as far as the message tells.

    A motor's speed is the mean over the period that was timed, and what a tick finds is on average half as old as
    frames are apart: 16 ms together at 90 rev/s, by which a motor that speeds up or slows down seems to lag.
    """
    timed_s = (getattr(message, "period_us", None) or 0) * 1e-6
    if timed_s > 0:
        apart_s = timed_s * math.ceil(COUNTER_S / timed_s)
        return (timed_s + apart_s) / 2
    return getattr(message, "group_delay_s", None) or 0.0


def _period_s(ticks: NDArray[np.int64], log: Log) -> float:
    """The loop's period, from tick numbers and times: exact however many ticks were missed."""
    count = int(ticks[-1, 0] - ticks[0, 0])
    if count < 1 or ticks[-1, 1] <= ticks[0, 1]:
        raise InputError(f"{log.path}: {len(ticks)} ticks are too few to analyse")
    nominal = log.metadata.get("flightpower", {}).get("tick_rate_Hz")
    return 1 / float(nominal) if nominal else float(ticks[-1, 1] - ticks[0, 1]) / count / 1e9
