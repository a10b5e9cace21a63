"""Plays recordings of real parts (`daq run --record-bus`) back to a driver, byte by byte.

    recording = load_recording("bench.jsonl")
    for turn in replay(recording, "imu", make):
        turn.samples, turn.failure

`make` makes the driver on the recorded buses. Any access of the driver that differs from the next recorded one raises
`RecordingMismatch`. A transfer that failed in the recording fails again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from flightpower.flight.errors import InputError

FORMAT = "flightpower-bus-recording-1"  # described in daq/bus_recording.py
REPLY = ("t_ns", "received", "errno", "error")  # keys of a line's result; other keys describe the access


class RecordingMismatch(AssertionError):
    """The driver's access differs from the recorded access."""


class EndOfRecording(Exception):
    """The recording has no more lines."""


@dataclass(frozen=True)
class RecordedTransfers:
    """A recording. tray, aircraft: texts of the files; lines: the lines by sensor, in order."""

    tray: str
    aircraft: str | None
    lines: dict[str, list[dict[str, Any]]]


def load_recording(path: str | Path) -> RecordedTransfers:
    """Load a recording. Raises InputError if it cannot be read or is no recording. A torn last line is ignored."""
    try:
        first, *others = Path(path).read_bytes().splitlines(keepends=True)
        head = msgspec.json.decode(first)
        lines = [msgspec.json.decode(line) for line in others if line.endswith(b"\n")]
        if head["format"] != FORMAT:
            raise InputError(f"{path}: not a bus recording in a supported format ({head['format']})")
        by_sensor: dict[str, list[dict[str, Any]]] = {}
        for line in lines:
            by_sensor.setdefault(line["sensor"], []).append(line)
        return RecordedTransfers(head["tray"], head["aircraft"], by_sensor)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError, msgspec.DecodeError):
        raise InputError(f"{path}: not a bus recording") from None


class Playback:
    """Plays the lines of one sensor, in order."""

    def __init__(self, lines: list[dict[str, Any]]):
        self._lines = lines
        self._next = 0

    def peek(self) -> dict[str, Any] | None:
        """The next line, if there is one."""
        return self._lines[self._next] if self._next < len(self._lines) else None

    def play(self, **done: Any) -> dict[str, Any]:
        """Return the next line, which must describe the access `done` now.

        Raises RecordingMismatch if it does not, EndOfRecording after the last line, and the OSError that the line
        records.
        """
        line = self.peek()
        if line is None:
            raise EndOfRecording
        recorded = {key: value for key, value in line.items() if key not in (*REPLY, "sensor")}
        if recorded != done:
            raise RecordingMismatch(f"line {self._next + 1} of {line['sensor']}: {done} where {recorded} was recorded")
        self._next += 1
        if "errno" in line:
            raise OSError(line["errno"], line["error"])
        return line


class ReplayBuses:
    """The recorded buses and ports; satisfies `daq.bus.Buses`."""

    def __init__(self, playback: Playback):
        self._playback = playback

    def i2c(self, device: str) -> "ReplayBus":
        self._playback.play(do="open", device=device)
        return ReplayBus(self._playback)

    def port(self, device: str, baud: int) -> "ReplayPort":
        self._playback.play(do="open", device=device, baud=baud)
        return ReplayPort(self._playback)


class ReplayBus:
    """A recorded bus; satisfies `daq.bus.I2CBus`."""

    def __init__(self, playback: Playback):
        self._playback = playback

    def write(self, address: int, data: bytes) -> None:
        self._playback.play(do="write", address=address, sent=data.hex())

    def read(self, address: int, count: int) -> bytes:
        return bytes.fromhex(self._playback.play(do="read", address=address, count=count)["received"])

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        line = self._playback.play(do="write_read", address=address, sent=data.hex(), count=count)
        return bytes.fromhex(line["received"])


class ReplayPort:
    """A recorded port; satisfies `daq.bus.BytePort`."""

    def __init__(self, playback: Playback):
        self._playback = playback

    def read_available(self) -> bytes:
        return bytes.fromhex(self._playback.play(do="read")["received"])

    def write(self, data: bytes) -> None:
        self._playback.play(do="write", sent=data.hex())


class ReplayedReading(NamedTuple):
    """One reading of the driver: its samples, or the exception it raised (also while it was made or started)."""

    now_ns: int | None  # None if the start failed
    samples: list[Any]
    failure: Exception | None


def replay(recording: RecordedTransfers, sensor: str, make: Callable[[ReplayBuses], Any]) -> Iterator[ReplayedReading]:
    """Play the recording of `sensor` back to its driver; raises RecordingMismatch where the driver differs from it.

    make: makes a driver (`daq.sensors.Sensor`) on the given buses; it is called wherever the recording made one.
    """
    playback = Playback(recording.lines.get(sensor, []))
    buses = ReplayBuses(playback)
    driver = None
    while (line := playback.peek()) is not None:
        now_ns = line.get("now_ns")
        samples: list[Any] = []
        failure = None
        try:
            if line["do"] == "make":
                playback.play(do="make")
                driver = make(buses)
                for _ in driver.start():
                    pass
            elif driver is not None:
                playback.play(do="turn", now_ns=now_ns)
                samples = driver.read(now_ns)
            else:
                raise RecordingMismatch(f"{sensor}: {line['do']} before a driver was made")
        except EndOfRecording:
            return
        except RecordingMismatch:
            raise
        except Exception as error:  # the daemon would log this and make a new driver
            failure = error
        left_out = playback.peek()
        if left_out is not None and left_out["do"] not in ("make", "turn"):
            raise RecordingMismatch(f"{sensor}: nothing where {left_out} was recorded")
        if failure is not None or now_ns is not None:
            yield ReplayedReading(now_ns, samples, failure)
