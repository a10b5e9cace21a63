"""Every driver and every fake part survives arbitrary bytes on its bus or serial line.

A driver may report them (by a status, or by SensorFailure, after which the daemon creates a new driver); it raises
nothing else, returns at once, and measures again within two seconds after the line is sound.
"""

import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from flightpower.daq.sensors import SensorFailure, honeywell, ms45xxdo, ms56xx
from flightpower.daq.sensors.ak8963 import AK8963Driver
from flightpower.daq.sensors.autopilot import AutopilotDriver
from flightpower.daq.sensors.bridge import BridgeTransducerDriver
from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.daq.sensors.mpu9250 import MPU9250Driver
from flightpower.daq.sensors.ublox import UBloxDriver
from flightpower.daq.sensors.ublox_ddc import DdcPort
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import AUTOPILOT_PORT, ESC_PORT, GPS_PORT, I2C_BUS, FakeTray, TrayVariant

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth

TICK_NS = 40_000_000
RECOVERY_TICKS = 50
NEXSTAR = load_aircraft("nexstar")


class Wire:
    """Bus and ports of a tray; while `noise` is not None, replies are cut from it, over and over."""

    def __init__(self, tray):
        self._tray = tray
        self._wire = None
        self.noise: bytes | None = None
        self._position = 0

    def i2c(self, device):
        self._wire = self._tray.i2c(device)
        return self

    def port(self, device, baud):
        self._wire = self._tray.port(device, baud)
        return self

    def _cut(self, count):
        endless = self.noise * (2 + (self._position + count) // len(self.noise))
        self._position += count
        return endless[self._position - count : self._position]

    def write(self, *arguments):
        self._wire.write(*arguments)

    def read(self, address, count):
        return self._wire.read(address, count) if self.noise is None else self._cut(count)

    def write_read(self, address, data, count):
        return self._wire.write_read(address, data, count) if self.noise is None else self._cut(count)

    def read_available(self):
        sound = self._wire.read_available()
        return sound if self.noise is None else sound[: len(sound) // 2] + self._cut(1 + self._position % 50)


def bridge(decode_part, number):
    address, transfer = decode_part(number)
    return lambda wire: BridgeTransducerDriver(wire.i2c(I2C_BUS), address, transfer, topic="/probe/alpha")


def barometer(variant, address):
    return lambda wire: ms56xx.MS56xxDriver(wire.i2c(I2C_BUS), address, variant, topic="/baro", period_s=0.04)


def magnetometer(wire):
    bus = wire.i2c(I2C_BUS)
    bus.write(0x68, b"\x37\x02")  # the bypass, which the driver of the IMU opens
    return AK8963Driver(bus)


MAKERS = {
    "imu": lambda wire: MPU9250Driver(wire.i2c(I2C_BUS)),
    "imu, single reads": lambda wire: MPU9250Driver(wire.i2c(I2C_BUS), fifo=False),
    "magnetometer": magnetometer,
    "ms5611": barometer(ms56xx.MS5611, 0x77),
    "ms5805": barometer(ms56xx.MS5805, 0x76),
    "ms4515do": bridge(ms45xxdo.decode_part, "MS4515DO-DS5AJ002DP"),
    "ssc": bridge(honeywell.decode_part, "SSCDRRN005ND2A5"),
    "ublox": lambda wire: UBloxDriver(wire.port(GPS_PORT, 38400), reopen=lambda baud: wire.port(GPS_PORT, baud)),
    "ublox on i2c": lambda wire: UBloxDriver(DdcPort(wire.i2c(I2C_BUS)), baud=None),
    "counter": lambda wire: EscCounterDriver(wire.port(ESC_PORT, 115200), pole_pairs=7),
    "framed counter": lambda wire: EscCounterDriver(wire.port(ESC_PORT, 115200), pole_pairs=7, framed=True),
    "autopilot": lambda wire: AutopilotDriver(wire.port(AUTOPILOT_PORT, 57600), aircraft=NEXSTAR, rate_Hz=25, rpm=True),
}


class Place:
    """Does with a driver what the daemon does: makes a new driver when it fails."""

    def __init__(self, make, wire, clock):
        self._make, self._wire, self._clock = make, wire, clock
        self._driver = None

    def tick(self):
        self._clock.advance_ns(TICK_NS - self._clock.now_ns() % TICK_NS)
        try:
            if self._driver is None:
                driver = self._make(self._wire)
                for wait_s in driver.start():
                    self._clock.advance_ns(round(wait_s * 1e9))
                self._driver = driver
            return [sample.message.status for sample in self._driver.read(self._clock.now_ns())]
        except SensorFailure as failure:
            self._driver = None
            return [failure.status]

    def measures_within(self, ticks):
        return any(Status.OK in self.tick() for _ in range(ticks))


@pytest.mark.parametrize("name", MAKERS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(noise=st.binary(min_size=1, max_size=700), ticks=st.integers(1, 12))
def test_any_bytes_and_then_sound_ones(name, noise, ticks):
    clock = SimulatedClock(start_ns=5_000_000_000)
    options = TrayVariant(rpm_with_crc=name == "framed counter", gps_on_i2c=name == "ublox on i2c")
    wire = Wire(FakeTray(AnalyticSensorTruth(), clock, 1, variant=options))
    place = Place(MAKERS[name], wire, clock)
    assert place.measures_within(2 * RECOVERY_TICKS)
    wire.noise = noise
    statuses = [status for _ in range(ticks) for status in place.tick()]
    assert all(status in Status for status in statuses)
    wire.noise = None
    assert place.measures_within(RECOVERY_TICKS)


@pytest.mark.parametrize("name", MAKERS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(noise=st.binary(min_size=1, max_size=700))
@example(noise=b"\xb5\x62")  # half of a receiver's frame, which a whole one follows
def test_any_bytes_while_it_is_brought_up(name, noise):
    clock = SimulatedClock(start_ns=5_000_000_000)
    options = TrayVariant(rpm_with_crc=name == "framed counter", gps_on_i2c=name == "ublox on i2c")
    wire = Wire(FakeTray(AnalyticSensorTruth(), clock, 1, variant=options))
    wire.noise = noise
    place = Place(MAKERS[name], wire, clock)
    assert all(status in Status for _ in range(5) for status in place.tick())
    wire.noise = None
    assert place.measures_within(2 * RECOVERY_TICKS)


TRANSFERS = st.lists(
    st.tuples(
        st.sampled_from([0x68, 0x0C, 0x77, 0x76, 0x36, 0x46, 0x28, 0x42]),
        st.binary(max_size=40),
        st.integers(0, 40),
        st.integers(0, 50_000_000),
    ),
    max_size=40,
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(TRANSFERS)
def test_a_fake_part_answers_any_transfer_or_does_not_acknowledge(transfers):
    clock = SimulatedClock(start_ns=5_000_000_000)
    bus = FakeTray(AnalyticSensorTruth(), clock, 1, variant=TrayVariant(gps_on_i2c=True)).i2c(I2C_BUS)
    for address, data, count, wait_ns in transfers:
        clock.advance_ns(wait_ns)
        try:
            if data and count:
                assert len(bus.write_read(address, data, count)) == count
            elif count:
                assert len(bus.read(address, count)) == count
            else:
                bus.write(address, data)
        except OSError as error:
            assert error.errno == 121


@pytest.mark.parametrize(("device", "baud"), [(GPS_PORT, 38400), (ESC_PORT, 115200), (AUTOPILOT_PORT, 57600)])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(noise=st.lists(st.binary(max_size=100), max_size=8))
def test_a_fake_part_on_a_line_hears_a_command_after_any_bytes(device, baud, noise):
    clock = SimulatedClock(start_ns=5_000_000_000)
    tray = FakeTray(AnalyticSensorTruth(), clock, 1)
    port = tray.port(device, baud)
    for piece in noise:
        port.write(piece)
        clock.advance_ns(10_000_000)
        port.read_available()
    if device != GPS_PORT:
        return
    rate_10_Hz = bytes.fromhex("b562060806006400010001007a12")
    for _ in range(1100 // len(rate_10_Hz)):  # noise may have begun a frame of up to a kilobyte
        port.write(rate_10_Hz)
    clock.advance_ns(1_000_000_000)
    assert b"\xb5\x62\x05\x01\x02\x00\x06\x08" in port.read_available()
