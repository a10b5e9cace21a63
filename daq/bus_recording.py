"""Every transaction of the buses in a file, so that a part on the bench becomes a test (see `hw_fakes.replay`).

JSON lines. The first holds tray and aircraft file; each of the others belongs to one sensor and says what was done,
when (monotonic [ns]), and what came of it. Bytes are hexadecimal.

    {"t_ns": 51, "sensor": "imu", "do": "make"}                          a driver is made and brought up
    {"t_ns": 52, "sensor": "imu", "do": "open", "device": "/dev/i2c-1"}  ports also say their "baud"
    {"t_ns": 60, "sensor": "imu", "do": "write", "address": 104, "sent": "6b80"}
    {"t_ns": 70, "sensor": "imu", "do": "turn", "now_ns": 69}            the driver is read; now_ns is what it was told
    {"t_ns": 71, "sensor": "imu", "do": "write_read", "address": 104, "sent": "6a", "count": 10, "received": "40…"}
    {"t_ns": 99, "sensor": "rpm", "do": "read", "received": "78002a", …} ports: no address, no count
    …, "errno": 121, "error": "Remote I/O error"}                        instead of "received", when it failed

Lines are made by the thread that reads the sensor, a few microseconds each, and written by another one.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from daq.bus import Buses, BytePort, I2CBus
from daq.clock import Clock
from daq.disk import DiskWriter
from daq.sensors import Sample, Sensor
from flight.aircraft import Aircraft
from flight.errors import InputError

T = TypeVar("T")
FORMAT = "flightpower-bus-recording-1"


class BusRecording:
    """A recording in a new file. Raises InputError when the file exists or cannot be created."""

    def __init__(self, path: Path, clock: Clock):
        self._clock = clock
        try:
            self._disk = DiskWriter(lambda attempt: path)
        except FileExistsError:
            raise InputError(f"{path}: exists already, and a recording is never overwritten") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be created ({error.strerror or error})") from None

    def begin(self, tray_text: str, aircraft: Aircraft | None) -> None:
        """The first line: all that is needed to make the same drivers again."""
        self._write({"format": FORMAT, "tray": tray_text, "aircraft": aircraft.text if aircraft else None})

    def sensor(self, name: str) -> "SensorRecording":
        """The part of the recording that belongs to one sensor."""
        return SensorRecording(name, self._clock, self._write)

    def close(self) -> str:
        """Wait until all is on the disk; what is wrong with it, or nothing."""
        self._disk.close()
        return self._disk.error

    def _write(self, line: dict[str, Any]) -> None:
        self._disk.write(msgspec.json.encode(line) + b"\n")


class SensorRecording:
    """Listens between one driver and its buses."""

    def __init__(self, name: str, clock: Clock, write: Callable[[dict[str, Any]], None]):
        self._name = name
        self._clock = clock
        self._write = write

    def buses(self, buses: Buses) -> Buses:
        """The same buses, listened to."""
        return _Buses(buses, self)

    def maker(self, make: Callable[[], Sensor]) -> Callable[[], Sensor]:
        """The same maker of drivers; it also says when one is made, and when that is read."""

        def made() -> Sensor:
            self.note({"do": "make"})
            return _Driver(make(), self)

        return made

    def note(self, line: dict[str, Any]) -> None:
        self._write({"t_ns": self._clock.now_ns(), "sensor": self._name, **line})

    def transfer(self, line: dict[str, Any], transfer: Callable[[], T]) -> T:
        """Do it, and note what came of it."""
        t_ns = self._clock.now_ns()
        try:
            result = transfer()
        except OSError as error:
            line |= {"errno": error.errno, "error": error.strerror or str(error)}
            raise
        else:
            if isinstance(result, bytes):
                line["received"] = result.hex()
            return result
        finally:
            self._write({"t_ns": t_ns, "sensor": self._name, **line})


class _Driver:
    def __init__(self, sensor: Sensor, ear: SensorRecording):
        self._sensor, self._ear = sensor, ear

    def start(self) -> Iterator[float]:
        return self._sensor.start()

    def read(self, now_ns: int) -> list[Sample]:
        self._ear.note({"do": "turn", "now_ns": now_ns})
        return self._sensor.read(now_ns)


class _Buses:
    def __init__(self, buses: Buses, ear: SensorRecording):
        self._buses, self._ear = buses, ear

    def i2c(self, device: str) -> I2CBus:
        return _I2C(self._ear.transfer({"do": "open", "device": device}, lambda: self._buses.i2c(device)), self._ear)

    def port(self, device: str, baud: int) -> BytePort:
        line = {"do": "open", "device": device, "baud": baud}
        return _Port(self._ear.transfer(line, lambda: self._buses.port(device, baud)), self._ear)


class _I2C:
    def __init__(self, bus: I2CBus, ear: SensorRecording):
        self._bus, self._ear = bus, ear

    def write(self, address: int, data: bytes) -> None:
        line = {"do": "write", "address": address, "sent": data.hex()}
        self._ear.transfer(line, lambda: self._bus.write(address, data))

    def read(self, address: int, count: int) -> bytes:
        line = {"do": "read", "address": address, "count": count}
        return self._ear.transfer(line, lambda: self._bus.read(address, count))

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        line = {"do": "write_read", "address": address, "sent": data.hex(), "count": count}
        return self._ear.transfer(line, lambda: self._bus.write_read(address, data, count))


class _Port:
    def __init__(self, port: BytePort, ear: SensorRecording):
        self._port, self._ear = port, ear

    def read_available(self) -> bytes:
        return self._ear.transfer({"do": "read"}, self._port.read_available)

    def write(self, data: bytes) -> None:
        self._ear.transfer({"do": "write", "sent": data.hex()}, lambda: self._port.write(data))
