"""The driver on a fake part, by the test kit of `hw_fakes`, and on a real one where SDP3X_BUS names its bus.

SDP3X_BUS=/dev/i2c-1 pytest test_sdp3x.py
"""

import os
import time
from pathlib import Path

import pytest
from flightpower_sdp3x import MEASURE_AND_AVERAGE, Sdp3xDriver, crc8

from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.linux_bus import LinuxI2C
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.i2c import FakeI2CBus, no_acknowledge

TRAY = '[[sensors]]\ndriver = "sdp3x"\nbus = "/dev/i2c-1"\n'
TOPIC = "/probe/airspeed"


class FakeSdp3x:
    """The part at the level of its bytes: a constant pressure [Pa]. damaged: its checksums are wrong."""

    def __init__(self, pressure_Pa: float, counts_per_Pa: int = 20):
        self._numbers = round(pressure_Pa * counts_per_Pa), 25 * 200, counts_per_Pa
        self.measuring = self.damaged = False

    def write(self, data: bytes) -> None:
        self.measuring = data == MEASURE_AND_AVERAGE

    def read(self, count: int) -> bytes:
        if not self.measuring:
            raise no_acknowledge()
        words = [number.to_bytes(2, "big", signed=True) for number in self._numbers]
        return b"".join(word + bytes([crc8(word) ^ self.damaged]) for word in words)[:count]

    def write_read(self, data: bytes, count: int) -> bytes:
        raise no_acknowledge()


class Buses:
    """One bus with one part."""

    def __init__(self, part: FakeSdp3x):
        self.bus = FakeI2CBus({0x21: part})

    def i2c(self, device: str) -> FakeI2CBus:
        return self.bus

    def port(self, device: str, baud: int) -> None:
        raise FileNotFoundError(device)


def test_the_checksum_is_that_of_the_datasheet() -> None:
    assert crc8(b"\xbe\xef") == 0x92


def test_the_daemon_records_the_pressure(tmp_path: Path) -> None:
    clock, part = SimulatedClock(), FakeSdp3x(-312.5)
    tray = parse_tray(TRAY, "tray.toml", tmp_path)
    result = record(tray, buses=Buses(part), clock=clock, until_ns=2 * 10**9)
    entries = [entry.message for entry in read_log(result.path).entries[TOPIC]]
    good = [message for message in entries if message.status is Status.OK]
    assert len(good) > 45
    assert {message.differential_pressure_Pa for message in good} == {-312.5}
    assert tray.sensors[0].identify(Buses(part)) == "SDP33"


def test_a_damaged_reply_is_no_measurement(tmp_path: Path) -> None:
    clock, part = SimulatedClock(), FakeSdp3x(100.0)
    part.damaged = True
    result = record(parse_tray(TRAY, "tray.toml", tmp_path), buses=Buses(part), clock=clock, until_ns=2 * 10**9)
    statuses = {entry.message.status for entry in read_log(result.path).entries[TOPIC]}
    assert Status.CORRUPT in statuses and Status.OK not in statuses


@pytest.mark.skipif("SDP3X_BUS" not in os.environ, reason="SDP3X_BUS names no bus with a real part")
def test_a_real_part_at_rest_reads_little_pressure() -> None:
    """With both ports open to the same air: less than 5 Pa, and the temperature of a room or of a field."""
    bus = LinuxI2C(os.environ["SDP3X_BUS"])
    try:
        driver = Sdp3xDriver(bus, 0x21, TOPIC)
        for wait_s in driver.start():
            time.sleep(wait_s)
        (sample,) = driver.read(0)
    finally:
        bus.close()
    assert sample.message.status is Status.OK
    assert abs(sample.message.differential_pressure_Pa) < 5
    assert 250 < sample.message.temperature_K < 330
