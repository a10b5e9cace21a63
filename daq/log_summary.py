"""Summarizes the contents of a log in numbers, for `daq info`."""

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from flightpower.daq.sensor_health import GOOD_STATUSES
from flightpower.flight.log_entries import NO_ENTRIES, LogEntry
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.satellite_time import satellites_minus_log_time_ns


class TopicSummary(NamedTuple):
    """Message count, rate and failures of one topic."""

    topic: str
    messages: int
    rate_Hz: float
    failures: str  # such as "no_reply 12, stale 3"; empty if there were none


class Summary(NamedTuple):
    """A log's summary: general lines of text, and one row for each topic."""

    lines: list[str]
    topics: list[TopicSummary]


def summarize(path: Path) -> Summary:
    """Summarize a log. Raises InputError when it cannot be read."""
    log = read_log(path)
    times_ns = [time_ns for entries in log.entries.values() for time_ns in (e.time_ns for e in entries)]
    begin_ns, end_ns = min(times_ns), max(times_ns)
    duration_s = (end_ns - begin_ns) / 1e9
    facts = log.metadata.get("flightpower", {})
    offset_ns = satellites_minus_log_time_ns(log)
    begin = datetime.fromtimestamp((begin_ns + (offset_ns or 0)) / 1e9, UTC)
    clock = "system clock" if offset_ns is None else "satellites' time"
    lines = [
        f"{path}: {duration_s:.1f} s from {begin:%Y-%m-%d %H:%M:%S} ({clock}, UTC)",
        f"aircraft {facts.get('aircraft') or 'not given'}, {facts.get('tick_rate_Hz', '?')} Hz, "
        f"software {facts.get('version', '?')}",
        f"attachments: {', '.join(log.attachments) or 'none'}",
        _ticks(log),
    ]
    if log.torn:
        lines.append(f"the file is {log.incomplete}")
    if log.undecodable:
        lines.append(f"{log.undecodable} messages cannot be decoded")
    return Summary(lines, [_topic(topic, entries, duration_s) for topic, entries in sorted(log.entries.items())])


def _ticks(log: Log) -> str:
    ticks = log.entries.get("/daq/tick", NO_ENTRIES)
    late_ms = sorted(getattr(entry.message, "late_ns", 0) / 1e6 for entry in ticks)
    missed = sum(getattr(entry.message, "missed", 0) for entry in ticks)
    if not late_ms:
        return "no ticks"
    return (
        f"{len(ticks)} ticks, {missed} missed; late by {late_ms[len(late_ms) // 2]:.2f} ms (median), "
        f"{late_ms[-1]:.2f} ms (maximum)"
    )


def _topic(topic: str, entries: Sequence[LogEntry], duration_s: float) -> TopicSummary:
    statuses = Counter(entry.message.status for entry in entries)
    failures = ", ".join(f"{status} {n}" for status, n in statuses.most_common() if status not in GOOD_STATUSES)
    return TopicSummary(topic, len(entries), len(entries) / duration_s if duration_s else 0.0, failures)
