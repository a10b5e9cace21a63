"""The index at the end of a log, collected record by record, while a log is written or a torn one is repaired.

Only some 200 bytes a chunk are kept, already encoded, so that a long log is finished as quickly as a short one.
Record layouts: MCAP specification 1.0, "Records".
"""

import struct
import zlib
from collections import Counter

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, DataEnd, Footer, MetadataIndex, Statistics, SummaryOffset

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # operation code, length of the content that follows
CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, uncompressed size, checksum
MESSAGE_INDEX_HEAD = struct.Struct("<HI")  # channel, bytes of entries
INDEX_ENTRY_BYTES = 16
OFFSET_ENTRY = struct.Struct("<HQ")
FOOTER_BYTES = 8 + 8 + 4


class LogIndex:
    """Receives every record of a log's data section in order, and gives the bytes that end the file.

    Schemas and channels inside chunks are not indexed; `LogWriter` writes them outside.
    """

    def __init__(self) -> None:
        self._schemas: dict[bytes, None] = {}  # keys are whole records, in order
        self._channels: dict[bytes, None] = {}
        self._chunks = bytearray()
        self._attachments = RecordBuilder()
        self._metadata = RecordBuilder()
        self._counts: Counter[str] = Counter()
        self._messages: Counter[int] = Counter()  # by channel
        self._first_ns: int | None = None
        self._last_ns = 0
        self._open: _OpenChunk | None = None

    def add(self, opcode: int, content: bytes | memoryview, offset: int) -> None:
        """Add one record. content: the record without its head; offset: position of the head in the file [bytes]."""
        if opcode == Opcode.MESSAGE_INDEX:
            if self._open is not None:
                channel, size = MESSAGE_INDEX_HEAD.unpack_from(content)
                self._messages[channel] += size // INDEX_ENTRY_BYTES
                self._open.offsets += OFFSET_ENTRY.pack(channel, offset)
                self._open.end = offset + RECORD_HEAD.size + len(content)
            return
        self._close_chunk()
        if opcode == Opcode.CHUNK:
            self._open = _OpenChunk(content, offset)
            self._counts["chunk"] += 1
            self._first_ns = min(self._open.first_ns, self._open.first_ns if self._first_ns is None else self._first_ns)
            self._last_ns = max(self._open.last_ns, self._last_ns)
        elif opcode == Opcode.SCHEMA:
            self._schemas[RECORD_HEAD.pack(opcode, len(content)) + bytes(content)] = None
        elif opcode == Opcode.CHANNEL:
            self._channels[RECORD_HEAD.pack(opcode, len(content)) + bytes(content)] = None
        elif opcode == Opcode.ATTACHMENT:
            self._counts["attachment"] += 1
            _attachment_index(content, offset).write(self._attachments)
        elif opcode == Opcode.METADATA:
            self._counts["metadata"] += 1
            name, _ = _prefixed(content, 0)
            MetadataIndex(offset, RECORD_HEAD.size + len(content), name).write(self._metadata)

    def end_of_file(self, offset: int) -> list[bytes | bytearray]:
        """The bytes that follow the last record, which ends at `offset`: end of data, summary, footer, magic bytes.

        They come in pieces, because joining an hour's index would take longer than a tick. Do not call `add`
        afterwards.
        """
        self._close_chunk()
        builder = RecordBuilder()
        DataEnd(data_section_crc=0).write(builder)
        data_end = builder.end()
        start = offset + len(data_end)
        groups: tuple[tuple[int, bytes | bytearray], ...] = (
            (Opcode.SCHEMA, b"".join(self._schemas)),
            (Opcode.CHANNEL, b"".join(self._channels)),
            (Opcode.STATISTICS, self._statistics()),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments.end()),
            (Opcode.METADATA_INDEX, self._metadata.end()),
        )
        offsets = RecordBuilder()
        group_start = start
        for opcode, records in groups:
            if records:
                SummaryOffset(group_opcode=opcode, group_start=group_start, group_length=len(records)).write(offsets)
            group_start += len(records)
        summary = [*(records for _, records in groups if records), offsets.end()]
        checksum = 0
        for piece in (*summary, struct.pack("<BQQQ", Opcode.FOOTER, FOOTER_BYTES, start, group_start)):
            checksum = zlib.crc32(piece, checksum)
        footer = RecordBuilder()
        Footer(summary_start=start, summary_offset_start=group_start, summary_crc=checksum).write(footer)
        return [data_end, *summary, footer.end() + MAGIC]

    def _statistics(self) -> bytes:
        builder = RecordBuilder()
        Statistics(
            attachment_count=self._counts["attachment"],
            channel_count=len(self._channels),
            channel_message_counts=dict(self._messages),
            chunk_count=self._counts["chunk"],
            message_count=self._messages.total(),
            message_end_time=self._last_ns,
            message_start_time=self._first_ns or 0,
            metadata_count=self._counts["metadata"],
            schema_count=len(self._schemas),
        ).write(builder)
        return bytes(builder.end())

    def _close_chunk(self) -> None:
        if self._open is not None:
            self._chunks += self._open.index()
            self._open = None


class _OpenChunk:
    """A chunk whose message index records are still being added."""

    def __init__(self, content: bytes | memoryview, offset: int):
        self._start = offset
        self._length = RECORD_HEAD.size + len(content)
        self.end = offset + self._length
        self.first_ns, self.last_ns, self._uncompressed, _ = CHUNK_HEAD.unpack_from(content)
        compression, position = _prefixed(content, CHUNK_HEAD.size)
        self._compression = compression.encode()
        (self._compressed,) = struct.unpack_from("<Q", content, position)
        self.offsets = b""

    def index(self) -> bytes:
        """The chunk's index record."""
        content = b"".join(
            (
                struct.pack("<QQQQI", self.first_ns, self.last_ns, self._start, self._length, len(self.offsets)),
                self.offsets,
                struct.pack("<QI", self.end - self._start - self._length, len(self._compression)),
                self._compression,
                struct.pack("<QQ", self._compressed, self._uncompressed),
            )
        )
        return RECORD_HEAD.pack(Opcode.CHUNK_INDEX, len(content)) + content


def _attachment_index(content: bytes | memoryview, offset: int) -> AttachmentIndex:
    log_time, create_time = struct.unpack_from("<QQ", content)
    name, position = _prefixed(content, 16)
    media_type, position = _prefixed(content, position)
    (size,) = struct.unpack_from("<Q", content, position)
    length = RECORD_HEAD.size + len(content)
    return AttachmentIndex(offset, length, log_time, create_time, size, name, media_type)


def _prefixed(content: bytes | memoryview, offset: int) -> tuple[str, int]:
    """A string that is preceded by its length, and the position after it."""
    (length,) = struct.unpack_from("<I", content, offset)
    return str(bytes(content[offset + 4 : offset + 4 + length]), "utf-8"), offset + 4 + length
