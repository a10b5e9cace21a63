"""One log file being recorded: encoded and packed by the sampling thread, written by the disk's."""

from collections.abc import Callable
from pathlib import Path

from mcap.opcode import Opcode
from zstandard import ZstdCompressor

from daq.disk import DiskWriter
from daq.sensors import Sample
from flight.log_writer import LogWriter

CHUNK_EVERY_NS = 400_000_000  # of the log's time: what a power cut can cost, together with the disk's SYNC_EVERY_S
BACKLOG_BYTES = 8 * 2**20  # several minutes of the default tray
NEVER_BY_SIZE = 2**30  # chunks are closed by time


class Recorder:
    """A log file being recorded.

    name, wait: as of `DiskWriter`. offset_ns: Unix time minus monotonic time, fixed for the whole recording.
    compressor: as of `LogWriter`.
    When the disk does not keep up, whole chunks are left out, so that the file stays sound; `dropped` counts messages.
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
        self.log = LogWriter(self.disk, chunk_bytes=NEVER_BY_SIZE, compressor=compressor)  # type: ignore[arg-type]
        self._chunk_due_ns = float("-inf")  # the first tick is on its way to the disk at once
        self._in_chunk = 0

    @property
    def path(self) -> Path | None:
        """Where it is; None until it is open."""
        return self.disk.path

    def write(self, samples: list[Sample], *, tick: int, now_ns: int) -> None:
        """Add a tick's messages; closes the chunk when it is old enough."""
        for sample in samples:
            self.log.write(sample.topic, sample.message, time_ns=sample.time_ns + self.offset_ns, tick=tick)
        self._in_chunk += len(samples)
        self.ticks += 1
        if now_ns >= self._chunk_due_ns:
            self._close_chunk()
            self._chunk_due_ns = now_ns + CHUNK_EVERY_NS

    def take_over(self, other: "Recorder") -> None:
        """Add the chunks that `other` did not get onto its disk. Both have declared the same topics in order."""
        other._close_chunk()
        for piece in other.disk.unsaved():
            if piece[0] == Opcode.CHUNK:
                self.log.append(piece)

    def finish(self) -> None:
        """Hand over the last chunk and the index; returns before the disk has them."""
        self._close_chunk()
        self.log.finish()
        self.disk.retire()

    def _close_chunk(self) -> None:
        if not self._in_chunk:
            return
        if self.disk.backlog_bytes > BACKLOG_BYTES:
            self.log.close_chunk()
            self.dropped += self._in_chunk
        else:
            self.log.flush()
        self._in_chunk = 0
