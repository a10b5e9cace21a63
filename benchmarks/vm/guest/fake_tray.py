"""Runs in the virtual machine: serves fake I2C parts as /dev/i2c-1, and sends a heartbeat on a serial line.

The device is made with CUSE and has the number of a real one (89:1), so that the sandbox's list of devices applies.
Each line of the heartbeat has the monotonic time [s], the number of logs, and the size of the newest log [bytes].
"""

import itertools
import os
import signal
import socket
import struct
import threading
import time
from pathlib import Path

from parts import parts_at_rest

from flightpower.hw_fakes.fuse_i2c import FuseI2C
from flightpower.hw_fakes.i2c import I2CBus
from flightpower.hw_fakes.tray import I2C_BUS

HEARTBEAT_LINE = "/dev/ttyS1"
HEARTBEAT_S = 0.05
LOOK_EVERY = 20  # number of heartbeats between looks at the logs
LOGS = Path("/var/lib/flightpower")
MAJOR, MINOR = 89, 1  # device number of /dev/i2c-1
# linux/fuse.h
CUSE_INIT = 4096
CUSE_INIT_OUT = struct.Struct("=IIIIIIII40x")
PROTOCOL = (7, 31)
LARGEST = 1 << 16


class CuseI2C(FuseI2C):
    """`FuseI2C` as a character device. All requests except the first are the same as for FUSE."""

    def __init__(self, bus: I2CBus, bit_rate_Hz: float = 400e3):
        import ctypes

        self._bus = bus
        self._byte_s = 9 / bit_rate_Hz
        self.path = Path(I2C_BUS)
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._fuse = os.open("/dev/cuse", os.O_RDWR)
        self._thread = threading.Thread(target=self._serve, name="cuse", daemon=True)
        self._thread.start()

    def _answer(self, opcode: int, body: bytes, pid: int) -> bytes:
        if opcode == CUSE_INIT:
            head = CUSE_INIT_OUT.pack(*PROTOCOL, 0, 0, LARGEST, LARGEST, MAJOR, MINOR)
            return head + f"DEVNAME={self.path.name}".encode() + b"\0"
        return super()._answer(opcode, body, pid)


def newest_log() -> tuple[int, int]:
    """Return the number of logs, and the size [bytes] of the log with the highest number."""
    logs = sorted(LOGS.glob("log-*.mcap")) if LOGS.is_dir() else []
    try:
        return len(logs), logs[-1].stat().st_size if logs else 0
    except FileNotFoundError:  # the log has been renamed meanwhile
        return len(logs), 0


def tell_systemd() -> None:
    address = os.environ["NOTIFY_SOCKET"]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.sendto(b"READY=1", address)


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    CuseI2C(parts_at_rest().i2c(I2C_BUS))
    while not Path(I2C_BUS).exists():
        time.sleep(0.05)
    tell_systemd()
    line = os.open(HEARTBEAT_LINE, os.O_WRONLY | os.O_NOCTTY)
    for beat in itertools.count():
        if beat % LOOK_EVERY == 0:
            count, size = newest_log()
        os.write(line, f"{time.monotonic():.3f} {count} {size}\n".encode())
        time.sleep(HEARTBEAT_S)


if __name__ == "__main__":
    main()
