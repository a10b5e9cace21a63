"""Finds when a log began and how long it is from its first and last bytes, for a list of many logs.

A file without times in these bytes gives no message here; the analysis reports what is wrong with it.
"""

import gzip
import re
import struct
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightpower.analysis.sources.dataflash import DataflashLog
from flightpower.analysis.sources.grid_settings import CHANNELS
from flightpower.flight.errors import InputError
from flightpower.flight.formats import GZIP_MAGIC, Format, format_of, is_telemetry

TEXT_TIME = re.compile(rb"^[A-Z][A-Z0-9]+, (\d{4,})[,\s]", re.MULTILINE)
PAPARAZZI_LINE = re.compile(rb"\d+\.\d+ \d+ [A-Z][A-Z0-9_]+( |$)")  # a line starts with time, aircraft and message
ULOG_TYPES = frozenset(b"ABCDFILMOPQRS")


class LogKind(StrEnum):
    """The program that wrote a log, as named in lists."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"
    ARDUPILOT_TEXT = "ArduPilot, as text"
    TELEMETRY = "ArduPilot, by radio"
    PAPARAZZI = "Paparazzi"
    DAEMON = "flightpower"
    TABLE = "table"
    UNKNOWN = "unknown"


class Extent(NamedTuple):
    """kind : what wrote the log     start_s : Unix time, if the log gives it     length_s : duration, if it is known"""

    kind: LogKind
    start_s: float | None = None
    length_s: float | None = None


def extent(path: Path) -> Extent:
    """Return facts about a log from the first and last bytes of its file. Raises OSError if it cannot be read."""
    first, last = _edges(path)
    try:
        form = format_of(path)
    except InputError:  # the file is damaged; the analysis reports how
        return Extent(LogKind.UNKNOWN)
    match form:
        case Format.ULOG:
            return Extent(LogKind.PX4, _ulog_start_s(path), _length(_ulog_times_s(first, last)))
        case Format.PAPARAZZI:
            return Extent(LogKind.PAPARAZZI, None, _length(_line_times_s(first + b"\n" + last)))
        case Format.TELEMETRY:
            times = list(_telemetry_times_s(first, last))
            return Extent(LogKind.TELEMETRY, times[0] if times else None, _length(times))
        case Format.DATAFLASH_TEXT:
            times = [1e-6 * float(text) for text in TEXT_TIME.findall(first + b"\n" + last)]
            return Extent(LogKind.ARDUPILOT_TEXT, None, _length(times))
        case Format.DATAFLASH:
            return Extent(LogKind.ARDUPILOT, None, _length(_dataflash_times_s(first + last)))
        case Format.DAEMON:
            return _mcap(path)
    return Extent(LogKind.TABLE)


def _length(times_s: list[float]) -> float | None:
    return max(times_s) - min(times_s) if len(times_s) > 1 else None


def _edges(path: Path, count: int = 1 << 17) -> tuple[bytes, bytes]:
    """Return the first and the last bytes of the file, or of its contents if it is compressed."""
    with path.open("rb") as stream:
        start = stream.read(count)
        if start.startswith(GZIP_MAGIC):
            try:
                content = gzip.decompress(start + stream.read())
            except (EOFError, gzip.BadGzipFile):
                return b"", b""
            return content[:count], content[count:][-count:]
        size = path.stat().st_size
        stream.seek(max(count, size - count))
        return start, stream.read()


def _ulog_start_s(path: Path, count: int = 1 << 20) -> float | None:
    """Return the Unix time of the start, from GPS. count: number of first bytes, about ten seconds, that contain it."""
    from flightpower.analysis.sources.px4 import start_unix_s  # loads pyulog

    return start_unix_s(_edges(path, count)[0])


def _ulog_times_s(first: bytes, last: bytes) -> list[float]:
    """Return the time in the header and the last time in the data, found where whole messages run on to the end."""
    (start_us,) = struct.unpack_from("<Q", first, 8) if len(first) >= 16 else (0,)
    data = last or first[16:]
    for begin in range(min(len(data), 1 << 16)):
        times = _ulog_chain_us(data, begin)
        if times:
            return [1e-6 * start_us, 1e-6 * times[-1]]
    return []


def _ulog_chain_us(data: bytes, offset: int) -> list[int]:
    """Return the data messages' times [us] from `offset` on; empty unless ten or more messages run on to the end."""
    times: list[int] = []
    count = 0
    while offset + 3 <= len(data):
        size, kind = struct.unpack_from("<HB", data, offset)
        if kind not in ULOG_TYPES or size == 0:
            return []
        if kind == ord("D") and offset + 13 <= len(data):
            times += struct.unpack_from("<Q", data, offset + 5)
        offset, count = offset + 3 + size, count + 1
    return times if count >= 10 else []


def _dataflash_times_s(data: bytes) -> list[float]:
    log = DataflashLog(data)
    times_s = []
    for name in log.names():
        for field, unit in (("TimeUS", 1e-6), ("TimeMS", 1e-3)):
            times = log.columns(name).get(field, np.zeros(0)) if name != "GPS" or field == "TimeUS" else np.zeros(0)
            times_s += [unit * float(t) for t in times if t > 0]
    # A damaged byte can put a time years off.
    usual = float(np.median(times_s)) if times_s else 0.0
    return [t for t in times_s if abs(t - usual) < 1e5]


def _telemetry_times_s(first: bytes, last: bytes) -> Iterator[float]:
    for data in (first, last):
        for offset in range(len(data) - 9):
            if is_telemetry(data[offset : offset + 9]):
                yield int.from_bytes(data[offset : offset + 8], "big") * 1e-6


def _line_times_s(text: bytes) -> list[float]:
    return [float(line.split(b" ", 1)[0]) for line in text.splitlines() if PAPARAZZI_LINE.match(line)]


def _mcap(path: Path) -> Extent:
    """Reads the statistics at the end of the file; a truncated file has none."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader

    with path.open("rb") as stream:
        try:
            summary = SeekingReader(stream).get_summary()
        except (McapError, struct.error, EOFError):
            summary = None
    if summary is None or summary.statistics is None:
        return Extent(LogKind.DAEMON)
    statistics = summary.statistics
    start_s = statistics.message_start_time / 1e9
    return Extent(
        LogKind.DAEMON,
        start_s if start_s > CHANNELS.clock_set_unix_s else None,
        statistics.message_end_time / 1e9 - start_s,
    )
