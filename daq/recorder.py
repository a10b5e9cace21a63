"""Writes one log file: the sampling thread encodes messages, and the disk thread writes them."""

from collections.abc import Callable
from pathlib import Path

from mcap.opcode import Opcode
from zstandard import ZstdCompressor

from flightpower.daq.disk_writer import DiskWriter
from flightpower.daq.sensors import Sample
from flightpower.flight.log_writer import LogWriter

CHUNK_EVERY_NS = 400_000_000  # of the log's time; with the disk's SYNC_EVERY_S it limits the loss by a power cut
BACKLOG_BYTES = 8 * 2**20  # several minutes of the default tray; messages are dropped beyond it
NEVER_BY_SIZE = 2**30  # chunks are closed by time, not by size


class Recorder:
    """Writes one log file.

    name, wait: see `DiskWriter`. offset_ns: Unix time minus monotonic time, fixed for the whole recording.
    compressor: see `LogWriter`.
    If the disk is too slow, whole chunks are dropped, so that the file stays valid; `dropped` counts their messages.
    """

    def __init__(
        self,
        name: Callable[[int], Path],
        *,
        offset_ns: int,
        wait: bool = True,
        compressor: ZstdCompressor | None = None,
    ):
        self.disk = DiskWriter(name, wait=wait)
        self.offset_ns = offset_ns
        self.dropped = 0
        self.ticks = 0
        self._header_bytes = 0  # size of the bytes before the first message
        self.log = LogWriter(self.disk, chunk_bytes=NEVER_BY_SIZE, compressor=compressor)  # type: ignore[arg-type]
        self._chunk_due_ns = float("-inf")  # the first tick is written at once
        self._in_chunk = 0

    @property
    def path(self) -> Path | None:
        """Path of the file; None until it is open."""
        return self.disk.path

    def write(self, samples: list[Sample], *, tick: int, now_ns: int) -> None:
        """Add a tick's messages, and late ones of earlier ticks. Closes the chunk when it is old enough."""
        if not self.ticks:
            self._header_bytes = self.log.size_bytes
        write, offset_ns = self.log.write, self.offset_ns
        for topic, time_ns, message, own in samples:
            write(topic, message, time_ns=time_ns + offset_ns, tick=tick if own is None else own)
        self._in_chunk += len(samples)
        self.ticks += 1
        if now_ns >= self._chunk_due_ns:
            self._close_chunk()
            self._chunk_due_ns = now_ns + CHUNK_EVERY_NS

    def take_over(self, other: "Recorder") -> None:
        """Add the chunks that `other` could not write. Both must have declared the same topics in the same order."""
        other._close_chunk()
        for piece in other.disk.hand_over():
            if piece[0] == Opcode.CHUNK:
                self.log.append(piece)

    @property
    def holds_messages(self) -> bool:
        """Whether more than the file's header is safely on the disk."""
        return self.disk.synced_bytes > self._header_bytes

    def cut_off(self) -> None:
        """Close the file with the data safe in it; remove it if it has no message. Another file has the rest."""
        self.disk.cut_off(remove=not self.holds_messages)

    def finish(self) -> None:
        """Queue the last chunk and the index for writing. Returns before they are on the disk."""
        self._close_chunk()
        self.log.finish()
        self.disk.finish()

    def _close_chunk(self) -> None:
        if not self._in_chunk:
            return
        if self.disk.backlog_bytes > BACKLOG_BYTES:
            self.log.close_chunk()
            self.dropped += self._in_chunk
        else:
            self.log.flush()
        self._in_chunk = 0
