"""Gives a log's date and time according to the satellites; the log's own clock may never have been set."""

from flightpower.flight.log_entries import NO_ENTRIES
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import FIRST_UTC_NS, LAST_UTC_NS, Gps, Message, Time


def satellites_minus_log_time_ns(log: Log) -> int | None:
    """The offset to add to a log's times to get UTC [ns]; None without a fix that has a date.

    The last such fix is used: right after power-on a receiver may not know the leap seconds.
    """
    for topic in ("/gps", "/time"):
        entries = log.entries.get(topic, NO_ENTRIES)
        for i in reversed(range(len(entries))):
            ahead_ns = ahead_of_log_ns(entries[i].message, entries[i].time_ns)
            if ahead_ns is not None:
                return ahead_ns
    return None


def ahead_of_log_ns(message: Message, time_ns: int) -> int | None:
    """Satellite time minus log time [ns], from one message and its log time; None without a date."""
    match message:
        case Gps(utc_ns=int(utc_ns)) | Time(gps_utc_ns=int(utc_ns)):
            return utc_ns - time_ns if FIRST_UTC_NS <= utc_ns < LAST_UTC_NS else None
    return None
