"""Completes logs that a power cut left unfinished, so that any MCAP reader opens them without scanning the file.

Readable records are not changed. The damaged record at the end is replaced by the index of a finished log. If the
message indices of the last chunk are damaged, they are written again. A log that needs more memory or time than
permitted is not changed.
"""

import fcntl
import io
import os
import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk

from flightpower.daq.sync_directory import sync_directory
from flightpower.flight.log_chunk import LogTooLarge, decompressed
from flightpower.flight.log_index import MAGIC, RECORD_HEAD, LogIndex
from flightpower.flight.log_writer import INDEX_ENTRY, MESSAGE_HEAD, message_index
from flightpower.flight.messages import Event

MAX_RECORD_BYTES = 32 * 2**20  # limit of a complete record; this program's records are below 1 MB
# Synced data are intact: a power cut can only damage the last second, which is two or three chunks. Verifying the
# checksums of ten times as many chunks takes little time; verifying all would delay the recording after power-on by
# seconds.
VERIFIED_CHUNKS = 32


class RecoveredLog(NamedTuple):
    """A completed log, with the number of bytes kept, and of damaged bytes removed from its end.

    An empty file is removed.
    """

    path: Path
    kept_bytes: int
    cut_bytes: int


def unfinished_logs(paths: Iterable[Path]) -> Iterator[Path]:
    """The logs among `paths` that are not complete, or cannot be read."""
    for path in paths:
        try:
            with path.open("rb") as stream:
                if not is_complete(stream):
                    yield path
        except OSError:
            yield path


def recovery_event(path: Path) -> Event | None:
    """Complete one log. Returns the event that reports success or failure, or None if there was nothing to do."""
    try:
        done = recover(path)
    except Exception as error:  # decoders raise various errors on a damaged file; the other logs are still completed
        return failure_event(path, cause_of(error))
    if done is None:
        return None
    if not done.kept_bytes:
        return Event(sensor="daq", text=f"{path} was empty, because the power was cut when it had begun: removed")
    text = f"{path} was unfinished and has been completed: {done.kept_bytes} bytes kept, {done.cut_bytes} damaged bytes"
    return Event(sensor="daq", text=f"{text} removed")


def failure_event(path: Path, cause: str) -> Event:
    text = f"{path} is unfinished and cannot be completed ({cause}); it is not changed: move it to another folder"
    return Event(severity="warning", sensor="daq", text=text)


def cause_of(error: Exception) -> str:
    if isinstance(error, LogTooLarge | TimeoutError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{type(error).__name__}: {error}".splitlines()[0].rstrip(": ")


def recover(path: Path) -> RecoveredLog | None:
    """Complete one log if it is unfinished; otherwise return None. A file that is not a log is not changed.

    An empty file is removed. It is left by a power cut between the writing of its name and of its first bytes, and
    would stay among the logs as an unreadable one.

    Raises LogTooLarge, OSError on I/O errors, and the various errors of decoders on damaged records. The file is then
    unchanged, except after an I/O error.
    """
    with path.open("rb") as stream:
        if is_complete(stream):
            return None
    with path.open("r+b") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None  # this log is being recorded
        size = stream.seek(0, os.SEEK_END)
        if not size:
            path.unlink()
            sync_directory(path.parent)
            return RecoveredLog(path, 0, 0)
        intact_bytes = intact_length(stream)
        if intact_bytes <= len(MAGIC):
            return None
        ending = ending_of(stream, intact_bytes)
        stream.seek(intact_bytes)
        stream.write(ending)
        stream.truncate()
        stream.flush()
        os.fsync(stream.fileno())
    sync_directory(path.parent)
    return RecoveredLog(path, intact_bytes, size - intact_bytes)


def is_complete(stream: BinaryIO) -> bool:
    """Whether a file ends like a finished log."""
    size = stream.seek(0, os.SEEK_END)
    if size < 2 * len(MAGIC):
        return False
    stream.seek(-len(MAGIC), os.SEEK_END)
    return stream.read() == MAGIC


def intact_length(stream: BinaryIO) -> int:
    """Length in bytes of the intact records at the start of a log; 0 if the file is not a log.

    The last VERIFIED_CHUNKS chunks count as intact only if their checksums are right. Message indices have no checksum
    and count only if an intact record follows them. Raises LogTooLarge.
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
        if opcode in (0, Opcode.DATA_END) or end > size:
            break
        if length > MAX_RECORD_BYTES:
            raise LogTooLarge(f"a record is larger than {MAX_RECORD_BYTES // 2**20} MiB, the limit")
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
    """The bytes that make a finished log if appended to a log's first `length` bytes, which are intact records."""
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
    _, data = chunk_of(content)
    entries: dict[int, bytearray] = {}
    offset = 0
    while offset < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, offset)
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, offset)
            entries.setdefault(channel, bytearray()).extend(INDEX_ENTRY.pack(time_ns, offset))
        offset += RECORD_HEAD.size + length
    return [message_index(channel, these) for channel, these in entries.items()]


def chunk_of(content: bytes) -> tuple[Chunk, bytes]:
    """A chunk and its decompressed data."""
    chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
    return chunk, decompressed(chunk.compression, chunk.data)


def chunk_is_intact(content: bytes) -> bool:
    """Whether a chunk holds messages that decompress to its checksum. Raises LogTooLarge.

    In MCAP a checksum of 0 means "none"; here it is in the head of a chunk whose data a power cut left as zeros.
    """
    try:
        chunk, data = chunk_of(content)
    except LogTooLarge:
        raise
    except Exception:  # a damaged chunk makes the decoders raise various exceptions
        return False
    return 0 < len(data) == int(chunk.uncompressed_size) and int(chunk.uncompressed_crc) == zlib.crc32(data)
