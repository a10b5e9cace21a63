"""The default tray: every sensor of the aircraft on its bus or line, driven by the simulator's sensor inputs."""

import errno
import os
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Protocol, TypeVar

import numpy as np

from flightpower.hw_fakes import bridge, ms56xx
from flightpower.hw_fakes.ads1115 import FakeADS1115
from flightpower.hw_fakes.ak8963 import FakeAK8963
from flightpower.hw_fakes.autopilot import FakeAutopilot
from flightpower.hw_fakes.esc_counter import FakeEscCounter
from flightpower.hw_fakes.faults import BUS, Fault, FaultKind, FaultyBus, FaultyPort, PartFault, check_fault, part_fault
from flightpower.hw_fakes.i2c import FakeI2CBus, I2CBus, I2CDevice
from flightpower.hw_fakes.ina2xx import INA226, FakePowerMonitor
from flightpower.hw_fakes.mpu9250 import FakeMPU9250
from flightpower.hw_fakes.port import FakePort, SerialDevice
from flightpower.hw_fakes.ublox import DDC_ADDRESS, PORT_DDC, PORT_UART1, FakeUbloxDdc, FakeUbloxM8, FakeUbloxM10
from flightpower.sim.sensor_truth import SensorTruth

I2C_BUS, GPS_PORT, ESC_PORT, AUTOPILOT_PORT = "/dev/i2c-1", "/dev/ttyAMA0", "/dev/ttyUSB0", "/dev/ttyUSB1"
PORTS = {"gps": GPS_PORT, "esc_counter": ESC_PORT, "autopilot": AUTOPILOT_PORT}
ADDRESSES = {
    "imu": 0x68,
    "magnetometer": 0x0C,
    "baro": 0x77,
    "static": 0x76,
    "alpha": 0x36,
    "beta": 0x46,
    "airspeed": 0x28,
}
# Optional parts of a tray, which cannot have scheduled faults.
POWER_MONITOR_ADDRESS, ANALOG_ADDRESS = 0x40, 0x48
ANALOG_DIVIDER = 11.0  # divider of the battery's voltage for input 0 of the converter; other inputs are grounded
Device = TypeVar("Device")
UTC_AT_START = datetime(2016, 5, 14, 9, 30, tzinfo=UTC)


class TrayClock(Protocol):
    """The part of a clock's interface that the tray uses, as in `hw_fakes.clock.SimulatedClock` and
    `daq.clock.SystemClock`.

    If the clock has `advance_ns`, it is called with the duration of each bus transfer.
    """

    def now_ns(self) -> int: ...


@dataclass(frozen=True, kw_only=True)
class TrayVariant:
    """The properties in which trays differ.

    powered_for_s: how long the parts have had power; a Pi takes some 20 s to boot, so the parts have started before the
    daemon reads them. pole_pairs: of the motor. utc_at_start: true UTC at the start, as GPS time gives it. geoid_m:
    height of the geoid above the ellipsoid. rpm_with_crc: whether the pulse counter sends the frames with CRC.
    gps_on_i2c: whether the receiver is on the I2C bus instead of its serial line. gps_m10: whether it is of the
    generation M10. ms5607: whether the barometer in the fuselage is an MS5607.
    """

    powered_for_s: float = 20.0
    pole_pairs: int = 7
    utc_at_start: datetime = UTC_AT_START
    geoid_m: float = 0.0
    rpm_with_crc: bool = False
    gps_on_i2c: bool = False
    gps_m10: bool = False
    ms5607: bool = False


class FakeTray:
    """The sensors of the default tray; satisfies `daq.bus.Buses`.

    sensor_truth: physical inputs of the sensors; its time 0 is now. clock: gives the time. seed: draws the differences
    between parts of one kind (coefficients, trim, clock errors). faults: scheduled faults; raises InputError for a
    fault that the device cannot have.
    """

    def __init__(
        self,
        sensor_truth: SensorTruth,
        clock: TrayClock,
        seed: int = 0,
        *,
        variant: TrayVariant = TrayVariant(),
        faults: Sequence[Fault] = (),
    ):
        start_ns = clock.now_ns()

        def now_ns() -> int:
            return clock.now_ns() - start_ns

        powered_ns = -round(variant.powered_for_s * 1e9)

        def seed_of(name: str) -> int:
            return zlib.crc32(f"{seed} {name}".encode())

        self._now_ns: Callable[[], int] = now_ns
        self.utc_at_start = variant.utc_at_start
        self.imu = FakeMPU9250(sensor_truth, now_ns, seed_of("imu"), powered_ns)
        self.magnetometer = FakeAK8963(sensor_truth, now_ns, seed_of("magnetometer"), powered_ns)

        def barometer(kind: ms56xx.MS56xxType, name: str) -> ms56xx.FakeMS56xx:
            return ms56xx.FakeMS56xx(kind, name, sensor_truth, now_ns, seed=seed_of(name), powered_ns=powered_ns)

        kind = ms56xx.MS5607 if variant.ms5607 else ms56xx.MS5611
        self.baro, self.static = barometer(kind, "baro"), barometer(ms56xx.MS5805, "static")
        self.alpha = bridge.FakeBridge(bridge.MS4515DO_DS5A002DP, "alpha", sensor_truth, now_ns, powered_ns)
        self.beta = bridge.FakeBridge(bridge.MS4515DO_DS5A002DP, "beta", sensor_truth, now_ns, powered_ns)
        self.airspeed = bridge.FakeBridge(bridge.SSCDRRN005ND2A5, "airspeed", sensor_truth, now_ns, powered_ns)
        gps_port = PORT_DDC if variant.gps_on_i2c else PORT_UART1
        generation = FakeUbloxM10 if variant.gps_m10 else FakeUbloxM8
        self.gps = generation(
            sensor_truth, variant.utc_at_start, variant.geoid_m, powered_ns=powered_ns, port_id=gps_port
        )
        self.esc_counter = FakeEscCounter(sensor_truth, variant.pole_pairs, variant.rpm_with_crc)
        self.autopilot = FakeAutopilot(sensor_truth)

        devices: dict[int, I2CDevice] = {
            address: getattr(self, name) for name, address in ADDRESSES.items() if name != "magnetometer"
        }
        self.power_monitor = FakePowerMonitor(INA226, sensor_truth, now_ns, seed_of("power"), powered_ns=powered_ns)

        def analog_V(channel: int, t_s: float) -> float:
            voltage_V, _ = sensor_truth.battery(np.array([t_s]))
            return float(voltage_V[0]) / ANALOG_DIVIDER if channel == 0 else 0.0

        devices[POWER_MONITOR_ADDRESS] = self.power_monitor
        devices[ANALOG_ADDRESS] = FakeADS1115(analog_V, now_ns, seed_of("analog"))
        addresses, ports = dict(ADDRESSES), dict(PORTS)
        if variant.gps_on_i2c:
            del ports["gps"]
            addresses["gps"] = DDC_ADDRESS
            devices[DDC_ADDRESS] = FakeUbloxDdc(self.gps, now_ns)
        spend_ns = getattr(clock, "advance_ns", None)
        self._parts_faults: dict[str, list[PartFault]] = {}
        for number, fault in enumerate(faults):
            check_fault(fault, f"fault {number + 1}")
        # The magnetometer is in the IMU's package, on the same supply.
        shared = [
            replace(f, device="magnetometer") for f in faults if (f.kind, f.device) == (FaultKind.BROWN_OUT, "imu")
        ]
        faults = (*faults, *shared)
        for fault in faults:
            part = part_fault(fault, getattr(self, fault.device, None))
            if part is not None:
                self._parts_faults.setdefault(fault.device, []).append(part)
        self._faults = faults
        self._seed_of = seed_of
        bus: I2CBus = FakeI2CBus(devices, find=self._behind_the_imu, spend_ns=spend_ns)
        if any(fault.device in (*addresses, BUS) for fault in faults):
            by_address: dict[int | None, list[Fault]] = {}
            for fault in faults:
                by_address.setdefault(addresses.get(fault.device), []).append(fault)
            by_address[None] = [fault for fault in by_address.get(None, []) if fault.device == BUS]
            parts = {addresses[name]: these for name, these in self._parts_faults.items() if name in addresses}
            bus = FaultyBus(bus, by_address, parts, now_ns, seed=seed_of("bus"), spend_ns=spend_ns)
        self.buses: dict[str, I2CBus] = {I2C_BUS: bus}
        self.serial_devices: dict[str, SerialDevice] = {device: getattr(self, name) for name, device in ports.items()}

    def i2c(self, device: str) -> I2CBus:
        """The bus with this device name; raises FileNotFoundError as the system would."""
        return _present(self.buses, device)

    def port(self, device: str, baud: int) -> FakePort | FaultyPort:
        """Open the serial line with this device name; raises FileNotFoundError as the system would."""
        part = _present(self.serial_devices, device)
        name = next(name for name, path in PORTS.items() if path == device)
        faults = [fault for fault in self._faults if fault.device == name]
        if any(fault.kind == FaultKind.UNPLUGGED and fault.active(self._now_ns()) for fault in faults):
            raise _missing(device)
        line = FakePort(part, baud, self._now_ns)
        if not faults:
            return line
        return FaultyPort(line, faults, self._parts_faults.get(name, ()), self._now_ns, self._seed_of(name))

    def _behind_the_imu(self, address: int) -> I2CDevice | None:
        return self.magnetometer if address == ADDRESSES["magnetometer"] and self.imu.bypass else None


def _present(devices: dict[str, Device], device: str) -> Device:
    try:
        return devices[device]
    except KeyError:
        raise _missing(device) from None


def _missing(device: str) -> FileNotFoundError:
    return FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), device)
