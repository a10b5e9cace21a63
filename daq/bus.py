"""Access to I2C and serial devices: the interfaces that drivers use. `daq.linux_bus` implements them.

Every transfer takes a bounded time. A failed transfer raises OSError with the kernel's number: 121 (EREMOTEIO) or 6
(ENXIO) when nothing acknowledges, 110 (ETIMEDOUT) when the bus hangs, 5 (EIO) when fewer bytes than requested were
transferred.
"""

from typing import Protocol

IN_USE = "another program has it open"


class I2CBus(Protocol):
    """One I2C bus, shared by several drivers."""

    def write(self, address: int, data: bytes) -> None:
        """Write one message to the device."""

    def read(self, address: int, count: int) -> bytes:
        """Read one message of `count` bytes, without writing a register address before it."""

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write and then read, joined by a repeated start, which is how registers are read."""


class BytePort(Protocol):
    """A byte stream in both directions: serial line, pseudo-terminal or UDP."""

    def read_available(self) -> bytes:
        """The bytes that have arrived since the last call. May be empty; never waits."""

    def write(self, data: bytes) -> None:
        """Send `data`. Waits at most for the port's write timeout."""


class Buses(Protocol):
    """Opens the buses and ports that the configuration names."""

    def i2c(self, device: str) -> I2CBus: ...

    def port(self, device: str, baud: int) -> BytePort: ...
