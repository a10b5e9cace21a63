"""Completing logs that a power cut left unfinished, so that any MCAP reader opens them.

Nothing that can be read is touched: what is cut off is the torn record at the end, and an end is put in its place. The
index is not made again; readers without it go through the file from the start.
"""

import fcntl
import io
import os
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, DataEnd, Footer

from daq.recorder import sync_directory
from flight.log_reader import MAGIC

RECORD_HEAD = 9  # operation code, length in 8 bytes (MCAP specification, "Records")


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
        stream.seek(kept)
        stream.write(ending())
        stream.truncate()
        stream.flush()
        os.fsync(stream.fileno())
    sync_directory(path.parent)
    return Salvaged(path, kept, size - kept)


def sound_length(stream: BinaryIO) -> int:
    """How many bytes of a log are whole records with right checksums, counted from its start; 0 if it is not one.

    Message indices carry no checksum; they are believed when a sound record stands behind them.
    """
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        return 0
    sound = position = len(MAGIC)
    while len(head := stream.read(RECORD_HEAD)) == RECORD_HEAD:
        opcode, length = head[0], int.from_bytes(head[1:], "little")
        if opcode in (0, Opcode.DATA_END) or length > 2**31:
            break
        content = stream.read(length)
        if len(content) < length or (opcode == Opcode.CHUNK and not chunk_is_sound(content)):
            break
        position += RECORD_HEAD + length
        if opcode != Opcode.MESSAGE_INDEX:
            sound = position
    return sound


def chunk_is_sound(content: bytes) -> bool:
    """Whether a chunk can be decompressed to what its checksum says."""
    try:
        chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
        data = zstandard.decompress(chunk.data, chunk.uncompressed_size) if chunk.compression else chunk.data
    except Exception:  # whatever a torn chunk makes the two decoders say
        return False
    return len(data) == chunk.uncompressed_size and chunk.uncompressed_crc in (0, zlib.crc32(data))


def ending() -> bytes:
    """End of data, a footer without index, and the magic."""
    builder = RecordBuilder()
    DataEnd(data_section_crc=0).write(builder)
    Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    return builder.end() + MAGIC
