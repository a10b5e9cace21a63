"""Reads a log into messages, even a log that a power cut left unfinished."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from mcap.records import Attachment, Channel, Header, McapRecord, Metadata

from flightpower.flight.errors import InputError
from flightpower.flight.formats import refusal
from flightpower.flight.log_chunk import LogTooLarge, allowed_bytes
from flightpower.flight.log_entries import Entries
from flightpower.flight.log_index import MAGIC
from flightpower.flight.log_records import Messages, RecordCut, records
from flightpower.flight.log_writer import PROFILE
from flightpower.flight.messages import TYPE_OF_TOPIC, Message, Status
from flightpower.flight.undecodable import Undecodable

ENCODING = "json"
WANTED = "a log of the daemon (.mcap)"
FORMAT_PAGE = "docs/understand/log-format.md"


@dataclass
class Log:
    """A whole log in memory."""

    path: Path
    entries: dict[str, Entries] = field(default_factory=dict)  # by topic, in order of time
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    fields: dict[str, frozenset[str]] = field(default_factory=dict)  # by topic: fields of its first good message
    unknown_topics: dict[str, None] = field(default_factory=dict)  # in order
    other_encodings: dict[str, str] = field(default_factory=dict)  # encoding of each topic that is not encoded as JSON
    undecodable_of: dict[str, Undecodable] = field(default_factory=dict)  # by topic
    torn: str = ""  # why reading stopped before the end; empty for a complete log
    cut: bool = False  # True if the file ends before its footer; other torn logs are damaged

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message."""
        begins = [entries.time_ns[0] for entries in self.entries.values() if len(entries)]
        ends = [entries.time_ns[-1] for entries in self.entries.values() if len(entries)]
        return (max(ends) - min(begins)) / 1e9 if begins else 0.0

    @property
    def incomplete(self) -> str:
        """Says how a log is incomplete, and how much of it was read; empty for a complete log."""
        if self.cut:
            return f"{CUT}: {self.duration_s:.1f} s read"
        return f"damaged ({self.torn}): {self.duration_s:.1f} s before that read" if self.torn else ""

    @property
    def undecodable(self) -> int:
        """The number of messages that cannot be decoded."""
        return sum(undecodable.count for undecodable in self.undecodable_of.values())


CUT = "still being recorded, or cut by a loss of power"
UNDECODABLE = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError)  # errors of a single bad message


def read_log(path: str | Path) -> Log:
    """Every message, attachment and metadata record of an MCAP file, up to its end or to the first torn record.

    Topics that are unknown or have another encoding are listed, but not read; messages that cannot be decoded are
    counted. Reading also stops, with the limit in `torn`, where the log decompresses to more than `flight.log_chunk`
    permits. Raises InputError when the file is missing, empty, not MCAP, of another profile, or has no message.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, _no_search_for_cycles():
            if stream.read(len(MAGIC)) != MAGIC:
                raise refusal(path, WANTED)
            stream.seek(0)
            log = _read(path, records(stream, allowed_bytes(path.stat().st_size)))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not any(log.entries.values()):
        raise InputError(f"{path}: {_why_empty(log)}")
    return log


@contextmanager
def _no_search_for_cycles() -> Iterator[None]:
    """Suspend garbage collection: the messages are a million objects without a cycle, and searching all of them each
    time 700 were made took a twentieth of the processor time of a whole analysis."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _why_empty(log: Log) -> str:
    if log.torn:
        return f"holds no message ({log.torn if log.cut else f'it is damaged: {log.torn}'})"
    for topic, undecodable in log.undecodable_of.items():
        return f"none of its {log.undecodable} messages can be decoded; {topic}: {undecodable.mistake}"
    for topic, encoding in log.other_encodings.items():
        return f"{topic}: {other_encoding(encoding)}"
    if log.unknown_topics:
        return f"holds no message of a topic that {FORMAT_PAGE} has; its topics: {', '.join(log.unknown_topics)}"
    return "holds no message (it is complete, but nothing was recorded)"


def other_encoding(encoding: str) -> str:
    """Advice on messages of another encoding."""
    return f"its messages are encoded as {encoding!r}; write JSON with the message encoding {ENCODING!r}"


def _decoded(decoder: msgspec.json.Decoder[Any], data: bytes) -> Message:
    """Decode a message; 3.0 is accepted for an integer. Raises one of UNDECODABLE if the data lack the format."""
    try:
        message: Message = decoder.decode(data)
    except msgspec.ValidationError:
        message = msgspec.convert(_with_integers(msgspec.json.decode(data)), decoder.type)
    return message


def _with_integers(value: Any) -> Any:
    """This JSON value with integers in place of numbers without a fraction."""
    if isinstance(value, dict):
        return {name: _with_integers(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_integers(item) for item in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _add(log: Log, topic: str, entries: Entries, decoder: msgspec.json.Decoder[Any], messages: Messages) -> None:
    """Decode messages into the entries of their topic and count undecodable ones."""

    def message_or_none(data: bytes) -> Message | None:
        try:
            return _decoded(decoder, data)
        except UNDECODABLE as error:
            log.undecodable_of.setdefault(topic, Undecodable(data, str(error))).count += 1
            return None

    _, times_ns, ticks, data = messages
    try:
        decoded = list(map(decoder.decode, data))
    except UNDECODABLE:
        good = [
            (*row, message) for row in zip(times_ns, ticks, data, strict=True) if (message := message_or_none(row[2]))
        ]
        times_ns, ticks, data, decoded = map(list, zip(*good, strict=True)) if good else ([], [], [], [])
    entries.extend(times_ns, ticks, decoded)
    if topic not in log.fields:
        first = next((i for i, message in enumerate(decoded) if message.status is Status.OK), None)
        if first is not None:
            log.fields[topic] = frozenset(msgspec.json.decode(data[first]))


def _read(path: Path, stream: Iterator[McapRecord | Messages]) -> Log:
    log = Log(path)
    read: dict[str, Entries] = {}
    decoders: dict[int, tuple[str, Entries, msgspec.json.Decoder[Any]]] = {}
    kinds = {kind: msgspec.json.Decoder(kind) for kind in set(TYPE_OF_TOPIC.values())}
    try:
        for record in stream:
            if isinstance(record, Messages):
                if record.channel in decoders:
                    _add(log, *decoders[record.channel], record)
            elif isinstance(record, Channel):
                if record.topic not in TYPE_OF_TOPIC:
                    log.unknown_topics[record.topic] = None
                elif record.message_encoding.lower() != ENCODING:
                    log.other_encodings[record.topic] = record.message_encoding
                else:
                    kind = TYPE_OF_TOPIC[record.topic]
                    entries = read.setdefault(record.topic, Entries(kind))
                    decoders[record.id] = (record.topic, entries, kinds[kind])
            elif isinstance(record, Attachment):
                log.attachments[record.name] = record.data
            elif isinstance(record, Metadata):
                log.metadata[record.name] = record.metadata
            elif isinstance(record, Header) and record.profile != PROFILE:
                raise InputError(
                    f"{path}: an MCAP file, but not a log of this program: the profile in its header is"
                    f" {record.profile!r}, not {PROFILE!r} ({FORMAT_PAGE} describes the format)"
                )
    except InputError:
        raise
    except LogTooLarge as error:
        log.torn = str(error)
    except RecordCut:
        log.torn, log.cut = CUT, True
    except Exception as error:  # decoders' errors on a torn chunk: McapError, EOFError, errors of zstandard …
        log.torn = f"{type(error).__name__}: {error}".rstrip(": ")
    for entries in read.values():
        entries.finish()
    log.entries.update(read)
    return log
