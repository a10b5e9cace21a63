"""Recognizes a log of an autopilot by its first bytes, and reads it."""

from pathlib import Path

from flight.errors import InputError

ULOG_MAGIC, DATAFLASH_MAGIC = b"ULog\x01\x12\x35", b"\xa3\x95\x80"  # the latter: a format message
TEXT_MAGIC = b"FMT,"
MAVLINK_MARKERS, EARLIEST_US, LATEST_US = b"\xfe\xfd", 946_684_800_000_000, 4_102_444_800_000_000  # 2000 and 2100
TELEMETRY_BYTES = 9  # the time of reception, and the marker of the first frame
PX4, ARDUPILOT = "PX4", "ArduPilot"


def firmware_of(path: Path) -> str | None:
    """PX4 or ARDUPILOT; None where the file is neither's log. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            start = stream.read(TELEMETRY_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if start.startswith(ULOG_MAGIC):
        return PX4
    return ARDUPILOT if start.startswith((DATAFLASH_MAGIC, TEXT_MAGIC)) or is_telemetry(start) else None


def is_telemetry(start: bytes) -> bool:
    """Whether a .tlog begins so: the time of reception, 8 bytes, big-endian, in us since 1970, and a MAVLink frame."""
    time_us, marker = int.from_bytes(start[:8], "big"), start[8:TELEMETRY_BYTES]
    return bool(marker) and marker in MAVLINK_MARKERS and EARLIEST_US < time_us < LATEST_US
