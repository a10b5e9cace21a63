"""This machine's buses and lines: a device file and a pseudo-terminal."""

import errno
import os
import pty
import socket
import tty
from pathlib import Path

import pytest

from flightpower.daq import linux_bus
from flightpower.daq.linux_bus import LinuxBuses, LinuxI2C
from flightpower.daq.sensor_supervisor import status_of
from flightpower.flight.messages import Status
from flightpower.hw_fakes import fuse_i2c
from flightpower.hw_fakes.fuse_i2c import UNAVAILABLE, FuseI2C

OPEN_FILES = Path("/proc/self/fd")


class Counter:
    """A part that answers with the number of requests so far, and from the fifth request on not at all."""

    requests = 0

    def read(self, address, count):
        self.requests += 1
        if self.requests == 5:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        return bytes([self.requests] * count)

    def write_read(self, address, data, count):
        return data + self.read(address, count - len(data))

    def write(self, address, data):
        self.read(address, 1)


@pytest.fixture
def bus(tmp_path):
    try:
        served = FuseI2C(Counter(), tmp_path / "i2c-1")
    except OSError as error:
        if error.errno not in UNAVAILABLE:
            raise
        pytest.skip(f"no FUSE here: {error}")
    with served:
        opened = LinuxI2C(str(served.path))
        yield opened
        opened.close()


def test_the_same_transfer_again_gives_the_new_answer(bus):
    assert [bus.read(0x28, 2), bus.read(0x28, 2)] == [b"\x01\x01", b"\x02\x02"]
    assert bus.write_read(0x68, b"\x75", 2) == b"\x75\x03"
    bus.write(0x68, b"\x6b\x00")
    with pytest.raises(OSError, match="Remote I/O") as caught:
        bus.read(0x28, 2)
    assert caught.value.errno == errno.EREMOTEIO
    assert bus.read(0x28, 2) == b"\x06\x06"


def test_a_transfer_that_was_cut_short_is_an_error_and_not_the_last_reading(bus, monkeypatch):
    """i2c-dev returns how many messages were transferred: an adapter may do only the first of two."""
    bus.write_read(0x68, b"\x75", 2)
    monkeypatch.setattr(fuse_i2c.FuseI2C, "_transfer", lambda self, argument, pid: 1)
    with pytest.raises(OSError) as caught:
        bus.write_read(0x68, b"\x75", 2)
    assert caught.value.errno == errno.EIO


def test_a_file_that_is_no_bus_is_closed_again(tmp_path):
    """The supervisor tries again twice a second: if each try left a file open, the daemon would end within minutes."""
    before = len(list(OPEN_FILES.iterdir()))
    (tmp_path / "i2c-1").touch()
    with pytest.raises(OSError) as caught:
        LinuxI2C(str(tmp_path / "i2c-1"))
    assert caught.value.errno == errno.ENOTTY
    assert len(list(OPEN_FILES.iterdir())) == before


def test_a_line_that_somebody_else_has_open_is_said_to_be():
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    name = os.ttyname(theirs)
    first = LinuxBuses()
    first.port(name, 115200)
    with pytest.raises(OSError, match="another program has it open") as caught:
        LinuxBuses().port(name, 115200)
    assert caught.value.filename == name and status_of(caught.value) is Status.NO_REPLY
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize(("timeout_ms", "units"), [(10, 1), (20, 2), (25, 3)])
def test_the_kernel_s_timeout_is_in_units_of_ten_milliseconds_rounded_up(tmp_path, monkeypatch, timeout_ms, units):
    requests = []
    monkeypatch.setattr(linux_bus.fcntl, "ioctl", lambda file, request, value: requests.append((request, value)))
    monkeypatch.setattr("smbus2.smbus2.ioctl", lambda file, request, value: 0)  # asks what the bus can do
    device = tmp_path / "i2c-1"
    device.touch()
    LinuxI2C(str(device), timeout_ms).close()
    assert requests == [(linux_bus.I2C_TIMEOUT, units), (linux_bus.I2C_RETRIES, 0)]


@pytest.mark.parametrize("size", [1, 40, 1400, 65_000])
def test_a_flood_of_datagrams_ends_at_each_read_and_costs_nothing_that_was_before_it(size):
    """One thread reads all ports, so an endless read would also lose the readings of the others."""
    port = linux_bus.UdpPort("127.0.0.1", 0)

    class Flood:
        taken = 0

        def recvfrom(self, most):
            self.taken += 1
            assert self.taken <= linux_bus.DATAGRAMS
            return bytes([self.taken % 251]) * size, ("127.0.0.1", 9)

    port._socket.close()
    port._socket = flood = Flood()
    received = port.read_available()
    assert len(received) == flood.taken * size < linux_bus.DATAGRAM_BYTES + 65_536
    assert received[::size] == bytes(number % 251 for number in range(1, flood.taken + 1))


def test_all_datagrams_that_have_arrived_are_read_in_order():
    port = linux_bus.UdpPort("127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for number in range(20):
            sender.sendto(bytes([number] * 300), port._socket.getsockname())
        received = b""
        while len(received) < 20 * 300:
            received += port.read_available()
        assert received == b"".join(bytes([number] * 300) for number in range(20))
        port.write(b"reply")
        assert sender.recv(16) == b"reply"
    assert port.read_available() == b""
    port.close()
