"""UTC of a log follows from its satellite messages."""

from pathlib import Path

from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Gps, Time
from flightpower.flight.satellite_time import satellites_minus_log_time_ns

UTC_NS = 1_463_218_201_000_000_000


def test_the_last_fix_counts_because_the_first_may_lack_leap_seconds() -> None:
    log = Log(Path("log.mcap"))
    assert satellites_minus_log_time_ns(log) is None
    log.entries["/time"] = entries_of([LogEntry(1000, 0, Time(monotonic_ns=0, system_ns=0, gps_utc_ns=UTC_NS + 1000))])
    assert satellites_minus_log_time_ns(log) == UTC_NS
    fixes = (UTC_NS + 18_000_000_010, UTC_NS + 20, None)
    log.entries["/gps"] = entries_of([LogEntry(10 * i + 10, i, Gps(utc_ns=utc_ns)) for i, utc_ns in enumerate(fixes)])
    assert satellites_minus_log_time_ns(log) == UTC_NS


def test_a_date_before_gps_time_or_after_the_century_is_none() -> None:
    log = Log(Path("log.mcap"))
    wrong = (-62_135_596_800 * 10**9, 0, 5_000_000_000 * 10**9)
    log.entries["/gps"] = entries_of([LogEntry(10, i, Gps(utc_ns=utc_ns)) for i, utc_ns in enumerate(wrong)])
    assert satellites_minus_log_time_ns(log) is None
