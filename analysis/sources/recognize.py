"""Recognizes a log of an autopilot by its first bytes."""

import gzip
import re
from enum import StrEnum
from pathlib import Path

from flight.errors import InputError

ULOG_MAGIC, DATAFLASH_MAGIC = b"ULog\x01\x12\x35", b"\xa3\x95\x80"  # the latter: a format message
TEXT_MAGIC = b"FMT,"
MAVLINK_MARKERS = b"\xfe\xfd"
GZIP_MAGIC = b"\x1f\x8b"
PAPARAZZI_LINE = re.compile(rb"\d+\.\d+ \d+ [A-Z][A-Z0-9_]+( |\r?\n|$)")  # time, aircraft, message


class Autopilot(StrEnum):
    """Whose log it is."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"
    PAPARAZZI = "Paparazzi"


def autopilot_of(path: Path) -> Autopilot | None:
    """None where the file is no autopilot's log. Raises InputError when it cannot be read."""
    start = first_bytes(path)
    if start.startswith(ULOG_MAGIC):
        return Autopilot.PX4
    if PAPARAZZI_LINE.match(start):
        return Autopilot.PAPARAZZI
    found = start.startswith((DATAFLASH_MAGIC, TEXT_MAGIC)) or is_telemetry(start)
    return Autopilot.ARDUPILOT if found else None


def first_bytes(path: Path, count: int = 200) -> bytes:
    """Those of the contents of a file that may be compressed by gzip. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            start = stream.read(count)
        if start.startswith(GZIP_MAGIC):
            with gzip.open(path) as stream:
                return stream.read(count)
    except (OSError, EOFError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    return start


def is_telemetry(start: bytes) -> bool:
    """Whether a .tlog begins so: the time of reception, 8 bytes, big-endian, in us since 1970, and a MAVLink frame."""
    time_s, marker = int.from_bytes(start[:8], "big") * 1e-6, start[8:9]
    return (
        bool(marker) and marker in MAVLINK_MARKERS and 946_684_800 < time_s < 4_102_444_800
    )  # of the years 2000, 2100
