"""Recognizes a log of an autopilot by its first bytes, and reads it."""

from pathlib import Path

from flight.errors import InputError

ULOG_MAGIC, DATAFLASH_MAGIC = b"ULog\x01\x12\x35", b"\xa3\x95\x80"  # the latter: a format message
PX4, ARDUPILOT = "PX4", "ArduPilot"


def firmware_of(path: Path) -> str | None:
    """PX4 or ARDUPILOT; None where the file is neither's log. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(ULOG_MAGIC))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if start == ULOG_MAGIC:
        return PX4
    return ARDUPILOT if start.startswith(DATAFLASH_MAGIC) else None
