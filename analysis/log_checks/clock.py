"""Log times: nanoseconds, one clock for all topics, without jumps. Where they start does not matter."""

import numpy as np

from analysis.signals.log_fields import times_ns
from analysis.signals.synchronize import TOPICS
from flight.errors import InputError
from flight.log_entries import NO_ENTRIES
from flight.log_reader import Log

# Of /imu, from the daemon's 1 to 200 Hz; faster ones are averaged before they are written.
SHORTEST_INTERVAL_S, LONGEST_INTERVAL_S = 1 / 210, 1.1
FEWEST_MESSAGES = 10
LARGEST_JUMP_S = 3600.0  # longer than any of these aircraft flies: the clock was set, or is another
UNITS = {"microseconds": 1e3, "milliseconds": 1e6, "seconds": 1e9}


def check_clock(log: Log) -> None:
    """Raises InputError if the log times cannot be nanoseconds of one clock."""
    imu_ns = times_ns(log.entries.get("/imu", NO_ENTRIES))
    if len(imu_ns) < FEWEST_MESSAGES:
        raise InputError(f"{log.path}: /imu: {len(imu_ns)} messages are too few to analyze")
    interval_s = float(np.median(np.diff(imu_ns))) / 1e9
    if not SHORTEST_INTERVAL_S <= interval_s <= LONGEST_INTERVAL_S:
        raise InputError(f"{log.path}: /imu: {_wrong_interval(interval_s)}")
    jump_s = float(np.diff(imu_ns).max()) / 1e9
    if jump_s > LARGEST_JUMP_S:
        raise InputError(
            f"{log.path}: /imu: log_time jumps by {jump_s:.3g} s; use a clock that is not set while it records"
        )
    for topic in TOPICS:
        taken_ns = times_ns(log.entries.get(topic, NO_ENTRIES))
        if len(taken_ns) < FEWEST_MESSAGES:
            continue
        if taken_ns[-1] < imu_ns[0] or taken_ns[0] > imu_ns[-1]:
            apart_s = float(taken_ns[0] - imu_ns[0]) / 1e9
            raise InputError(
                f"{log.path}: {topic}: its log times begin {apart_s:+.4g} s from those of /imu and have none in common"
                " with them; take the log_time of all topics from one clock, in nanoseconds"
            )


def _wrong_interval(interval_s: float) -> str:
    if interval_s == 0:
        return "most messages have the log_time of the one before; write each message's own, in nanoseconds"
    for unit, factor in UNITS.items():
        if SHORTEST_INTERVAL_S <= interval_s * factor <= LONGEST_INTERVAL_S:
            return f"log_time is in {unit} ({interval_s * 1e9:.0f} between messages); write nanoseconds"
    if SHORTEST_INTERVAL_S / 50 < interval_s < SHORTEST_INTERVAL_S:
        return f"{1 / interval_s:.0f} messages a second are too many; average them to 25 a second (200 at most)"
    return f"{interval_s:.3g} s between messages (by log_time, in nanoseconds); write 25 a second (1 at least)"
