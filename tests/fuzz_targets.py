"""Every parser of bytes from outside, as a function of the bytes. Errors that it may raise are caught; any other is a
defect.

`benchmarks/fuzz.py` gives them millions of inputs; `tests/chain/test_fuzz_corpus.py` gives them those that once found a
defect.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

from flightpower.analysis.air.magnetometer import MAGNETOMETER_FILE
from flightpower.analysis.air.probe import PROBE_FILE
from flightpower.analysis.air.transducers import TRANSDUCERS_FILE
from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources import ardupilot, px4
from flightpower.daq.config import parse_tray
from flightpower.daq.log_list import listed
from flightpower.daq.log_recovery import recovery_event
from flightpower.daq.log_summary import summarize
from flightpower.daq.sensors import SensorFailure, honeywell, ms45xxdo, ms56xx
from flightpower.daq.sensors.ads1115 import ADS1115Driver
from flightpower.daq.sensors.ak8963 import AK8963Driver
from flightpower.daq.sensors.autopilot import AutopilotDriver
from flightpower.daq.sensors.bridge import BridgeTransducerDriver
from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.daq.sensors.ina2xx import INA226, INA228, PowerMonitorDriver
from flightpower.daq.sensors.mpu9250 import MPU9250Driver
from flightpower.daq.sensors.ublox import UBloxDriver
from flightpower.daq.sensors.ublox_ddc import DdcPort
from flightpower.daq.still_air_zero import parse_zero
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import parse_propeller
from flightpower.sim.plan import parse_plan

FOLDER = Path("/dev/shm") if Path("/dev/shm").is_dir() else None
TICKS = 6
TICK_NS = 40_000_000
NEXSTAR = load_aircraft("nexstar")
Target = Callable[[bytes], None]


class Wire:
    """A bus and a port whose replies are cut from the input, over and over."""

    def __init__(self, data: bytes):
        self._data, self._position = data or b"\0", 0

    def _cut(self, count: int) -> bytes:
        piece = b"".join(self._data[(self._position + i) % len(self._data)].to_bytes() for i in range(count))
        self._position += count
        return piece

    def write(self, *arguments: object) -> None: ...

    def read(self, address: int, count: int) -> bytes:
        return self._cut(count)

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._cut(count)

    def read_available(self) -> bytes:
        return self._cut(max(1, len(self._data) // TICKS))


def driver(make: Callable[[Wire], object]) -> Target:
    """A driver that is started and read for some ticks; after a SensorFailure it is made again."""

    def target(data: bytes) -> None:
        wire = Wire(data)
        sensor = None
        for tick in range(TICKS):
            try:
                if sensor is None:
                    sensor = make(wire)
                    for _ in sensor.start():  # type: ignore[attr-defined]
                        pass
                for sample in sensor.read((tick + 1) * TICK_NS):  # type: ignore[attr-defined]
                    assert sample.message.status
            except (SensorFailure, OSError):
                sensor = None

    return target


def text(parse: Callable[[str], object]) -> Target:
    """A parser of a text file, which may raise InputError only."""

    def target(data: bytes) -> None:
        try:
            parse(data.decode("utf-8", "replace"))
        except InputError:
            pass

    return target


def file(suffix: str, *readers: Callable[[Path], object]) -> Target:
    """Readers of a binary file, which may raise InputError only."""

    def target(data: bytes) -> None:
        with tempfile.TemporaryDirectory(dir=FOLDER) as folder:
            path = Path(folder) / f"log-0001{suffix}"
            for reader in readers:
                path.write_bytes(data)
                try:
                    reader(path)
                except InputError:
                    pass

    return target


def electrical(path: Path) -> None:
    """The whole analysis of an autopilot's log, on as few windows as it needs."""
    read = px4.read_px4 if path.suffix == ".ulg" else ardupilot.read_ardupilot
    estimate(flight_table(read(path), 20.0, 0.45), 20.0, 0.45, 1.9, most_windows=20, most_points=24)


def binary(parse: Callable[[bytes, str], object]) -> Target:
    def target(data: bytes) -> None:
        try:
            parse(data, "file")
        except InputError:
            pass

    return target


TARGETS: dict[str, Target] = {
    "ublox": driver(lambda wire: UBloxDriver(wire, rate_Hz=10, baud=None)),
    "ublox-ddc": driver(lambda wire: UBloxDriver(DdcPort(wire, 0x42), rate_Hz=5, baud=None)),
    "counter": driver(lambda wire: EscCounterDriver(wire, pole_pairs=7, framed=False)),
    "counter-framed": driver(lambda wire: EscCounterDriver(wire, pole_pairs=7, framed=True)),
    "autopilot": driver(lambda wire: AutopilotDriver(wire, aircraft=NEXSTAR, rate_Hz=25, rpm=True)),
    "mpu9250": driver(lambda wire: MPU9250Driver(wire)),
    "ak8963": driver(lambda wire: AK8963Driver(wire)),
    "ms5611": driver(lambda wire: ms56xx.MS56xxDriver(wire, 0x77, ms56xx.MS5611, topic="/baro", period_s=0.04)),
    "ms4515": driver(
        lambda wire: BridgeTransducerDriver(
            wire, 0x36, ms45xxdo.decode_part("MS4515DO-DS3AJ002DP")[1], topic="/probe/alpha"
        )
    ),
    "honeywell": driver(
        lambda wire: BridgeTransducerDriver(
            wire, 0x28, honeywell.decode_part("SSCDRRN005ND2A3")[1], topic="/probe/airspeed"
        )
    ),
    "ina226": driver(lambda wire: PowerMonitorDriver(wire, 0x40, INA226, shunt_ohm=0.001, period_s=0.04)),
    "ina228": driver(lambda wire: PowerMonitorDriver(wire, 0x40, INA228, shunt_ohm=0.001, period_s=0.04)),
    "ads1115": driver(lambda wire: ADS1115Driver(wire, 0x48, inputs=(0, 1, 2, 3), full_scale_V=4.096, period_s=0.04)),
    "tray": text(lambda content: parse_tray(content, "tray.toml", Path())),
    "aircraft": text(lambda content: parse_aircraft(content, "aircraft.toml")),
    "propeller": text(lambda content: parse_propeller(content, "propeller.csv")),
    "zero": text(lambda content: parse_zero(content, "zero.json")),
    "plan": text(lambda content: parse_plan(content, "plan")),
    "probe": binary(PROBE_FILE.parsed),
    "magnetometer": binary(MAGNETOMETER_FILE.parsed),
    "transducers": binary(TRANSDUCERS_FILE.parsed),
    "log": file(".mcap", summarize, listed, recovery_event, summarize),
    "ulog": file(".ulg", px4.read_px4),
    "dataflash": file(".bin", ardupilot.read_ardupilot),
    "dataflash-text": file(".log", ardupilot.read_ardupilot),
    "telemetry": file(".tlog", ardupilot.read_ardupilot),
    "electrical": file(".bin", electrical),
    "electrical-ulog": file(".ulg", electrical),
}
