"""Recognizes a log of an autopilot by its first bytes."""

from enum import StrEnum
from pathlib import Path

from flight.errors import InputError

ULOG_MAGIC, DATAFLASH_MAGIC = b"ULog\x01\x12\x35", b"\xa3\x95\x80"  # the latter: a format message
TEXT_MAGIC = b"FMT,"
MAVLINK_MARKERS = b"\xfe\xfd"


class Autopilot(StrEnum):
    """Whose log it is."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"


def autopilot_of(path: Path) -> Autopilot | None:
    """None where the file is no autopilot's log. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            start = stream.read(9)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if start.startswith(ULOG_MAGIC):
        return Autopilot.PX4
    found = start.startswith((DATAFLASH_MAGIC, TEXT_MAGIC)) or is_telemetry(start)
    return Autopilot.ARDUPILOT if found else None


def is_telemetry(start: bytes) -> bool:
    """Whether a .tlog begins so: the time of reception, 8 bytes, big-endian, in us since 1970, and a MAVLink frame."""
    time_s, marker = int.from_bytes(start[:8], "big") * 1e-6, start[8:9]
    return (
        bool(marker) and marker in MAVLINK_MARKERS and 946_684_800 < time_s < 4_102_444_800
    )  # of the years 2000, 2100
