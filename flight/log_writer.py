"""Writes a log: MCAP, one topic a sensor, JSON messages with a JSON Schema, zstd chunks.

The tray, the aircraft file, the propeller table, the probe calibration and the software version travel in the file,
as attachments and metadata, so that `analyze log.mcap` needs nothing else.
"""

import json
from typing import IO

import msgspec
from mcap.writer import CompressionType, Writer

from flight.messages import TYPE_OF_TOPIC, Message, schema_of

PROFILE = "flightpower"
FORMAT_VERSION = "1"
# A chunk is on disk only when it is full. Half a second of the default tray is about this much before compression.
CHUNK_BYTES = 40_000


class LogWriter:
    """An MCAP file open for writing. `finish` writes the index; without it the file is still readable to its end."""

    def __init__(self, stream: IO[bytes], *, chunk_bytes: int = CHUNK_BYTES):
        self._writer = Writer(stream, chunk_size=chunk_bytes, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=f"{PROFILE}-log-{FORMAT_VERSION}")
        self._channels: dict[str, int] = {}
        self._schemas: dict[type[Message], int] = {}
        self._encoder = msgspec.json.Encoder()

    def attach(self, name: str, data: bytes, media_type: str, time_ns: int) -> None:
        """Put a file into the log."""
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    def describe(self, name: str, values: dict[str, str]) -> None:
        """Put a record of names and values into the log."""
        self._writer.add_metadata(name, values)

    def declare(self, topic: str) -> None:
        """Announce a topic, so that it stands in the file even if no message ever comes."""
        self._channel(topic)

    def write(self, topic: str, message: Message, *, time_ns: int, tick: int) -> None:
        """Add a message taken at `time_ns` (Unix time [ns]) in tick number `tick`."""
        data = self._encoder.encode(message)
        self._writer.add_message(self._channel(topic), time_ns, data, time_ns, tick)

    def flush(self) -> None:
        """Close the chunk that is being filled, so that what was written so far is on its way to the disk."""
        self._writer.flush()

    def finish(self) -> None:
        """Close the last chunk and write the index."""
        self._writer.finish()

    def _channel(self, topic: str) -> int:
        if topic not in self._channels:
            kind = TYPE_OF_TOPIC[topic]
            if kind not in self._schemas:
                schema = json.dumps(schema_of(kind)).encode()
                self._schemas[kind] = self._writer.register_schema(kind.__name__, "jsonschema", schema)
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[kind])
        return self._channels[topic]
