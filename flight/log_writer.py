"""Writes a log: an MCAP file with one topic per sensor, JSON messages with a JSON Schema, and zstd chunks.

Tray, aircraft file, propeller table, probe calibration and software version are attached to the log, so that
`analyze log.mcap` needs no other file.

This module builds the chunks itself. mcap's own Writer keeps the index as objects (20 MB an hour of the default tray)
and writes it all at once, so that ticks would be missed when a file is finished in flight.
"""

import json
import struct
import zlib
from functools import cache
from typing import IO

import msgspec
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, McapRecord, Metadata, Schema

from flightpower.flight.log_index import CHUNK_HEAD, MAGIC, MESSAGE_INDEX_HEAD, RECORD_HEAD, LogIndex
from flightpower.flight.messages import TYPE_OF_TOPIC, Message, Status, schema_of

PROFILE = "flightpower"
FORMAT_VERSION = "1"
# A chunk is on disk only when it is full. This size is about half a second of the default tray before compression.
CHUNK_BYTES = 40_000
COMPRESSION = "zstd"
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # record head, then channel, sequence, log time, publish time
MESSAGE_FIXED_BYTES = MESSAGE_HEAD.size - RECORD_HEAD.size
MESSAGE_OPCODE = int(Opcode.MESSAGE)
INDEX_ENTRY = struct.Struct("<QQ")  # log time, position in the uncompressed chunk


@cache
def schema_text(kind: type[Message]) -> bytes:
    """The JSON Schema of a message type, as written to the file."""
    return json.dumps(schema_of(kind)).encode()


def message_index(channel: int, entries: bytearray) -> bytes:
    """The record that lists where a channel's messages are in the preceding chunk; entries: packed INDEX_ENTRY."""
    size = MESSAGE_INDEX_HEAD.size + len(entries)
    return RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, size) + MESSAGE_INDEX_HEAD.pack(channel, len(entries)) + entries


class LogWriter:
    """An MCAP file open for writing. `finish` writes the index; without it all messages can still be read.

    stream: only its `write` is called, with whole records. compressor: logs that one thread writes in succession may
    share it; each compressor takes half a megabyte.
    """

    def __init__(
        self,
        stream: IO[bytes],
        *,
        chunk_bytes: int = CHUNK_BYTES,
        compressor: zstandard.ZstdCompressor | None = None,
    ):
        self._stream = stream
        self._chunk_bytes = chunk_bytes
        self._index = LogIndex()
        self._written = 0
        self._channels: dict[str, int] = {}
        self._schemas: dict[type[Message], int] = {}
        self._encoder = msgspec.json.Encoder()
        self._compressor = compressor or zstandard.ZstdCompressor()
        self._chunk = bytearray()
        self._entries: dict[int, bytearray] = {}  # entries of the open chunk's message indices, by channel
        self._first_ns = self._last_ns = 0
        self._put(MAGIC)
        self._record(Opcode.HEADER, Header(PROFILE, f"{PROFILE}-log-{FORMAT_VERSION}"))

    @property
    def size_bytes(self) -> int:
        """Number of bytes written to the stream."""
        return self._written

    def attach(self, name: str, data: bytes, media_type: str, time_ns: int) -> None:
        """Add an attachment."""
        self.flush()
        self._record(Opcode.ATTACHMENT, Attachment(time_ns, time_ns, name, media_type, data))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Add a metadata record of names and values."""
        self.flush()
        self._record(Opcode.METADATA, Metadata(name, values))

    def declare(self, topic: str) -> None:
        """Add the channel of a topic, so that the file lists it even without a message."""
        self._channel(topic)

    def write(self, topic: str, message: Message, *, time_ns: int, tick: int) -> None:
        """Add a message taken at `time_ns` (Unix time [ns]) in tick number `tick`.

        If its text cannot be encoded as UTF-8, a message with the status `corrupt` and no values is written instead.
        """
        channel = self._channels.get(topic) or self._channel(topic)
        try:
            data = self._encoder.encode(message)
        except UnicodeEncodeError:
            data = self._encoder.encode(type(message)(status=Status.CORRUPT))
        self.write_encoded(channel, data, time_ns=time_ns, tick=tick)

    def write_encoded(self, channel: int, data: bytes, *, time_ns: int, tick: int) -> None:
        """Add a message already encoded as JSON. channel: its number."""
        chunk = self._chunk
        if not chunk:
            self._first_ns = self._last_ns = time_ns
        elif time_ns > self._last_ns:
            self._last_ns = time_ns
        elif time_ns < self._first_ns:
            self._first_ns = time_ns
        entries = self._entries.get(channel)
        if entries is None:
            entries = self._entries[channel] = bytearray()
        entries += INDEX_ENTRY.pack(time_ns, len(chunk))
        size = MESSAGE_FIXED_BYTES + len(data)
        chunk += MESSAGE_HEAD.pack(MESSAGE_OPCODE, size, channel, tick & 0xFFFFFFFF, time_ns, time_ns)
        chunk += data
        if len(chunk) > self._chunk_bytes:
            self.flush()

    def flush(self) -> None:
        """Close the open chunk and write it to the stream."""
        if self._chunk:
            self.append(self.close_chunk())

    def close_chunk(self) -> bytes:
        """Remove and return what was written since the last chunk: its record and its message indices, for `append`."""
        compressed = self._compressor.compress(self._chunk)
        head = CHUNK_HEAD.pack(self._first_ns, self._last_ns, len(self._chunk), zlib.crc32(self._chunk))
        name = struct.pack("<I", len(COMPRESSION)) + COMPRESSION.encode() + struct.pack("<Q", len(compressed))
        size = len(head) + len(name) + len(compressed)
        parts = [RECORD_HEAD.pack(Opcode.CHUNK, size), head, name, compressed]
        parts += [message_index(channel, entries) for channel, entries in self._entries.items()]
        self._chunk.clear()
        self._entries.clear()
        return b"".join(parts)

    def append(self, records: bytes) -> None:
        """Add whole records: a closed chunk of this log or of a log that declared the same topics in the same order."""
        view, offset = memoryview(records), 0
        while offset < len(records):
            opcode, length = RECORD_HEAD.unpack_from(records, offset)
            begin = offset + RECORD_HEAD.size
            self._index.add(opcode, view[begin : begin + length], self._written + offset)
            offset = begin + length
        self._put(records)

    def finish(self) -> None:
        """Close the last chunk and write the index."""
        self.flush()
        for piece in self._index.end_of_file(self._written):
            self._put(piece)

    def _channel(self, topic: str) -> int:
        if topic not in self._channels:
            kind = TYPE_OF_TOPIC[topic]
            if kind not in self._schemas:
                self._schemas[kind] = len(self._schemas) + 1
                schema = Schema(
                    id=self._schemas[kind], name=kind.__name__, encoding="jsonschema", data=schema_text(kind)
                )
                self._record(Opcode.SCHEMA, schema)
            self.add_channel(topic, self._schemas[kind])
        return self._channels[topic]

    def add_channel(self, topic: str, schema: int) -> int:
        """Add a channel of JSON messages, and return its number. schema: the number of its schema, 0 for none."""
        number = self._channels[topic] = len(self._channels) + 1
        self._record(
            Opcode.CHANNEL, Channel(id=number, topic=topic, message_encoding="json", metadata={}, schema_id=schema)
        )
        return number

    def _record(self, opcode: int, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self.append(builder.end())

    def _put(self, data: bytes | bytearray) -> None:
        self._stream.write(data)
        self._written += len(data)
