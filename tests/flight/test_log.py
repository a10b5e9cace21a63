"""The log: written messages are read back, even from a truncated file, and a file that is not a log is named as
such."""

import gc
import io
import json
import random

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import CUT, read_log
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import (
    MESSAGES,
    TYPE_OF_TOPIC,
    Comparison,
    Event,
    Imu,
    Message,
    Status,
    Tick,
    schema_of,
)

SECOND_NS = 1_000_000_000


def filled(kind: type[Message], number: int) -> Message:
    """A message with a value in every field, different for every number."""
    values: dict[str, object] = {}
    for field in msgspec.structs.fields(kind):
        text = str(field.type)
        if field.name == "status":
            values[field.name] = list(Status)[number % len(Status)]
        elif "Comparison" in text:
            values[field.name] = list(Comparison)[number % len(Comparison)]
        elif "bool" in text:
            values[field.name] = number % 2 == 0
        elif "dict" in text:
            values[field.name] = {"imu": number}
        elif "list" in text:
            values[field.name] = [number, number + 1]
        elif "str" in text:
            values[field.name] = f"text {number}"
        elif "float" in text:
            values[field.name] = number + 0.123456789012345
        else:
            values[field.name] = number
    return kind(**values)


def write(stream, ticks: int, *, finish: bool = True, chunk_bytes: int = 2000) -> dict[str, list[Message]]:
    log = LogWriter(stream, chunk_bytes=chunk_bytes)
    log.attach("tray.toml", b"rate_Hz = 25\n", "text/plain", 5)
    log.add_metadata("software", {"version": "1.2.3"})
    written: dict[str, list[Message]] = {topic: [] for topic in TYPE_OF_TOPIC}
    for tick in range(ticks):
        for topic, kind in TYPE_OF_TOPIC.items():
            message = filled(kind, tick)
            log.write(topic, message, time_ns=tick * SECOND_NS // 25, tick=tick)
            written[topic].append(message)
    if finish:
        log.finish()
    return written


def test_every_message_comes_back_as_it_was(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        written = write(stream, ticks=20)
    log = read_log(path)
    assert log.torn == "" and log.undecodable == 0
    assert {topic: [e.message for e in entries] for topic, entries in log.entries.items()} == written
    assert [(e.time_ns, e.tick) for e in log.entries["/imu"]] == [(t * SECOND_NS // 25, t) for t in range(20)]
    assert log.attachments == {"tray.toml": b"rate_Hz = 25\n"}
    assert log.metadata["software"] == {"version": "1.2.3"}


def test_the_stock_reader_reads_it_and_finds_a_schema_for_every_topic(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        write(stream, ticks=3)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        seen = {}
        for schema, channel, message in reader.iter_messages():
            seen[channel.topic] = (json.loads(schema.data), json.loads(message.data))
    assert set(seen) == set(TYPE_OF_TOPIC)
    for schema, message in seen.values():
        assert schema["type"] == "object"
        assert set(message) <= set(schema["properties"])


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_failed_reading_is_a_status_and_nulls(kind):
    message = kind(status=Status.NO_REPLY)
    decoded = msgspec.json.decode(msgspec.json.encode(message), type=kind)
    assert decoded == message
    assert schema_of(kind)["properties"]["status"]


@pytest.mark.parametrize("kind", MESSAGES)
def test_viewers_can_read_the_schema(kind):
    """Foxglove and Lichtblick show no topic at all if a property has no plain type or is a reference."""
    schema = schema_of(kind)
    assert schema["type"] == "object"
    assert set(schema["properties"]) == set(kind.__struct_fields__)
    for name, of in schema["properties"].items():
        assert_plain_type(of, name)


def assert_plain_type(schema, name):
    assert schema["type"] in {"string", "number", "integer", "boolean", "object", "array"}, name
    assert not {"$ref", "anyOf", "oneOf", "allOf"} & set(schema), name
    if schema["type"] == "array":
        assert_plain_type(schema["items"], name)
    for inner, of in schema.get("properties", {}).items():
        assert_plain_type(of, f"{name}.{inner}")


def test_a_log_whose_schemas_say_more_is_read_as_before(tmp_path, monkeypatch):
    """Logs of earlier versions have schemas with `anyOf` with null, and with `$ref` to the list of statuses."""
    earlier = {"type": "object", "properties": {"status": {"$ref": "#/$defs/Status"}, "samples": {"anyOf": [{}]}}}
    stream = io.BytesIO()
    monkeypatch.setattr("flightpower.flight.log_writer.schema_text", lambda kind: json.dumps(earlier).encode())
    written = write(stream, ticks=3)
    path = tmp_path / "log.mcap"
    path.write_bytes(stream.getvalue())
    assert {topic: [e.message for e in entries] for topic, entries in read_log(path).entries.items()} == written


def test_a_file_torn_anywhere_gives_what_was_closed_before_the_tear(tmp_path):
    """Cut at random bytes: no exception but InputError, no wrong message, and only the open chunk is lost."""
    stream = io.BytesIO()
    written = write(stream, ticks=40, finish=False)
    complete = stream.getvalue()
    rng = random.Random(1)
    path = tmp_path / "torn.mcap"
    counts = []
    for cut in sorted(rng.sample(range(len(complete) + 1), 80)):
        for tail in (b"", b"\0" * 4096):
            path.write_bytes(complete[:cut] + tail)
            try:
                log = read_log(path)
            except InputError as error:
                assert str(path) in str(error)
                counts.append(0)
                continue
            for topic, entries in log.entries.items():
                assert [e.message for e in entries] == written[topic][: len(entries)]
            counts.append(len(log.entries["/imu"]))
    assert counts == sorted(counts)  # more file, more messages
    # The last chunk is open when the power fails: 2,000 bytes hold less than one tick of all topics.
    assert counts[-1] >= 38


def test_a_log_that_still_grows_or_lost_its_end_is_not_called_damaged(tmp_path):
    """Its whole records are read; a record with altered bytes is damage."""
    stream, path = io.BytesIO(), tmp_path / "log.mcap"
    write(stream, ticks=40, finish=False)
    complete = stream.getvalue()
    path.write_bytes(complete[:-700])
    log = read_log(path)
    times_ns = [time_ns for entries in log.entries.values() for time_ns in entries.time_ns]
    assert log.cut and log.incomplete == f"{CUT}: {(max(times_ns) - min(times_ns)) / 1e9:.1f} s read"
    middle = len(complete) // 2
    path.write_bytes(complete[:middle] + bytes(64) + complete[middle + 64 :])
    assert not read_log(path).cut and read_log(path).incomplete.startswith("damaged (")
    stream = io.BytesIO()
    write(stream, ticks=40)
    path.write_bytes(stream.getvalue())
    assert read_log(path).incomplete == ""


def test_a_topic_we_do_not_know_and_a_message_we_cannot_read_are_passed_over(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        log = LogWriter(stream)
        log.write("/imu", Imu(samples=8), time_ns=1, tick=0)
        imu = log._channels["/imu"]
        other = log.add_channel("/other", schema=0)
        log.write_encoded(other, b"{}", time_ns=2, tick=0)
        log.write_encoded(imu, b'{"samples": "eight"}', time_ns=3, tick=0)
        log.write("/daq/tick", Tick(late_ns=7), time_ns=4, tick=1)
        log.finish()
    read = read_log(path)
    assert read.undecodable == 1
    assert len(read.entries["/imu"]) == 1 and len(read.entries["/daq/tick"]) == 1
    assert "/other" not in read.entries


def mcap_of_others() -> bytes:
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start(profile="ros2")
    writer.finish()
    return stream.getvalue()


def finished_but_empty() -> bytes:
    stream = io.BytesIO()
    LogWriter(stream).finish()
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "empty"),
        (b"\x89MC", "neither a log nor a table"),
        (b"hello world, this is not a log", "text, which is not read"),
        (mcap_of_others(), "profile"),
        (finished_but_empty(), "no message"),
    ],
)
def test_what_is_no_log_is_refused(tmp_path, content, expected):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=expected) as caught:
        read_log(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_and_a_directory(tmp_path):
    for path in (tmp_path / "missing.mcap", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read_log(path)


def test_reading_leaves_the_search_for_cycles_as_it_was(tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"no log")
    try:
        for begin in (gc.disable, gc.enable):
            begin()
            before = gc.isenabled()
            with pytest.raises(InputError):
                read_log(path)
            assert gc.isenabled() is before
    finally:
        gc.enable()


@pytest.mark.parametrize("text", [b"caf\xe9", b"\xff\xfe", b"\xed\xa0\x80"])
def test_a_text_that_is_not_utf_8_costs_its_message_only(tmp_path, text):
    """The text is in the first of three events of a chunk; the other topics and later chunks are read."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        log = LogWriter(stream)
        log.declare("/daq/event")
        log.write_encoded(1, b'{"text":"' + text + b'"}', time_ns=0, tick=0)
        for number in range(1, 3):
            log.write("/daq/event", Event(text=f"event {number}"), time_ns=number, tick=number)
            log.write("/imu", Imu(samples=number), time_ns=number, tick=number)
            log.flush()
        log.finish()
    read = read_log(path)
    assert not read.torn and read.undecodable == 1
    assert [e.message.text for e in read.entries["/daq/event"]] == ["event 1", "event 2"]
    assert [e.message.samples for e in read.entries["/imu"]] == [1, 2]


def test_a_message_that_utf_8_cannot_hold_is_marked_and_ends_nothing(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        log = LogWriter(stream)
        for tick in range(3):
            log.write("/daq/event", Event(text="caf\udce9" if tick == 1 else "café"), time_ns=tick, tick=tick)
        log.finish()
    daq_event = read_log(path).entries["/daq/event"]
    assert [e.message.status for e in daq_event] == [Status.OK, Status.CORRUPT, Status.OK]
