"""Opens I2C buses, serial lines and UDP ports on Linux, with the interfaces of `daq.bus`.

No other module imports smbus2 and pyserial. Devices are locked with flock(2) while they are open, because two readers
of a bus spoil each other's readings; opening a locked one raises 16 (EBUSY).
"""

import errno
import fcntl
import os
import socket
import termios
from ctypes import string_at
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from smbus2 import SMBus, i2c_msg
from smbus2.smbus2 import I2C_RDWR, i2c_rdwr_ioctl_data

from flightpower.daq.bus import IN_USE, BytePort, I2CBus

RECEIVE_BYTES = 4096  # the kernel's buffer of a serial line (N_TTY_BUF_SIZE)
# Most bytes of one read of a UDP port: ten times what an autopilot sends in a tick. A flood harms only its own port.
DATAGRAM_BYTES, DATAGRAMS = 65_536, 256
I2C_RETRIES = 0x0701  # linux/i2c-dev.h
I2C_TIMEOUT = 0x0702  # in units of 10 ms
PREPARED_TRANSFERS = 128  # most kept; the default tray needs about thirty, and one for each length of FIFO read


class Transfer(NamedTuple):
    """The smbus2 structures of a write, a read, or both joined by a repeated start."""

    request: i2c_rdwr_ioctl_data  # the argument of ioctl(I2C_RDWR)
    messages: int  # number of messages
    reply: Any  # pointer to where the kernel writes what it reads
    message_structures: list[i2c_msg]  # kept alive, since the kernel finds them by address


class LinuxI2C:
    """/dev/i2c-N through smbus2, with a timeout for each transfer (rounded up to 10 ms). Use it from one thread at a
    time.

    smbus2 has no timeout, no lock, and no check of how many messages were transferred; this class adds them. The same
    transfers are repeated every tick. smbus2 would make their structures each time, which takes longer than the
    transfer, so prepared ones are kept.
    """

    def __init__(self, device: str, timeout_ms: int = 20):
        self._prepared = lru_cache(PREPARED_TRANSFERS)(_prepare)
        self._bus = SMBus()
        try:
            self._bus.open(device)
            assert self._bus.fd is not None
            self._file = self._bus.fd
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.ioctl(self._file, I2C_TIMEOUT, -(-timeout_ms // 10))
            fcntl.ioctl(self._file, I2C_RETRIES, 0)
        except BlockingIOError:
            self.close()
            raise _in_use(device) from None
        except OSError:  # for instance, a file that is no bus; smbus2 leaves it open
            self.close()
            raise

    def write(self, address: int, data: bytes) -> None:
        self._transfer(address, data, 0)

    def read(self, address: int, count: int) -> bytes:
        return self._transfer(address, b"", count)

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._transfer(address, data, count)

    def close(self) -> None:
        self._bus.close()

    def _transfer(self, address: int, data: bytes, count: int) -> bytes:
        """The bytes read. Raises OSError if the transfer is incomplete: the buffer then still holds an old reading."""
        request, messages, reply, _ = self._prepared(address, data, count)
        if fcntl.ioctl(self._file, I2C_RDWR, request) != messages:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return string_at(reply, count)


def _prepare(address: int, data: bytes, count: int) -> Transfer:
    messages = [i2c_msg.write(address, data)] if data else []
    if count:
        messages.append(i2c_msg.read(address, count))
    request = i2c_rdwr_ioctl_data.create(*messages)  # type: ignore[arg-type]  # its stub asks for sequences
    return Transfer(request, len(messages), messages[-1].buf, messages)


class LinuxSerial:
    """A serial line opened by pyserial, in raw mode, non-blocking.

    Reading bypasses pyserial, which first asks whether there is something to read. With VMIN = 1 the kernel's answer
    distinguishes an empty line (EAGAIN) from an unplugged adapter (end of file).
    """

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
        self._device, self._file = device, self._port.fileno()
        settings = termios.tcgetattr(self._file)
        settings[6][termios.VMIN] = 1
        termios.tcsetattr(self._file, termios.TCSANOW, settings)

    def read_available(self) -> bytes:
        # Read without first asking for the number of bytes: asking needs a lock that the kernel holds while it fills
        # the buffer, and has taken up to 200 ms.
        try:
            data = os.read(self._file, RECEIVE_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise OSError(error.errno, error.strerror, self._device) from None
        if not data:
            raise OSError(errno.EIO, "the adapter was unplugged", self._device)
        return data

    def write(self, data: bytes) -> None:
        import serial

        try:
            self._port.write(data)
        except serial.SerialTimeoutException:
            raise OSError(errno.ETIMEDOUT, f"{self._port.port}: write timed out") from None
        except serial.SerialException as error:  # raised by pyserial for an unplugged adapter
            raise OSError(errno.EIO, f"{self._port.port}: {error}") from None

    def close(self) -> None:
        self._port.close()


def _in_use(device: str) -> OSError:
    return OSError(errno.EBUSY, IN_USE, device)


class UdpPort:
    """UDP datagrams as a byte stream: receives on `udp:HOST:PORT`, and sends to the sender of the latest datagram."""

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
        received: list[bytes] = []
        count = 0
        while count < DATAGRAM_BYTES and len(received) < DATAGRAMS:
            try:
                data, self._peer = self._socket.recvfrom(DATAGRAM_BYTES)
            except BlockingIOError:
                break
            received.append(data)
            count += len(data)
        return b"".join(received)

    def write(self, data: bytes) -> None:
        if self._peer is not None:
            self._socket.sendto(data, self._peer)

    def close(self) -> None:
        self._socket.close()


class PulseFiles:
    """The port `rcio:DIRECTORY`: text files ch0, ch1, … with one pulse width [us] each, read as one line; read-only."""

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

    A bus is opened only once, even under several names, and its drivers share it. A port is closed and reopened on each
    call, so that an adapter works again after it was unplugged.
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
