"""Small scripted buses, ports and clocks: no fake parts here, only bytes."""

import errno
from collections.abc import Callable
from itertools import pairwise


class HandClock:
    """A clock that moves when somebody sleeps on it, or by hand."""

    def __init__(self, start_ns: int = 5_000_000_000):
        self.ns = start_ns
        self.unix_offset_ns = 1_500_000_000_000_000_000

    def now_ns(self) -> int:
        return self.ns

    def sleep_until_ns(self, due_ns: int) -> None:
        self.ns = max(self.ns, due_ns)

    def unix_ns(self) -> int:
        return self.ns + self.unix_offset_ns


class RegisterBus:
    """Parts with plain registers, by address; writes are kept in `written`, and `hook` may act on them."""

    def __init__(self, registers: dict[int, dict[int, int]]):
        self.registers = registers
        self.written: list[tuple[int, bytes]] = []
        self.hook: Callable[[int, bytes], None] = lambda address, data: None
        self.broken: OSError | None = None

    def _check(self, address: int) -> None:
        if self.broken is not None:
            raise self.broken
        if address not in self.registers:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")

    def write(self, address: int, data: bytes) -> None:
        self._check(address)
        self.written.append((address, data))
        for i, value in enumerate(data[1:]):
            self.registers[address][data[0] + i] = value
        self.hook(address, data)

    def read(self, address: int, count: int) -> bytes:
        raise AssertionError("a part with registers is never read bare")

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        self._check(address)
        return bytes(self.registers[address].get(data[0] + i, 0) for i in range(count))


class ScriptedPort:
    """Returns the pieces of `incoming`, one per call, and records what is written."""

    def __init__(self) -> None:
        self.incoming: list[bytes] = []
        self.written: list[bytes] = []

    def read_available(self) -> bytes:
        return self.incoming.pop(0) if self.incoming else b""

    def write(self, data: bytes) -> None:
        self.written.append(data)


def bring_up(sensor) -> float:
    """Run through a driver's start and return the time that it asked to wait [s]."""
    return sum(sensor.start())


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    """`data` torn at places that follow from arbitrary numbers."""
    places = sorted({cut % (len(data) + 1) for cut in cuts} | {0, len(data)})
    return [data[a:b] for a, b in pairwise(places)]


def counter_frame(sequence: int, period_us: int = 10714) -> bytes:
    """A frame of the pulse counter's framed variant."""
    from flightpower.daq.sensors.esc_counter import crc8

    body = bytes([sequence % 256, 0]) + period_us.to_bytes(4, "big")
    return b"\xa5" + body + bytes([crc8(body)])
