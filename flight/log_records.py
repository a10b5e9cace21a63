"""The records of an MCAP file in order, with those inside its chunks (MCAP specification 1.0, "Records")."""

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Metadata

from flight.log_chunk import LogTooLarge, decompressed
from flight.log_index import MAGIC, RECORD_HEAD

MAX_RECORD_BYTES = 256 * 2**20
MESSAGE = int(Opcode.MESSAGE)  # comparing an enumeration takes longer
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
IN_CHUNK = struct.Struct("<BQHIQQ")  # the same with the record's head
USED = {Opcode.HEADER: Header, Opcode.ATTACHMENT: Attachment, Opcode.METADATA: Metadata, Opcode.CHANNEL: Channel}


class Messages(NamedTuple):
    """Consecutive messages of one channel, not decoded. ticks: the records' sequence numbers."""

    channel: int
    times_ns: list[int]
    ticks: list[int]
    data: list[bytes]


def records(stream: IO[bytes], allowed: int) -> Iterator[McapRecord | Messages]:
    """Header, channels, messages, attachments and metadata of a file, from its first byte on.

    Raises LogTooLarge beyond `allowed` decompressed bytes; where the file is torn or damaged, an exception of mcap,
    struct or of the decompressor.
    """
    _check_magic(stream)
    total = 0
    while True:
        head = stream.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            raise EndOfFile()
        opcode, length = RECORD_HEAD.unpack(head)
        if length > MAX_RECORD_BYTES:
            raise RecordLengthLimitExceeded(opcode, length, MAX_RECORD_BYTES)
        content = stream.read(length)
        if len(content) < length:
            raise EndOfFile()
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(BytesIO(content)))
            data = decompressed(chunk.compression, chunk.data)
            total += len(data)
            if total > allowed:
                limit = f"{allowed / 2**20:.0f} MiB, the limit for its size"
                raise LogTooLarge(f"its chunks decompress to more than {limit}")
            yield from _in_chunk(data)
        elif opcode == Opcode.MESSAGE:
            yield _message(content)
        elif opcode in USED:
            yield USED[opcode].read(ReadDataStream(BytesIO(content)))
        elif opcode == Opcode.FOOTER:
            _check_magic(stream)
            return


def _in_chunk(data: bytes) -> Iterator[McapRecord | Messages]:
    """The messages and channels in a decompressed chunk; messages of one channel together."""
    found: dict[int, Messages] = {}
    at, end, head, unpack = 0, len(data), RECORD_HEAD.size + MESSAGE_HEAD.size, IN_CHUNK.unpack_from
    try:
        while at < end:
            if data[at] == MESSAGE:
                _, length, channel, tick, time_ns, _ = unpack(data, at)
                begin, at = at + head, at + RECORD_HEAD.size + length
                if at > end:
                    raise EndOfFile()
                _, times_ns, ticks, contents = found.get(channel) or found.setdefault(channel, _none_of(channel))
                times_ns.append(time_ns)
                ticks.append(tick)
                contents.append(data[begin:at])
                continue
            opcode, length = RECORD_HEAD.unpack_from(data, at)
            begin, at = at + RECORD_HEAD.size, at + RECORD_HEAD.size + length
            if at > end:
                raise EndOfFile()
            if opcode == Opcode.CHANNEL:
                yield from found.values()
                found.clear()
                yield Channel.read(ReadDataStream(BytesIO(data[begin:at])))
    except Exception:
        yield from found.values()
        raise
    yield from found.values()


def _none_of(channel: int) -> Messages:
    return Messages(channel, [], [], [])


def _message(content: bytes) -> Messages:
    channel, tick, time_ns, _ = MESSAGE_HEAD.unpack_from(content)
    return Messages(channel, [time_ns], [tick], [content[MESSAGE_HEAD.size :]])


def _check_magic(stream: IO[bytes]) -> None:
    if (found := stream.read(len(MAGIC))) != MAGIC:
        raise InvalidMagic(tuple(found)) if len(found) == len(MAGIC) else EndOfFile()
