"""The records of an MCAP file in order, with those inside its chunks (MCAP specification 1.0, "Records")."""

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Metadata

from flightpower.flight.log_chunk import LogTooLarge, decompressed
from flightpower.flight.log_index import MAGIC, RECORD_HEAD

MAX_RECORD_BYTES = 256 * 2**20
TOGETHER_BYTES = 2**19  # size of the decompressed chunks whose messages are returned together
MESSAGE = int(Opcode.MESSAGE)  # an integer, because comparing an enumeration takes longer
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
IN_CHUNK = struct.Struct("<BQHIQQ")  # MESSAGE_HEAD with the record's head in front
USED = {Opcode.HEADER: Header, Opcode.ATTACHMENT: Attachment, Opcode.METADATA: Metadata, Opcode.CHANNEL: Channel}


class RecordCut(EndOfFile):  # type: ignore[misc]  # mcap has no types here
    """The file ends within a record, or without a footer: it is still being written, or the power was cut."""


class Messages(NamedTuple):
    """Consecutive messages of one channel, not decoded. ticks: the records' sequence numbers."""

    channel: int
    times_ns: list[int]
    ticks: list[int]
    data: list[bytes]


def records(stream: IO[bytes], allowed: int) -> Iterator[McapRecord | Messages]:
    """Header, channels, messages, attachments and metadata of a file, from its first byte on.

    Raises LogTooLarge beyond `allowed` decompressed bytes. If the file is torn or damaged, it first returns the
    messages before that place, and then raises an exception of mcap, struct or the decompressor.
    """
    messages: dict[int, Messages] = {}
    try:
        yield from _records(stream, allowed, messages)
    except Exception:
        yield from _taken(messages)
        raise


def _records(stream: IO[bytes], allowed: int, messages: dict[int, Messages]) -> Iterator[McapRecord | Messages]:
    """Yield the records, but first collect the messages of several chunks in `messages`, by channel."""
    _check_magic(stream)
    total = returned = 0
    while True:
        head = stream.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            raise RecordCut()
        opcode, length = RECORD_HEAD.unpack(head)
        if length > MAX_RECORD_BYTES:
            raise RecordLengthLimitExceeded(opcode, length, MAX_RECORD_BYTES)
        content = stream.read(length)
        if len(content) < length:
            raise RecordCut()
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(BytesIO(content)))
            data = decompressed(chunk.compression, chunk.data)
            total += len(data)
            if total > allowed:
                limit = f"{allowed / 2**20:.0f} MiB, the limit for its size"
                raise LogTooLarge(f"its chunks decompress to more than {limit}")
            yield from _in_chunk(data, messages)
            if total - returned > TOGETHER_BYTES:
                yield from _taken(messages)
                returned = total
        elif opcode == Opcode.MESSAGE:
            yield from _taken(messages)
            yield _message(content)
        elif opcode in USED:
            yield from _taken(messages)
            yield USED[opcode].read(ReadDataStream(BytesIO(content)))
        elif opcode == Opcode.FOOTER:
            yield from _taken(messages)
            _check_magic(stream)
            return


def _in_chunk(data: bytes, messages: dict[int, Messages]) -> Iterator[McapRecord | Messages]:
    """Add the messages in a decompressed chunk to `messages`; a channel record is yielded after earlier messages."""
    offset, end, head, unpack = 0, len(data), RECORD_HEAD.size + MESSAGE_HEAD.size, IN_CHUNK.unpack_from
    while offset < end:
        if data[offset] == MESSAGE:
            _, length, channel, tick, time_ns, _ = unpack(data, offset)
            begin, offset = offset + head, offset + RECORD_HEAD.size + length
            if offset > end:
                raise EndOfFile()
            _, times_ns, ticks, contents = messages.get(channel) or messages.setdefault(channel, _none_of(channel))
            times_ns.append(time_ns)
            ticks.append(tick)
            contents.append(data[begin:offset])
            continue
        opcode, length = RECORD_HEAD.unpack_from(data, offset)
        begin, offset = offset + RECORD_HEAD.size, offset + RECORD_HEAD.size + length
        if offset > end:
            raise EndOfFile()
        if opcode == Opcode.CHANNEL:
            yield from _taken(messages)
            yield Channel.read(ReadDataStream(BytesIO(data[begin:offset])))


def _taken(messages: dict[int, Messages]) -> list[Messages]:
    """Remove the collected messages from `messages` and return them, one item for each channel."""
    taken = list(messages.values())
    messages.clear()
    return taken


def _none_of(channel: int) -> Messages:
    return Messages(channel, [], [], [])


def _message(content: bytes) -> Messages:
    channel, tick, time_ns, _ = MESSAGE_HEAD.unpack_from(content)
    return Messages(channel, [time_ns], [tick], [content[MESSAGE_HEAD.size :]])


def _check_magic(stream: IO[bytes]) -> None:
    if (magic := stream.read(len(MAGIC))) != MAGIC:
        raise InvalidMagic(tuple(magic)) if len(magic) == len(MAGIC) else EndOfFile()
