"""Lists the logs of a folder for `daq list`: when each began, how long it is, whether it is complete.

Only the index and one chunk of each log are read, so that a full card is listed in seconds.
"""

import io
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel
from mcap.summary import Summary

from flightpower.daq.disk_space import is_finished
from flightpower.daq.log_names import all_logs
from flightpower.daq.log_recovery import MAX_RECORD_BYTES, chunk_of
from flightpower.flight.errors import InputError
from flightpower.flight.log_index import CHUNK_HEAD, MAGIC, MESSAGE_INDEX_HEAD, RECORD_HEAD
from flightpower.flight.log_reader import CUT
from flightpower.flight.log_writer import MESSAGE_HEAD
from flightpower.flight.messages import Time
from flightpower.flight.satellite_time import ahead_of_log_ns

TIME_TOPIC = "/time"


class ListedLog(NamedTuple):
    """A log. begin: UTC by the satellites if `by_satellites`, else by the system clock; None if unknown."""

    path: Path
    bytes: int
    begin: datetime | None
    by_satellites: bool
    duration_s: float
    state: str  # complete, CUT, empty, or cannot be read and why


def list_logs(directory: Path, latest: int | None = None) -> list[ListedLog]:
    """The logs of a folder, with numbered logs last and in order. latest: number of logs from the end, None for all.

    Raises InputError if the folder cannot be read.
    """
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give the one with the logs")
    logs = all_logs(directory)
    return [listed(path) for path in (logs if latest is None else logs[-latest:])]


def listed(path: Path) -> ListedLog:
    """Describe one log. Its state names whatever is wrong with it."""
    size = 0
    try:
        size = path.stat().st_size
        if not size:
            return ListedLog(path, size, None, False, 0.0, "empty")
        if not is_finished(path):
            return unfinished(path, size)
        with path.open("rb") as stream:
            summary = SeekingReader(stream, record_size_limit=MAX_RECORD_BYTES).get_summary()
            if summary is None or summary.statistics is None:
                return ListedLog(path, size, None, False, 0.0, "without an index")
            begin_ns = summary.statistics.message_start_time
            offset_ns = satellites_minus_log_time_ns(stream, summary)
            begin = datetime.fromtimestamp((begin_ns + (offset_ns or 0)) / 1e9, UTC)
            duration_s = (summary.statistics.message_end_time - begin_ns) / 1e9
            return ListedLog(path, size, begin, offset_ns is not None, duration_s, "complete")
    except OSError as error:
        return ListedLog(path, size, None, False, 0.0, f"cannot be read: {error.strerror or error}")
    except Exception as error:  # decoders raise various errors on a damaged index; the other logs are still listed
        return ListedLog(path, size, None, False, 0.0, f"cannot be read: {type(error).__name__}")


def unfinished(path: Path, size: int) -> ListedLog:
    """Describe a log that is being recorded, or whose end is missing, from its first to its last whole chunk."""
    chunks: list[_WholeChunk] = []
    declared: list[tuple[int, int]] = []  # start and length of each channel record's content
    with path.open("rb") as stream:
        offset = len(MAGIC)
        while offset + RECORD_HEAD.size + CHUNK_HEAD.size <= size:
            stream.seek(offset)
            head = stream.read(RECORD_HEAD.size + CHUNK_HEAD.size)
            opcode, length = RECORD_HEAD.unpack_from(head)
            content, offset = offset + RECORD_HEAD.size, offset + RECORD_HEAD.size + length
            if opcode == Opcode.CHUNK and offset <= size:
                begin_ns, end_ns, _, _ = CHUNK_HEAD.unpack_from(head, RECORD_HEAD.size)
                chunks.append(_WholeChunk(begin_ns, end_ns, content, length, set()))
            elif opcode == Opcode.CHANNEL:
                declared.append((content, length))
            elif opcode == Opcode.MESSAGE_INDEX and chunks:
                channel, _ = MESSAGE_INDEX_HEAD.unpack_from(head, RECORD_HEAD.size)
                chunks[-1].channels.add(channel)
        if not chunks:
            return ListedLog(path, size, None, False, 0.0, CUT)
        offset_ns = _offset_of_unfinished_ns(stream, chunks, declared)
    begin = datetime.fromtimestamp((chunks[0].begin_ns + (offset_ns or 0)) / 1e9, UTC)
    duration_s = (chunks[-1].end_ns - chunks[0].begin_ns) / 1e9
    return ListedLog(path, size, begin, offset_ns is not None, duration_s, f"{CUT}: {duration_s:.1f} s read")


class _WholeChunk(NamedTuple):
    """A chunk of a log without an index. content: where it begins; channels: those named by the records after it."""

    begin_ns: int
    end_ns: int
    content: int
    length: int
    channels: set[int]


def _offset_of_unfinished_ns(
    stream: BinaryIO, chunks: list[_WholeChunk], declared: list[tuple[int, int]]
) -> int | None:
    """What to add to the log's times to get UTC [ns], from the last chunk that has /time; None without GPS.

    declared: start and length of the channel records. The result is also None if one of them or that chunk is damaged.
    """

    def content(offset: int, length: int) -> bytes:
        stream.seek(offset)
        return stream.read(min(length, MAX_RECORD_BYTES))

    try:
        channels = [Channel.read(ReadDataStream(io.BytesIO(content(*place)))) for place in declared]
        of_time = {channel.id for channel in channels if channel.topic == TIME_TOPIC}
        for chunk in reversed(chunks):
            if not of_time.isdisjoint(chunk.channels):
                return _offset_ns(chunk_of(content(chunk.content, chunk.length))[1], of_time)
    except OSError:
        raise
    except Exception:  # decoders raise various errors on damaged records; begin and length are known without them
        pass
    return None


def satellites_minus_log_time_ns(stream: BinaryIO, summary: Summary) -> int | None:
    """What to add to the log's times to get UTC [ns], from the last chunk that has /time; None without GPS."""
    channels = {number for number, channel in summary.channels.items() if channel.topic == TIME_TOPIC}
    for chunk in sorted(summary.chunk_indexes, key=lambda each: each.message_end_time, reverse=True):
        if channels.isdisjoint(chunk.message_index_offsets):
            continue
        stream.seek(chunk.chunk_start_offset + RECORD_HEAD.size)
        _, records = chunk_of(stream.read(min(chunk.chunk_length - RECORD_HEAD.size, MAX_RECORD_BYTES)))
        return _offset_ns(records, channels)
    return None


def _offset_ns(records: bytes, channels: set[int]) -> int | None:
    offset = 0
    while offset < len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, offset)
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(records, offset)
            if channel in channels:
                message = msgspec.json.decode(
                    records[offset + MESSAGE_HEAD.size : offset + RECORD_HEAD.size + length], type=Time
                )
                return ahead_of_log_ns(message, time_ns)
        offset += RECORD_HEAD.size + length
    return None
