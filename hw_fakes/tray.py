"""The default tray: every sensor of the aircraft on its bus or line, driven by what the simulator says it feels."""

import errno
import os
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Protocol

from hw_fakes import bridge, ms56xx
from hw_fakes.ak8963 import AK8963
from hw_fakes.autopilot import Autopilot
from hw_fakes.esc_counter import EscCounter
from hw_fakes.i2c import FakeI2CBus, I2CDevice
from hw_fakes.mpu9250 import MPU9250
from hw_fakes.port import FakePort, SerialDevice
from hw_fakes.ublox import UbloxM8
from sim.felt import Felt

I2C_BUS, GPS_PORT, ESC_PORT, AUTOPILOT_PORT = "/dev/i2c-1", "/dev/ttyAMA0", "/dev/ttyUSB0", "/dev/ttyUSB1"
IMU, MAGNETOMETER, BARO, STATIC, ALPHA, BETA, AIRSPEED = 0x68, 0x0C, 0x77, 0x76, 0x36, 0x46, 0x28
FIRST_FLIGHT = datetime(2016, 5, 14, 9, 30, tzinfo=UTC)


class Clock(Protocol):
    """What the tray needs of a clock; `hw_fakes.clock.SimulatedClock` and `daq.clock.SystemClock` have it.

    A clock with `advance_ns` is told how long each transfer on the bus takes.
    """

    def now_ns(self) -> int: ...


class FakeTray:
    """The sensors of the default tray; satisfies `daq.bus.Buses`.

    felt: what the sensors feel; its time begins now. clock: whose time it is. powered_for_s: how long the parts have
    had power; a Pi takes some 20 s to boot, so a daemon meets them long awake.
    seed: draws what differs between two parts of a kind (coefficients, trim, clock errors). pole_pairs: of the motor.
    utc_at_start: true time now, as the satellites know it. geoid_m: height of the geoid above the ellipsoid.
    rpm_with_crc: the pulse counter speaks the framed variant.
    """

    def __init__(
        self,
        felt: Felt,
        clock: Clock,
        seed: int = 0,
        *,
        powered_for_s: float = 20.0,
        pole_pairs: int = 7,
        utc_at_start: datetime = FIRST_FLIGHT,
        geoid_m: float = 0.0,
        rpm_with_crc: bool = False,
    ):
        start_ns = clock.now_ns()

        def now_ns() -> int:
            return clock.now_ns() - start_ns

        powered_ns = -round(powered_for_s * 1e9)

        def seed_of(name: str) -> int:
            return zlib.crc32(f"{seed} {name}".encode())

        self._now_ns: Callable[[], int] = now_ns
        self.imu = MPU9250(felt, now_ns, seed_of("imu"), powered_ns)
        self.magnetometer = AK8963(felt, now_ns, seed_of("magnetometer"), powered_ns)
        self.baro = ms56xx.MS56xx(ms56xx.MS5611, "baro", felt, now_ns, seed_of("baro"), powered_ns)
        self.static = ms56xx.MS56xx(ms56xx.MS5805, "static", felt, now_ns, seed_of("static"), powered_ns)
        self.alpha = bridge.Bridge(bridge.MS4515DO_DS5A002DP, "alpha", felt, now_ns, powered_ns)
        self.beta = bridge.Bridge(bridge.MS4515DO_DS5A002DP, "beta", felt, now_ns, powered_ns)
        self.airspeed = bridge.Bridge(bridge.SSCDRRN005ND2A5, "airspeed", felt, now_ns, powered_ns)
        self.gps = UbloxM8(felt, utc_at_start, geoid_m, powered_ns=powered_ns)
        self.esc_counter = EscCounter(felt, pole_pairs, rpm_with_crc)
        self.autopilot = Autopilot(felt)

        devices: dict[int, I2CDevice] = {
            IMU: self.imu,
            BARO: self.baro,
            STATIC: self.static,
            ALPHA: self.alpha,
            BETA: self.beta,
            AIRSPEED: self.airspeed,
        }
        self.buses = {
            I2C_BUS: FakeI2CBus(devices, find=self._behind_the_imu, spend_ns=getattr(clock, "advance_ns", None))
        }
        self.serial_devices: dict[str, SerialDevice] = {
            GPS_PORT: self.gps,
            ESC_PORT: self.esc_counter,
            AUTOPILOT_PORT: self.autopilot,
        }

    def i2c(self, device: str) -> FakeI2CBus:
        """The bus of that device name; raises FileNotFoundError as the system would."""
        return _present(self.buses, device)

    def port(self, device: str, baud: int) -> FakePort:
        """The serial line of that device name, opened now; raises FileNotFoundError as the system would."""
        return FakePort(_present(self.serial_devices, device), baud, self._now_ns)

    def _behind_the_imu(self, address: int) -> I2CDevice | None:
        return self.magnetometer if address == MAGNETOMETER and self.imu.bypass else None


def _present(devices: dict, device: str):
    try:
        return devices[device]
    except KeyError:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), device) from None
