"""Checks for `daq check` whether the computer itself is fit to record: its supply, and the speed of its card."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

# File of Linux's driver raspberrypi-hwmon: 1 if the supply was below 4.63 V since the last reading, which clears it.
PI_VOLTAGE = "rpi_volt"
ALARM = "in0_lcrit_alarm"
TEST_BYTES = 4 * 2**20
BLOCK_BYTES = 2**18  # the daemon writes blocks of this size
# A log grows by 10 kB/s at 25 Hz. A card of class A1 writes 10 MB/s; a card slower than this limit is failing or nearly
# full.
LEAST_BYTES_PER_S = 1e6
LONGEST_BLOCK_S = 2.0  # the daemon reports a disk that takes longer than this


class ComputerFact(NamedTuple):
    """The result of a check: status `ok` and the finding, or another status and advice."""

    ok: bool
    text: str


def supply_check(hwmon: Path = Path("/sys/class/hwmon")) -> ComputerFact | None:
    """Read the Pi's own undervoltage detector; None on another computer."""
    for monitor in sorted(hwmon.glob("*")):
        try:
            if (monitor / "name").read_text().strip() != PI_VOLTAGE:
                continue
            low = (monitor / ALARM).read_text().strip() != "0"
        except OSError:
            continue
        if low:
            return ComputerFact(
                False, "the Pi's supply was below 4.63 V: use a converter of 5 V and 3 A, and short thick wires"
            )
        return ComputerFact(True, "the Pi's supply has stayed above 4.63 V")
    return None


def card_check(directory: Path) -> ComputerFact | None:
    """Measure how fast the disk of `directory` writes, with a sync after each block; None if it cannot be written."""
    slowest_s = 0.0
    try:
        with tempfile.TemporaryFile(dir=directory) as stream:
            begin_s = time.monotonic()
            for _ in range(TEST_BYTES // BLOCK_BYTES):
                block_s = time.monotonic()
                stream.write(os.urandom(BLOCK_BYTES))
                stream.flush()
                os.fdatasync(stream.fileno())
                slowest_s = max(slowest_s, time.monotonic() - block_s)
            rate = TEST_BYTES / (time.monotonic() - begin_s)
    except OSError:
        return None
    return card_speed(rate, slowest_s)


def card_speed(bytes_per_s: float, slowest_s: float) -> ComputerFact:
    """Judge a write speed and the time of the slowest block."""
    text = f"the disk writes {bytes_per_s / 1e6:.1f} MB/s, 0.26 MB in at most {slowest_s:.2f} s"
    if bytes_per_s < LEAST_BYTES_PER_S or slowest_s > LONGEST_BLOCK_S:
        return ComputerFact(False, f"{text}: replace the card (class A1 or better)")
    return ComputerFact(True, text)
