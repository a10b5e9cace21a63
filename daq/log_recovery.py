"""Completes logs that a power cut left unfinished, so that any MCAP reader opens them without scanning the file.

Readable records are not changed. The damaged record at the end is replaced by the index of a finished log. If the
message indices of the last chunk are damaged, they are written again.
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

from daq.disk_writer import sync_directory
from flight.log_index import MAGIC, RECORD_HEAD, LogIndex
from flight.log_writer import INDEX_ENTRY, MESSAGE_HEAD, message_index

MAX_RECORD_BYTES = 2**31
# Synced data are intact: a power cut can only damage the last second, two or three chunks. Verifying the checksums of
# ten times as many takes little time; verifying all would delay the recording after power-on by seconds.
VERIFIED_CHUNKS = 32


class RecoveredLog(NamedTuple):
    """A log that was completed, the bytes kept of it, and the damaged bytes removed from its end."""

    path: Path
    kept_bytes: int
    cut_bytes: int


def recover_unfinished(directory: Path) -> list[RecoveredLog]:
    """Complete every unfinished log in `directory` that no process is writing. Raises OSError on I/O errors."""
    return [done for path in sorted(directory.glob("log-*.mcap")) if (done := recover(path)) is not None]


def recover(path: Path) -> RecoveredLog | None:
    """Complete one log if it is unfinished; otherwise return None. A file that is not a log is not changed."""
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
        kept = intact_length(stream)
        if kept <= len(MAGIC):
            return None
        ending = ending_of(stream, kept)
        stream.seek(kept)
        stream.write(ending)
        stream.truncate()
        stream.flush()
        os.fsync(stream.fileno())
    sync_directory(path.parent)
    return RecoveredLog(path, kept, size - kept)


def intact_length(stream: BinaryIO) -> int:
    """Length in bytes of the intact records at the start of a log; 0 if the file is not a log.

    The last VERIFIED_CHUNKS chunks count as intact only if their checksums are right. Message indices have no checksum
    and count only if an intact record follows them.
    """
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        return 0
    size = stream.seek(0, os.SEEK_END)
    intact = position = len(MAGIC)
    tail: deque[tuple[int, int]] = deque(maxlen=VERIFIED_CHUNKS)  # begin and end of chunks
    stream.seek(position)
    while len(head := stream.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        end = position + RECORD_HEAD.size + length
        if opcode in (0, Opcode.DATA_END) or length > MAX_RECORD_BYTES or end > size:
            break
        if opcode == Opcode.CHUNK:
            tail.append((position, end))
        if opcode != Opcode.MESSAGE_INDEX:
            intact = end
        stream.seek(end)
        position = end
    for begin, end in tail:
        stream.seek(begin + RECORD_HEAD.size)
        if not chunk_is_intact(stream.read(end - begin - RECORD_HEAD.size)):
            return begin
    return intact


def ending_of(stream: BinaryIO, length: int) -> bytes:
    """The bytes to append to the first `length` bytes of a log, which are intact records, to make it a finished log."""
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
    """The message index records of an intact chunk, one for each channel in it."""
    _, data = decompressed(content)
    entries: dict[int, bytearray] = {}
    at = 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, at)
            entries.setdefault(channel, bytearray()).extend(INDEX_ENTRY.pack(time_ns, at))
        at += RECORD_HEAD.size + length
    return [message_index(channel, these) for channel, these in entries.items()]


def decompressed(content: bytes) -> tuple[Chunk, bytes]:
    """A chunk and its decompressed data."""
    chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
    return chunk, zstandard.decompress(chunk.data, chunk.uncompressed_size) if chunk.compression else chunk.data


def chunk_is_intact(content: bytes) -> bool:
    """Whether a chunk can be decompressed and its checksum is right."""
    try:
        chunk, data = decompressed(content)
    except Exception:  # a damaged chunk makes the decoders raise various exceptions
        return False
    return len(data) == chunk.uncompressed_size and chunk.uncompressed_crc in (0, zlib.crc32(data))
