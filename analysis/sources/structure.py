"""Checks a log before its channels are synchronized, in an order that lets each check rely on the earlier ones.

Required topics and fields must be present, under the names in flight/messages.py. Times must be in nanoseconds, from
one clock for all topics, without jumps; where they start does not matter.
"""

from difflib import get_close_matches

import msgspec
import numpy as np

from flightpower.analysis.sources.check_settings import STRUCTURE
from flightpower.analysis.sources.daemon import COLUMNS, TOPICS, is_good, times_ns, values
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.ranges import check_units
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import NO_ENTRIES, STATUSES
from flightpower.flight.log_reader import FORMAT_PAGE, Log, other_encoding
from flightpower.flight.messages import AIRBORNE_MODELS, TOPICS_FOR_DRAG, TYPE_OF_TOPIC


def check_log(log: Log, propeller_diameter_m: float) -> None:
    """Raises InputError for the first mistake found; it names topic, field, likely cause and remedy."""
    check_messages(log)
    check_clock(log)
    check_units(log, propeller_diameter_m)


def check_decodable(log: Log) -> None:
    """Raises InputError if most messages of a topic cannot be decoded."""
    for topic in TOPICS:
        if topic in log.other_encodings:
            raise InputError(f"{log.path}: {topic}: {other_encoding(log.other_encodings[topic])}")
        entries, undecodable = log.entries.get(topic, NO_ENTRIES), log.undecodable_of.get(topic)
        if undecodable and undecodable.count > len(entries):
            raise InputError(
                f"{log.path}: {topic}: {undecodable.count} of {len(entries) + undecodable.count} messages cannot be"
                f" decoded: {undecodable.mistake}"
            )


def check_lacking(log: Log) -> None:
    """Raises InputError if a topic that the power curve needs is present, but undecodable or under another name.

    This is for logs that lack such a topic and therefore give electrical power.
    """
    check_decodable(log)
    for topic in TOPICS_FOR_DRAG:
        if not log.entries.get(topic) and _match(log, topic):
            raise _no_topic(log, topic)


def check_messages(log: Log) -> None:
    """Raises InputError if most messages of a topic cannot be decoded, or if a required topic or field has no value."""
    check_decodable(log)
    for topic in TOPICS:
        entries = log.entries.get(topic, NO_ENTRIES)
        if topic in TOPICS_FOR_DRAG and not entries:
            raise _no_topic(log, topic)
        if entries:
            _check_fields(log, topic)


def _check_fields(log: Log, topic: str) -> None:
    """Raises InputError if a required field has no value, or any field seems to be there under another name."""
    entries = log.entries[topic]
    good = is_good(entries)
    used = [field for its_topic, field in COLUMNS.values() if its_topic == topic]
    empty = [field for field in used if np.isnan(values(entries, field)[good]).all()]
    expected = {field.name for field in msgspec.structs.fields(TYPE_OF_TOPIC[topic])}
    unknown = sorted(log.fields.get(topic, frozenset()) - expected)
    misnamed = [(field, match) for field in empty for match in get_close_matches(field, unknown, 1)]
    if misnamed:
        field, match = misnamed[0]
        raise InputError(f"{log.path}: {topic}: {field} has no value, but there is an unknown field {match}: rename it")
    if (unknown and good.any() and len(empty) == len(used)) or (topic in TOPICS_FOR_DRAG and empty):
        left_out = [field for field in empty if good.any() and field not in log.fields.get(topic, frozenset(empty))]
        if left_out and not unknown:
            words = "is missing; it is" if len(left_out) == 1 else "are missing; they are"
            raise InputError(f"{log.path}: {topic}: {', '.join(left_out)} {words} required")
        raise InputError(f"{log.path}: {topic}: {empty[0]} {_why_empty(log, topic, unknown, bool(good.any()))}")


def _why_empty(log: Log, topic: str, unknown: list[str], good: bool) -> str:
    if unknown:
        return f"has no value; fields of its messages that {FORMAT_PAGE} does not have: {', '.join(unknown)}"
    statuses = ", ".join(sorted({str(STATUSES[code]) for code in log.entries[topic].status}))
    return f"never carried a value (its status: {statuses})" if good else f"was never measured (its status: {statuses})"


def _no_topic(log: Log, topic: str) -> InputError:
    return InputError(f"{log.path}: no topic {topic}, which the power curve needs{_similar_topic(log, topic)}")


def receiver_notes(log: Log) -> list[str]:
    """Return a note if the receiver's filter was not set for flight (`dynamic_model` of /gps)."""
    entries = log.entries.get("/gps", NO_ENTRIES)
    models = {int(model) for model in values(entries, "dynamic_model") if not np.isnan(model)}
    if not (wrong := models - AIRBORNE_MODELS):
        return []
    return [
        f"The GPS receiver's dynamic model was {min(wrong)}, not 6 to 8 (airborne): it smooths velocity, and speed over"
        " ground is late in runs. Set it (u-blox CFG-NAV5); the daemon does at every start."
    ]


def _match(log: Log, topic: str) -> str | None:
    """Return an unknown topic that resembles `topic` or ends with it; None if there is none."""
    similar = get_close_matches(topic, log.unknown_topics, 1)
    return next((name for name in [*similar, *log.unknown_topics] if name in similar or name.endswith(topic)), None)


def _similar_topic(log: Log, topic: str) -> str:
    if match := _match(log, topic):
        return f"; is it {match}? Rename it"
    return f"; unknown topics of the log: {', '.join(log.unknown_topics)}" if log.unknown_topics else ""


def check_clock(log: Log) -> None:
    """Raises InputError if the log times cannot be nanoseconds of one clock."""
    imu_ns = times_ns(log.entries.get("/imu", NO_ENTRIES))
    if len(imu_ns) < STATISTICS.fewest_values:
        raise InputError(f"{log.path}: /imu: {len(imu_ns)} messages are too few to analyze")
    interval_s = float(np.median(np.diff(imu_ns))) / 1e9
    if not _plausible(interval_s):
        raise InputError(f"{log.path}: /imu: {_wrong_interval(interval_s)}")
    jump_s = float(np.diff(imu_ns).max()) / 1e9
    if jump_s > STRUCTURE.largest_jump_s:
        raise InputError(
            f"{log.path}: /imu: log_time jumps by {jump_s:.3g} s; use a clock that is not set while it records"
        )
    for topic in TOPICS:
        taken_ns = times_ns(log.entries.get(topic, NO_ENTRIES))
        if len(taken_ns) < STATISTICS.fewest_values:
            continue
        if taken_ns[-1] < imu_ns[0] or taken_ns[0] > imu_ns[-1]:
            apart_s = float(taken_ns[0] - imu_ns[0]) / 1e9
            raise InputError(
                f"{log.path}: {topic}: its log times begin {apart_s:+.4g} s from those of /imu and have none in common"
                " with them; take the log_time of all topics from one clock, in nanoseconds"
            )


def _plausible(interval_s: float) -> bool:
    shortest_s, longest_s = STRUCTURE.interval_s
    return shortest_s <= interval_s <= longest_s


def _wrong_interval(interval_s: float) -> str:
    if interval_s == 0:
        return "most messages have the log_time of the one before; write each message's own, in nanoseconds"
    for unit, factor in {"microseconds": 1e3, "milliseconds": 1e6, "seconds": 1e9}.items():
        if _plausible(interval_s * factor):
            return f"log_time is in {unit} ({interval_s * 1e9:.0f} between messages); write nanoseconds"
    shortest_s, _ = STRUCTURE.interval_s
    if shortest_s / 50 < interval_s < shortest_s:
        return f"{1 / interval_s:.0f} messages a second are too many; average them to 25 a second (200 at most)"
    return f"{interval_s:.3g} s between messages (by log_time, in nanoseconds); write 25 a second (1 at least)"
