"""Records every bus transaction in a file, so that a real part can be replayed in a test (see `hw_fakes.replay`).

JSON lines. The first holds tray and aircraft file. Each other line is one action of one sensor, with its time
(monotonic [ns]) and result. Bytes are hexadecimal.

    {"t_ns": 51, "sensor": "imu", "do": "make"}                          a driver is made and started
    {"t_ns": 52, "sensor": "imu", "do": "open", "device": "/dev/i2c-1"}  ports also have "baud"
    {"t_ns": 60, "sensor": "imu", "do": "write", "address": 104, "sent": "6b80"}
    {"t_ns": 70, "sensor": "imu", "do": "turn", "now_ns": 69}            the driver is read, with this argument now_ns
    {"t_ns": 71, "sensor": "imu", "do": "write_read", "address": 104, "sent": "6a", "count": 10, "received": "40…"}
    {"t_ns": 99, "sensor": "rpm", "do": "read", "received": "78002a", …} ports: no address, no count
    …, "errno": 121, "error": "Remote I/O error"}                        instead of "received", after a failure

The thread that reads the sensor encodes a line in a few microseconds; another thread writes it.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from flightpower.daq.bus import Buses, BytePort, I2CBus
from flightpower.daq.clock import Clock
from flightpower.daq.disk_writer import DiskWriter
from flightpower.daq.sensors import Sample, Sensor
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError

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
        """Write the first line, which holds what is needed to make the same drivers again."""
        self._write({"format": FORMAT, "tray": tray_text, "aircraft": aircraft.text if aircraft else None})

    def sensor(self, name: str) -> "SensorRecording":
        """The recording of one sensor."""
        return SensorRecording(name, self._clock, self._write)

    def close(self) -> str:
        """Wait until everything is on the disk. Returns the cause if that failed, or an empty string."""
        self._disk.close()
        return self._disk.error

    def _write(self, line: dict[str, Any]) -> None:
        self._disk.write(msgspec.json.encode(line) + b"\n")


class SensorRecording:
    """Records the transactions between one driver and its buses."""

    def __init__(self, name: str, clock: Clock, write: Callable[[dict[str, Any]], None]):
        self._name = name
        self._clock = clock
        self._write = write

    def buses(self, buses: Buses) -> Buses:
        """Wrap these buses so that their traffic is recorded."""
        return _RecordedBuses(buses, self)

    def driver_factory(self, make: Callable[[], Sensor]) -> Callable[[], Sensor]:
        """Wrap the driver factory so that the recording shows when each driver is made and read."""

        def make_recorded() -> Sensor:
            self.note({"do": "make"})
            return _RecordedDriver(make(), self)

        return make_recorded

    def note(self, line: dict[str, Any]) -> None:
        self._write({"t_ns": self._clock.now_ns(), "sensor": self._name, **line})

    def transfer(self, line: dict[str, Any], transfer: Callable[[], T]) -> T:
        """Perform a transfer and record its result."""
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


class _RecordedDriver:
    def __init__(self, sensor: Sensor, recording: SensorRecording):
        self._sensor, self._recording = sensor, recording

    def start(self) -> Iterator[float]:
        return self._sensor.start()

    def read(self, now_ns: int) -> list[Sample]:
        self._recording.note({"do": "turn", "now_ns": now_ns})
        return self._sensor.read(now_ns)


class _RecordedBuses:
    def __init__(self, buses: Buses, recording: SensorRecording):
        self._buses, self._recording = buses, recording

    def i2c(self, device: str) -> I2CBus:
        return _RecordedI2C(
            self._recording.transfer({"do": "open", "device": device}, lambda: self._buses.i2c(device)), self._recording
        )

    def port(self, device: str, baud: int) -> BytePort:
        line = {"do": "open", "device": device, "baud": baud}
        return _RecordedPort(self._recording.transfer(line, lambda: self._buses.port(device, baud)), self._recording)


class _RecordedI2C:
    def __init__(self, bus: I2CBus, recording: SensorRecording):
        self._bus, self._recording = bus, recording

    def write(self, address: int, data: bytes) -> None:
        line = {"do": "write", "address": address, "sent": data.hex()}
        self._recording.transfer(line, lambda: self._bus.write(address, data))

    def read(self, address: int, count: int) -> bytes:
        line = {"do": "read", "address": address, "count": count}
        return self._recording.transfer(line, lambda: self._bus.read(address, count))

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        line = {"do": "write_read", "address": address, "sent": data.hex(), "count": count}
        return self._recording.transfer(line, lambda: self._bus.write_read(address, data, count))


class _RecordedPort:
    def __init__(self, port: BytePort, recording: SensorRecording):
        self._port, self._recording = port, recording

    def read_available(self) -> bytes:
        return self._recording.transfer({"do": "read"}, self._port.read_available)

    def write(self, data: bytes) -> None:
        self._recording.transfer({"do": "write", "sent": data.hex()}, lambda: self._port.write(data))
