"""A fake serial line between a part and a computer, on which bytes arrive one after another at the baud rate."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Protocol

BITS_PER_BYTE = 10  # start, eight data bits, stop
RECEIVE_BUFFER = 4095  # bytes the kernel keeps for a slow reader (N_TTY)
TRANSMIT_BUFFER = 4096  # bytes a part keeps for a slow line; a message that does not fit is lost


class SerialDevice(Protocol):
    """A part with a serial line. It computes at each call what it has sent; nothing runs in the background."""

    @property
    def baud(self) -> int:
        """Baud rate of the part."""

    def output(self, until_ns: int) -> Iterable[tuple[int, bytes]]:
        """Messages whose sending began after the last call and up to `until_ns`: (time [ns], bytes), in order."""

    def receive(self, data: bytes, at_ns: int) -> None:
        """Receive `data`, which arrived at `at_ns`."""


class FakePort:
    """The computer's end of the line; satisfies `daq.bus.BytePort`.

    now_ns: gives the time since the start of the simulation [ns]. Bytes sent before the port was opened are lost.
    At a baud rate other than the part's, both sides receive garbled bytes.
    """

    def __init__(self, device: SerialDevice, baud: int, now_ns: Callable[[], int]):
        self._device = device
        self.baud = baud
        self._now_ns = now_ns
        self._opened_ns = now_ns()
        self._under_way: deque[tuple[int, bytes]] = deque()  # time of the first bit [ns], and the bytes
        self._line_free_ns = 0
        self._received = bytearray()

    def read_available(self) -> bytes:
        """The bytes that have arrived since the last call, perhaps none; never waits."""
        now_ns = self._now_ns()
        self.collect(now_ns)
        byte_ns = BITS_PER_BYTE * 1e9 / self._device.baud
        while self._under_way and self._under_way[0][0] <= now_ns:
            start_ns, data = self._under_way.popleft()
            arrived = min(int((now_ns - start_ns) / byte_ns), len(data))
            missed = min(max(0, int((self._opened_ns - start_ns) / byte_ns)), arrived)
            self._received += data[missed:arrived]
            if arrived < len(data):
                self._under_way.appendleft((start_ns + round(arrived * byte_ns), data[arrived:]))
                break
        taken = bytes(self._received[:RECEIVE_BUFFER])
        self._received.clear()
        return taken if self.baud == self._device.baud else garbled(taken)

    def collect(self, until_ns: int) -> None:
        """Move the bytes that the part sends up to `until_ns` to the line."""
        byte_ns = BITS_PER_BYTE * 1e9 / self._device.baud
        for sent_ns, data in self._device.output(until_ns):
            start_ns = max(sent_ns, self._line_free_ns)
            if start_ns - sent_ns <= TRANSMIT_BUFFER * byte_ns:
                self._line_free_ns = start_ns + round(len(data) * byte_ns)
                self._under_way.append((start_ns, data))

    def write(self, data: bytes) -> None:
        """Send `data` to the part."""
        arrival_ns = self._now_ns() + round(len(data) * BITS_PER_BYTE * 1e9 / self.baud)
        self._device.receive(data if self.baud == self._device.baud else garbled(data), arrival_ns)


def garbled(data: bytes) -> bytes:
    """`data` as received at a wrong baud rate: different bytes, but the same each time."""
    return bytes((byte * 167 + 89) & 0xFF for byte in data)
