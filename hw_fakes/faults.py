"""Schedules faults of the fake sensors, to test how a daemon handles them.

`load_faults("faults.toml")` reads

    [[fault]]
    kind = "no_acknowledge"
    device = "baro"
    start = "20 s"
    duration = "3 s"        # without it: to the end
    rate = 0.02             # bit_flips, checksum_errors: probability that a byte is changed

Devices: imu, magnetometer, baro, static, alpha, beta, airspeed, i2c (the whole bus), gps, esc_counter, autopilot.

A fault acts where it arises: on the wire between computer and part (`FaultyBus`, `FaultyPort`), or in the part itself
(`PartFault`).
"""

import enum
import errno
import os
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import read_table
from flightpower.hw_fakes.i2c import I2CBus, no_acknowledge

BRIDGES = ("alpha", "beta", "airspeed")
BAROMETERS = ("baro", "static")
I2C_PARTS = ("imu", "magnetometer", *BAROMETERS, *BRIDGES)
SERIAL_PARTS = ("gps", "esc_counter", "autopilot")
BUS = "i2c"


class FaultKind(enum.StrEnum):
    """The kind of a fault, as named in the fault file."""

    NO_ACKNOWLEDGE = "no_acknowledge"
    TIMEOUT = "timeout"
    BIT_FLIPS = "bit_flips"
    STUCK_VALUE = "stuck_value"
    WRONG_DEVICE = "wrong_device"
    BROWN_OUT = "brown_out"
    WRONG_PROM_CRC = "wrong_prom_crc"
    STALE = "stale"
    LATCHED_FAULT = "latched_fault"
    NO_FIX = "no_fix"
    CHECKSUM_ERRORS = "checksum_errors"
    UNPLUGGED = "unplugged"
    SILENT = "silent"


ON_THE_BUS = (
    FaultKind.NO_ACKNOWLEDGE,
    FaultKind.TIMEOUT,
    FaultKind.BIT_FLIPS,
    FaultKind.STUCK_VALUE,
    FaultKind.WRONG_DEVICE,
)
DEVICES_OF_KIND: dict[FaultKind, tuple[str, ...]] = {
    FaultKind.NO_ACKNOWLEDGE: (*I2C_PARTS, BUS),
    FaultKind.TIMEOUT: (*I2C_PARTS, BUS),
    FaultKind.BIT_FLIPS: (*I2C_PARTS, BUS),
    FaultKind.STUCK_VALUE: I2C_PARTS,
    FaultKind.WRONG_DEVICE: I2C_PARTS,
    FaultKind.BROWN_OUT: (*I2C_PARTS, "gps"),
    FaultKind.WRONG_PROM_CRC: BAROMETERS,
    FaultKind.STALE: BRIDGES,
    FaultKind.LATCHED_FAULT: BRIDGES,
    FaultKind.NO_FIX: ("gps",),
    FaultKind.CHECKSUM_ERRORS: SERIAL_PARTS,
    FaultKind.UNPLUGGED: SERIAL_PARTS,
    FaultKind.SILENT: SERIAL_PARTS,
}
TIMEOUT_NS = 20_000_000  # duration of a transfer that times out


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault. start_s, duration_s: in simulated time. rate: probability that a byte is changed."""

    kind: FaultKind
    device: str
    start_s: float
    duration_s: float = float("inf")
    rate: float = 0.02

    @property
    def start_ns(self) -> int:
        return round(self.start_s * 1e9)

    @property
    def end_ns(self) -> float:
        return (self.start_s + self.duration_s) * 1e9

    def active(self, now_ns: int) -> bool:
        return self.start_ns <= now_ns < self.end_ns


def load_faults(path: str | Path) -> tuple[Fault, ...]:
    """Read the faults of a TOML file.

    Raises InputError if the file cannot be read, or names a kind, a device or a pair of them that does not exist.
    """
    try:
        table = tomllib.loads(read_text(Path(path)))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML ({error})") from None
    entries = table.pop("fault", [])
    if table or not isinstance(entries, list):
        raise InputError(f"{path}: only [[fault]] tables are allowed")
    faults = tuple(read_table(Fault, entry, f"{path}: fault {i + 1}") for i, entry in enumerate(entries))
    for i, fault in enumerate(faults):
        check_fault(fault, f"{path}: fault {i + 1}")
    return faults


def check_fault(fault: Fault, where: str) -> None:
    """Raises InputError unless the fault can happen to its device."""
    if fault.kind not in DEVICES_OF_KIND:
        raise InputError(f"{where}: unknown kind {fault.kind!r}; known: {', '.join(DEVICES_OF_KIND)}")
    if fault.device not in DEVICES_OF_KIND[fault.kind]:
        raise InputError(
            f"{where}: {fault.kind} cannot happen to {fault.device!r}, only to {', '.join(DEVICES_OF_KIND[fault.kind])}"
        )
    if fault.start_s < 0 or fault.duration_s <= 0 or not 0 <= fault.rate <= 1:
        raise InputError(f"{where}: start must not be negative, duration must be positive, rate 0 to 1")


class PartFault:
    """A fault inside a part, which calls `begin` at its start and `end` at its end, each once, with the time [ns]."""

    def __init__(self, fault: Fault, begin: Callable[[int], None], end: Callable[[int], None]):
        self._due: list[tuple[float, Callable[[int], None]]] = [(fault.start_ns, begin), (fault.end_ns, end)]

    def next_ns(self) -> float:
        """Time of the next event [ns]; infinity without one."""
        return self._due[0][0] if self._due else float("inf")

    def happen(self) -> None:
        """Execute the next event."""
        at_ns, event = self._due.pop(0)
        event(int(at_ns))


def part_fault(fault: Fault, part: Any) -> PartFault | None:
    """Make the fault's effect inside `part`, or return None if it acts on the wire."""

    def nothing(at_ns: int) -> None:
        return None

    def set_attribute(name: str, value: object) -> Callable[[int], None]:
        return lambda at_ns: setattr(part, name, value)

    match fault.kind:
        case FaultKind.BROWN_OUT:
            return PartFault(fault, nothing, part.power_cycle)
        case FaultKind.WRONG_PROM_CRC:
            good = list(part.prom)
            return PartFault(
                fault, set_attribute("prom", [good[0], good[1] ^ 0x0010, *good[2:]]), set_attribute("prom", good)
            )
        case FaultKind.STALE:
            return PartFault(fault, lambda at_ns: setattr(part, "frozen_ns", at_ns), set_attribute("frozen_ns", None))
        case FaultKind.LATCHED_FAULT:
            return PartFault(fault, set_attribute("fault", True), part.power_cycle)
        case FaultKind.NO_FIX:
            return PartFault(fault, set_attribute("fix_lost", True), set_attribute("fix_lost", False))
    return None


class FaultyBus:
    """An I2C bus with faults; satisfies `daq.bus.I2CBus`.

    faults: by address; the key None has faults of the whole bus. parts: faults inside parts, by address. now_ns: gives
    simulated time [ns]. spend_ns: is called with the duration of a timeout [ns]; None if time passes by itself.
    """

    def __init__(
        self,
        bus: I2CBus,
        faults: dict[int | None, list[Fault]],
        parts: dict[int, list[PartFault]],
        now_ns: Callable[[], int],
        *,
        seed: int,
        spend_ns: Callable[[int], None] | None = None,
    ):
        self._bus = bus
        self._faults = faults
        self._parts = parts
        self._now_ns = now_ns
        self._spend_ns = spend_ns
        self._draw = np.random.default_rng(seed)
        self._seen: dict[tuple[int, bytes, int], bytes] = {}  # latest good reply to each request

    def write(self, address: int, data: bytes) -> None:
        active = self._at_the_wire(address)
        if not any(fault.kind == FaultKind.WRONG_DEVICE for fault in active):
            self._bus.write(address, data)

    def read(self, address: int, count: int) -> bytes:
        return self._reply(address, b"", count, lambda: self._bus.read(address, count))

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._reply(address, data, count, lambda: self._bus.write_read(address, data, count))

    def _at_the_wire(self, address: int) -> list[Fault]:
        """The faults that are active now. Raises OSError for a fault that blocks the transfer."""
        now_ns = self._now_ns()
        for part in self._parts.get(address, ()):
            while part.next_ns() <= now_ns:
                part.happen()
        active = [f for f in (*self._faults.get(None, ()), *self._faults.get(address, ())) if f.active(now_ns)]
        for fault in active:
            if fault.kind in (FaultKind.NO_ACKNOWLEDGE, FaultKind.BROWN_OUT):
                raise no_acknowledge(address)
            if fault.kind == FaultKind.TIMEOUT:
                if self._spend_ns is not None:
                    self._spend_ns(TIMEOUT_NS)
                raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
        return active

    def _reply(self, address: int, data: bytes, count: int, ask: Callable[[], bytes]) -> bytes:
        kinds = {fault.kind: fault for fault in self._at_the_wire(address)}
        if FaultKind.WRONG_DEVICE in kinds:
            return memory_chip_reply(data, count)
        question = (address, data, count)
        if FaultKind.STUCK_VALUE in kinds and question in self._seen:
            return self._seen[question]
        reply = self._seen[question] = ask()
        return flip_bits(reply, kinds[FaultKind.BIT_FLIPS].rate, self._draw) if FaultKind.BIT_FLIPS in kinds else reply


def memory_chip_reply(data: bytes, count: int) -> bytes:
    """The reply of a memory chip at the address: consecutive bytes from the address that was written."""
    start = data[0] if data else 0
    return bytes((start + i) % 256 for i in range(count))


def flip_bits(data: bytes, rate: float, draw: np.random.Generator) -> bytes:
    """Invert one bit in each byte of `data` with the probability `rate`."""
    struck = draw.random(len(data)) < rate
    bits = 1 << draw.integers(0, 8, len(data))
    return bytes(byte ^ int(bit) if struck_ else byte for byte, struck_, bit in zip(data, struck, bits, strict=True))


class SerialLine(Protocol):
    baud: int

    def read_available(self) -> bytes: ...

    def write(self, data: bytes) -> None: ...

    def collect(self, until_ns: int) -> None: ...


class FaultyPort:
    """A serial line with faults; satisfies `daq.bus.BytePort`.

    After the fault `unplugged` the port must be reopened, like the file of a real device.
    """

    def __init__(
        self,
        line: SerialLine,
        faults: Sequence[Fault],
        parts: Iterable[PartFault],
        now_ns: Callable[[], int],
        seed: int,
    ):
        self._line = line
        self._faults = faults
        self._parts = list(parts)
        self._now_ns = now_ns
        self._opened_ns = now_ns()
        self._draw = np.random.default_rng(seed)

    @property
    def baud(self) -> int:
        return self._line.baud

    @baud.setter
    def baud(self, baud: int) -> None:
        self._line.baud = baud

    def read_available(self) -> bytes:
        active = self._at_the_wire()
        data = self._line.read_available()
        if any(fault.kind in (FaultKind.SILENT, FaultKind.BROWN_OUT) for fault in active):
            return b""
        for fault in active:
            if fault.kind == FaultKind.CHECKSUM_ERRORS:
                data = flip_bits(data, fault.rate, self._draw)
        return data

    def write(self, data: bytes) -> None:
        if not any(fault.kind in (FaultKind.SILENT, FaultKind.BROWN_OUT) for fault in self._at_the_wire()):
            self._line.write(data)

    def _at_the_wire(self) -> list[Fault]:
        now_ns = self._now_ns()
        for part in self._parts:
            while (due_ns := part.next_ns()) <= now_ns:
                self._line.collect(int(due_ns) - 1)  # bytes sent before the event are not affected by it
                part.happen()
        if any(
            f.kind == FaultKind.UNPLUGGED and f.start_ns <= now_ns and f.end_ns > self._opened_ns for f in self._faults
        ):
            raise OSError(errno.EIO, "device reports readiness to read but returned no data (device disconnected?)")
        return [fault for fault in self._faults if fault.active(now_ns)]
