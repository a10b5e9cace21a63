"""Single fields of a log, as they were recorded: times and values of the good messages."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flight.log_entries import NO_INTEGER, STATUS_CODE, LogEntry, entries_of
from flight.log_reader import Log
from flight.messages import Status

Array = NDArray[np.float64]


def times_ns(entries: Sequence[LogEntry]) -> NDArray[np.int64]:
    """Unix times of all messages [ns], (n,)."""
    return np.array(entries_of(entries).time_ns, dtype=np.int64)


def is_good(entries: Sequence[LogEntry]) -> NDArray[np.bool_]:
    """Which messages have the status `ok`, (n,)."""
    return np.array(entries_of(entries).status) == STATUS_CODE[Status.OK]


def values(entries: Sequence[LogEntry], field: str) -> Array:
    """A field of all messages, (n,): NaN where it is null, or where their type has no such field of numbers."""
    of = entries_of(entries)
    numbers = of.columns[field].numbers if field in of.columns else None
    if numbers is None:
        return np.full(len(of), np.nan)
    found = np.array(numbers)
    return found if numbers.typecode == "d" else np.where(found == NO_INTEGER, np.nan, found.astype(float))


def field_of(log: Log, topic: str, field: str) -> tuple[Array, Array]:
    """Times since the first good message [s] and values of a topic's field, both (n,); empty if there are none."""
    entries = entries_of(log.entries.get(topic, []))
    value = values(entries, field)
    good = is_good(entries) & ~np.isnan(value)
    taken_ns = times_ns(entries)[good]
    return (taken_ns - taken_ns[:1]) / 1e9, value[good]


def servo_pulses(log: Log, output: int) -> tuple[Array, Array]:
    """Times since the first pulse [s] and pulses [us] of a servo output, counted from 1; both (n,), or empty."""
    t_s, pulses = [], []
    for entry in log.entries.get("/controls", []):
        pulse_us = getattr(entry.message, "pulse_us", None)
        if pulse_us is not None and len(pulse_us) >= output:
            t_s.append(entry.time_ns / 1e9)
            pulses.append(pulse_us[output - 1])
    return np.array(t_s) - (t_s[0] if t_s else 0.0), np.array(pulses, dtype=float)
