"""The second sources: a receiver over I2C, stick positions from files, datagrams as a stream."""

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripted_parts import ScriptedPort, bring_up
from test_driver_ublox import PVT

from flightpower.daq.linux_bus import LinuxBuses
from flightpower.daq.sensors.navio2 import Navio2Driver, message
from flightpower.daq.sensors.ublox import UBloxDriver, configuration
from flightpower.daq.sensors.ublox_ddc import DdcPort
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import Status


class Ddc:
    """A receiver's I2C side: 0xFD gives the count, 0xFF the stream, which is 0xFF when it is empty."""

    def __init__(self, stream: bytes, idle: int = 0):
        self.stream, self.idle, self.written = stream, idle, []

    def write(self, address, data):
        self.written.append(data)

    def read(self, address, count):
        raise AssertionError("registers are addressed")

    def write_read(self, address, data, count):
        assert address == 0x42
        if data == b"\xfd":
            return len(self.stream).to_bytes(2, "big") if self.stream else self.idle.to_bytes(2, "big")
        assert data == b"\xff"
        taken, self.stream = self.stream[:count], self.stream[count:]
        return taken.ljust(count, b"\xff")


@pytest.mark.parametrize("idle", [0, 0xFFFF])
def test_solutions_over_i2c_come_in_bounded_bites(idle):
    bus = Ddc(PVT + b"\xff" * 300 + PVT, idle)
    sensor = UBloxDriver(DdcPort(bus), rate_Hz=5, baud=None)
    bring_up(sensor)
    results = [len(sensor.read(tick * 40_000_000)) for tick in range(5)]
    assert sum(results) == 2 and bus.written == [configuration(5, None)[0]]


def test_stick_positions_from_files(tmp_path):
    for channel, pulse in enumerate([1500, 1750, 1400, 1500, 1000, 1000, 1000, 1000, 0, 0, 0]):
        (tmp_path / f"ch{channel}").write_text(f"{pulse}\n")
    port = LinuxBuses().port(f"rcio:{tmp_path}", 0)
    sensor = Navio2Driver(port, aircraft=load_aircraft("nexstar"))
    ((topic, _, first, *_),) = sensor.read(0)
    assert topic == "/controls" and first.pulse_us[:4] == [1500, 1750, 1400, 1500]  # ch10 stands after ch9, not ch1
    assert first.elevator_rad == pytest.approx(0.1885, abs=1e-4)  # 10.8 deg
    (tmp_path / "ch1").write_text("1500\n")
    assert sensor.read(1)[0].message.elevator_rad == pytest.approx(0)


def test_no_such_files_is_an_error_of_the_device(tmp_path):
    with pytest.raises(FileNotFoundError):
        LinuxBuses().port(f"rcio:{tmp_path}", 0)


@pytest.mark.parametrize(
    ("line", "status"),
    [(b"0 0 0", Status.NO_DATA), (b"", Status.NO_DATA), (b"1500 x", Status.CORRUPT), (b"1500 40", Status.CORRUPT)],
)
def test_what_is_no_line_of_pulse_widths(line, status):
    assert message(line, None).status is status


@given(st.binary(max_size=60))
def test_any_line_has_a_meaning(line):
    port = ScriptedPort()
    port.incoming = [line]
    assert Navio2Driver(port, aircraft=load_aircraft("nexstar")).read(0)[0].message.status in Status


def test_datagrams_are_a_stream_and_the_speaker_is_answered():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(60)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            number = probe.getsockname()[1]
        buses = LinuxBuses()
        port = buses.port(f"udp:127.0.0.1:{number}", 0)
        assert port.read_available() == b""
        port.write(b"nobody has spoken yet")
        peer.sendto(b"one", ("127.0.0.1", number))
        peer.sendto(b"two", ("127.0.0.1", number))
        assert port.read_available() == b"onetwo"
        port.write(b"answer")
        assert peer.recv(100) == b"answer"
        again = buses.port(f"udp:127.0.0.1:{number}", 0)  # opened again: the old one gives up its port
        peer.sendto(b"three", ("127.0.0.1", number))
        assert again.read_available() == b"three"
