"""I2C buses, serial lines and UDP ports on Linux, with the interfaces of `daq.bus`.

The only module that imports smbus2 and pyserial. Devices are locked with flock(2) while they are open, because two
readers of a bus spoil each other's readings; opening a locked one raises 16 (EBUSY).
"""

import ctypes
import errno
import fcntl
import os
import socket
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from daq.bus import IN_USE, BytePort, I2CBus

T = TypeVar("T")

RECEIVE_BYTES = 4096  # the kernel's buffer of a serial line (N_TTY_BUF_SIZE)
I2C_RETRIES = 0x0701  # linux/i2c-dev.h
I2C_TIMEOUT = 0x0702  # in units of 10 ms
I2C_RDWR = 0x0707
PREPARED_TRANSFERS = 128  # kept; the default tray needs about thirty, and one more for each length of FIFO read


class LinuxI2C:
    """/dev/i2c-N through smbus2, with a timeout for each transfer (rounded up to 10 ms). For one thread at a time.

    The same transfers are repeated every tick. Preparing one takes longer than the transfer, so prepared ones are kept.
    """

    def __init__(self, device: str, timeout_ms: int = 20):
        from smbus2 import SMBus

        self._prepared = lru_cache(PREPARED_TRANSFERS)(_prepare)
        self._bus = SMBus(device)
        assert self._bus.fd is not None  # set when the bus is opened
        try:
            fcntl.flock(self._bus.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._bus.close()
            raise _in_use(device) from None
        fcntl.ioctl(self._bus.fd, I2C_TIMEOUT, -(-timeout_ms // 10))
        fcntl.ioctl(self._bus.fd, I2C_RETRIES, 0)

    def write(self, address: int, data: bytes) -> None:
        self._do(address, data, 0)

    def read(self, address: int, count: int) -> bytes:
        return self._do(address, b"", count)

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._do(address, data, count)

    def _do(self, address: int, data: bytes, count: int) -> bytes:
        """The bytes read. Raises OSError if the transfer is incomplete: the buffer then holds an old reading."""
        request, messages = self._prepared(address, data, count)
        if fcntl.ioctl(self._bus.fd, I2C_RDWR, request) != len(messages):  # type: ignore[arg-type]  # it is open
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return ctypes.string_at(messages[-1].buf, count)  # bytes(message) takes one byte after the other


def _prepare(address: int, data: bytes, count: int) -> tuple[Any, list[Any]]:
    """The argument of ioctl(I2C_RDWR) for a write, a read, or both joined by a repeated start; and its messages."""
    from smbus2 import i2c_msg
    from smbus2.smbus2 import i2c_rdwr_ioctl_data

    messages = [i2c_msg.write(address, data)] if data else []
    if count:
        messages.append(i2c_msg.read(address, count))
    return i2c_rdwr_ioctl_data.create(*messages), messages  # type: ignore[arg-type]  # it takes any number of them


class LinuxSerial:
    """A serial line through pyserial, in raw mode, non-blocking."""

    def __init__(self, device: str, baud: int):
        import serial

        try:
            self._port = serial.Serial(device, baud, timeout=0, write_timeout=0.02, exclusive=True)
        except serial.SerialException as error:
            number = error.errno or errno.EIO
            if number == errno.EAGAIN:  # another process holds the lock
                raise _in_use(device) from None
            raise OSError(number, os.strerror(number), device) from None
        except ValueError as error:  # a baud rate that the line does not support
            raise OSError(errno.EINVAL, str(error), device) from None

    def read_available(self) -> bytes:
        # Read without asking for the number of bytes first: that takes a lock which the kernel holds while it fills the
        # buffer, and has been seen to take 200 ms.
        return self._translate_errors(lambda: bytes(self._port.read(RECEIVE_BYTES)))

    def write(self, data: bytes) -> None:
        self._translate_errors(lambda: self._port.write(data))

    def close(self) -> None:
        self._port.close()

    def _translate_errors(self, transfer: Callable[[], T]) -> T:
        import serial

        try:
            return transfer()
        except serial.SerialTimeoutException:
            raise OSError(errno.ETIMEDOUT, f"{self._port.port}: write timed out") from None
        except serial.SerialException as error:  # raised by pyserial for an unplugged adapter
            raise OSError(errno.EIO, f"{self._port.port}: {error}") from None


def _in_use(device: str) -> OSError:
    return OSError(errno.EBUSY, IN_USE, device)


class UdpPort:
    """UDP datagrams as a stream: receives on `udp:HOST:PORT`, sends to the address of the latest datagram."""

    def __init__(self, host: str, port: int):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise _in_use(f"udp:{host}:{port}") from None
            raise
        self._peer: tuple[str, int] | None = None

    def read_available(self) -> bytes:
        received = b""
        while True:
            try:
                data, self._peer = self._socket.recvfrom(65535)
            except BlockingIOError:
                return received
            received += data

    def write(self, data: bytes) -> None:
        if self._peer is not None:
            self._socket.sendto(data, self._peer)

    def close(self) -> None:
        self._socket.close()


class PulseFiles:
    """`rcio:DIRECTORY`: text files ch0, ch1, … with one pulse width [us] each, read as one line. Read only."""

    def __init__(self, directory: str):
        self._files = [path.open("rb", buffering=0) for path in sorted(Path(directory).glob("ch*"), key=_number)]
        if not self._files:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), f"{directory}/ch0")
        try:
            fcntl.flock(self._files[0], fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise _in_use(directory) from None

    def read_available(self) -> bytes:
        words = []
        for file in self._files:
            file.seek(0)
            words.append((file.read(16) or b"").strip())
        return b" ".join(words) + b"\n"

    def write(self, data: bytes) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    def close(self) -> None:
        for file in self._files:
            file.close()


def _number(path: Path) -> int:
    digits = path.name.removeprefix("ch")
    return int(digits) if digits.isdigit() else -1


OpenPort = LinuxSerial | UdpPort | PulseFiles


class LinuxBuses:
    """The device files of this computer.

    A bus is opened once, under any of its names, and shared by its drivers. A port is closed and opened again on each
    call, so that an adapter that was unplugged works again.
    """

    def __init__(self) -> None:
        self._buses: dict[str, LinuxI2C] = {}
        self._ports: dict[str, OpenPort] = {}

    def i2c(self, device: str) -> I2CBus:
        file = os.path.realpath(device)
        if file not in self._buses:
            self._buses[file] = LinuxI2C(device)
        return self._buses[file]

    def port(self, device: str, baud: int) -> BytePort:
        if device in self._ports:
            self._ports.pop(device).close()
        self._ports[device] = _open_port(device, baud)
        return self._ports[device]


def _open_port(device: str, baud: int) -> OpenPort:
    if device.startswith("rcio:"):
        return PulseFiles(device.removeprefix("rcio:"))
    if not device.startswith("udp:"):
        return LinuxSerial(device, baud)
    _, host, port = device.split(":")
    return UdpPort(host, int(port))
