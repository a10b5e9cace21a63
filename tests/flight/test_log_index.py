"""The index at a log's end agrees with the file: what a reader that seeks relies on (MCAP specification 1.0)."""

import io
import struct
import zlib

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.stream_reader import StreamReader

from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import Battery, Rpm

TIMES_NS = [5_000, 1_000, 9_000, 7_000]  # a reading may be dated before one that was written earlier
CHUNK_BYTES = 900
FOOTER_BYTES, MAGIC_BYTES = 1 + 8 + 8 + 8 + 4, 8
MESSAGE, MESSAGE_INDEX, SUMMARY_OFFSET = 0x05, 0x07, 0x0E


@pytest.fixture
def data() -> bytes:
    stream = io.BytesIO()
    log = LogWriter(stream, chunk_bytes=CHUNK_BYTES)
    for repeat in range(20):
        for time_ns in TIMES_NS:
            log.write("/rpm", Rpm(period_us=repeat), time_ns=time_ns + repeat * 10_000, tick=70_000 + repeat)
        log.write("/battery", Battery(voltage_V=15.0), time_ns=6_000 + repeat * 10_000, tick=70_000 + repeat)
    log.finish()
    return stream.getvalue()


def summary(data: bytes):
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None and summary.statistics is not None
    return summary


def chunks(data: bytes) -> list[ChunkIndex]:
    return sorted(summary(data).chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)


def test_statistics_are_those_of_the_messages(data):
    result = summary(data)
    topics = {channel.topic: number for number, channel in result.channels.items()}
    assert result.statistics.message_count == 100
    assert result.statistics.channel_message_counts == {topics["/rpm"]: 80, topics["/battery"]: 20}
    assert result.statistics.message_start_time == 1_000
    assert result.statistics.message_end_time == 9_000 + 19 * 10_000
    assert result.statistics.chunk_count == len(result.chunk_indexes) > 3


def test_each_message_index_leads_to_its_messages(data):
    for chunk in chunks(data):
        times = []
        start = chunk.chunk_start_offset
        compressed = data[start + chunk.chunk_length - chunk.compressed_size : start + chunk.chunk_length]
        records = zstandard.ZstdDecompressor().decompress(compressed, max_output_size=chunk.uncompressed_size)
        for channel, offset in chunk.message_index_offsets.items():
            opcode, _, of_channel, size = struct.unpack_from("<BQHI", data, offset)
            assert (opcode, of_channel) == (MESSAGE_INDEX, channel)
            for time_ns, message_offset in struct.iter_unpack("<QQ", data[offset + 15 : offset + 15 + size]):
                result = struct.unpack_from("<BQHIQ", records, message_offset)
                assert (result[0], result[2], result[4]) == (MESSAGE, channel, time_ns)
                times.append(time_ns)
        assert (min(times), max(times)) == (chunk.message_start_time, chunk.message_end_time)


def test_message_indices_fill_the_file_between_chunks(data):
    for chunk, other in zip(chunks(data), chunks(data)[1:], strict=False):
        assert chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length == other.chunk_start_offset


def test_a_chunk_is_closed_by_the_message_that_fills_it(data):
    longest = 200  # of a message's record
    assert all(chunk.uncompressed_size <= CHUNK_BYTES + longest for chunk in chunks(data))
    assert all(chunk.uncompressed_size > CHUNK_BYTES for chunk in chunks(data)[:-1])


def test_checksums_are_right(data):
    assert list(StreamReader(io.BytesIO(data), validate_crcs=True).records)
    for chunk in chunks(data):
        assert struct.unpack_from("<QQQI", data, chunk.chunk_start_offset + 9)[3] != 0  # 0 means: not checked
    footer = len(data) - MAGIC_BYTES - FOOTER_BYTES
    start, offsets, checksum = struct.unpack_from("<QQI", data, footer + 9)
    assert zlib.crc32(data[start : footer + FOOTER_BYTES - 4]) == checksum
    assert data[offsets] == SUMMARY_OFFSET
    assert data[start] != SUMMARY_OFFSET


def test_ticks_are_numbered_beyond_16_bits(data):
    ticks = {message.sequence for _, _, message in make_reader(io.BytesIO(data)).iter_messages()}
    assert ticks == set(range(70_000, 70_020))
