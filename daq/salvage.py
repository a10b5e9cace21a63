"""Completing logs that a power cut left unfinished, so that any MCAP reader opens them, and quickly.

Nothing that can be read is touched: what is cut off is the torn record at the end, and in its place comes the index
that a finished log has. A last chunk whose message indices are torn gets them anew.
"""

import fcntl
import io
import os
import zlib
from collections import deque
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk

from daq.disk import sync_directory
from flight.log_index import MAGIC, RECORD_HEAD, LogIndex
from flight.log_writer import INDEX_ENTRY, MESSAGE_HEAD, message_index

LONGEST_RECORD = 2**31
# What was synced is whole: a power cut can only hurt the last second, two or three chunks. Checking the checksums of
# ten times as many costs little; of all of them, it would cost seconds of the flight after next power-on.
SUSPECT_CHUNKS = 32


class Salvaged(NamedTuple):
    path: Path
    kept_bytes: int
    cut_bytes: int


def complete_unfinished(directory: Path) -> list[Salvaged]:
    """Complete each unfinished log of `directory` that nobody is writing; raises OSError when it cannot be."""
    return [done for path in sorted(directory.glob("log-*.mcap")) if (done := complete(path)) is not None]


def complete(path: Path) -> Salvaged | None:
    """Complete one log, if it needs it. A file that does not begin like a log is left alone."""
    with path.open("r+b") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None  # being recorded
        size = stream.seek(0, os.SEEK_END)
        if size >= 2 * len(MAGIC):
            stream.seek(-len(MAGIC), os.SEEK_END)
            if stream.read() == MAGIC:
                return None
        kept = sound_length(stream)
        if kept <= len(MAGIC):
            return None
        ending = ending_of(stream, kept)
        stream.seek(kept)
        stream.write(ending)
        stream.truncate()
        stream.flush()
        os.fsync(stream.fileno())
    sync_directory(path.parent)
    return Salvaged(path, kept, size - kept)


def sound_length(stream: BinaryIO) -> int:
    """How many bytes of a log are whole records, counted from its start; 0 if it is not one.

    The last chunks are believed only if their checksums are right, message indices only if a sound record stands behind
    them (they carry none).
    """
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        return 0
    size = stream.seek(0, os.SEEK_END)
    whole = position = len(MAGIC)
    tail: deque[tuple[int, int]] = deque(maxlen=SUSPECT_CHUNKS)  # begin and end of chunks
    stream.seek(position)
    while len(head := stream.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        end = position + RECORD_HEAD.size + length
        if opcode in (0, Opcode.DATA_END) or length > LONGEST_RECORD or end > size:
            break
        if opcode == Opcode.CHUNK:
            tail.append((position, end))
        if opcode != Opcode.MESSAGE_INDEX:
            whole = end
        stream.seek(end)
        position = end
    for begin, end in tail:
        stream.seek(begin + RECORD_HEAD.size)
        if not chunk_is_sound(stream.read(end - begin - RECORD_HEAD.size)):
            return begin
    return whole


def ending_of(stream: BinaryIO, length: int) -> bytes:
    """What makes a finished log of the first `length` bytes of one, which are whole records."""
    index = LogIndex()
    position = len(MAGIC)
    stream.seek(position)
    opcode, content = 0, b""
    while position < length:
        opcode, size = RECORD_HEAD.unpack(stream.read(RECORD_HEAD.size))
        content = stream.read(size)
        index.add(opcode, content, position)
        position += RECORD_HEAD.size + size
    missing = message_indices(content) if opcode == Opcode.CHUNK else []
    for record in missing:
        index.add(Opcode.MESSAGE_INDEX, record[RECORD_HEAD.size :], position)
        position += len(record)
    return b"".join([*missing, *index.end_of_file(position)])


def message_indices(content: bytes) -> list[bytes]:
    """The message index records that belong behind a sound chunk, one for each channel in it."""
    _, data = unpacked(content)
    entries: dict[int, bytearray] = {}
    at = 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, at)
            entries.setdefault(channel, bytearray()).extend(INDEX_ENTRY.pack(time_ns, at))
        at += RECORD_HEAD.size + length
    return [message_index(channel, these) for channel, these in entries.items()]


def unpacked(content: bytes) -> tuple[Chunk, bytes]:
    """A chunk and what is in it, decompressed."""
    chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
    return chunk, zstandard.decompress(chunk.data, chunk.uncompressed_size) if chunk.compression else chunk.data


def chunk_is_sound(content: bytes) -> bool:
    """Whether a chunk can be decompressed to what its checksum says."""
    try:
        chunk, data = unpacked(content)
    except Exception:  # whatever a torn chunk makes the two decoders say
        return False
    return len(data) == chunk.uncompressed_size and chunk.uncompressed_crc in (0, zlib.crc32(data))
