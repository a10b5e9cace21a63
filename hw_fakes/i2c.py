"""A fake I2C bus with fake parts, whose transfers take time."""

import errno
from collections.abc import Callable
from typing import Protocol

BITS_PER_BYTE = 9  # eight bits and the acknowledge (UM10204 sec. 3.1.5)


class I2CDevice(Protocol):
    """A part on the bus. It computes its state from its clock at each access; nothing runs in the background."""

    def write(self, data: bytes) -> None:
        """A write message; raises OSError when the part does not acknowledge."""

    def read(self, count: int) -> bytes:
        """A read message without a preceding write."""

    def write_read(self, data: bytes, count: int) -> bytes:
        """A write and a read joined by a repeated start."""


class I2CBus(Protocol):
    """The interface of `daq.bus.I2CBus`, which `hw_fakes` does not import."""

    def write(self, address: int, data: bytes) -> None: ...

    def read(self, address: int, count: int) -> bytes: ...

    def write_read(self, address: int, data: bytes, count: int) -> bytes: ...


def no_acknowledge(address: int | None = None) -> OSError:
    """The error that Linux gives without an acknowledge: 121 (Remote I/O error)."""
    where = "" if address is None else f" at 0x{address:02x}"
    return OSError(errno.EREMOTEIO, f"Remote I/O error: no acknowledge{where}")


class FakeI2CBus:
    """Parts by address; satisfies `daq.bus.I2CBus`.

    devices: parts by 7-bit address. find: is called with an address that `devices` lacks, for a part that is visible
    only at times. spend_ns: is called with the duration of each transfer [ns]; None if time passes by itself.
    bit_rate_Hz: frequency of the bus clock.
    """

    def __init__(
        self,
        devices: dict[int, I2CDevice],
        *,
        find: Callable[[int], I2CDevice | None] = lambda address: None,
        spend_ns: Callable[[int], None] | None = None,
        bit_rate_Hz: float = 400e3,
    ):
        self.devices = devices
        self._find = find
        self._spend_ns = spend_ns
        self._byte_ns = BITS_PER_BYTE * 1e9 / bit_rate_Hz

    def write(self, address: int, data: bytes) -> None:
        device = self._device(address)
        self._pass_time(1 + len(data))  # the part acts once the message is complete
        device.write(data)

    def read(self, address: int, count: int) -> bytes:
        reply = self._device(address).read(count)  # the part's reply is its state when it is addressed
        self._pass_time(1 + count)
        return reply

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        reply = self._device(address).write_read(data, count)
        self._pass_time(2 + len(data) + count)
        return reply

    def _device(self, address: int) -> I2CDevice:
        device = self.devices.get(address) or self._find(address)
        if device is None:
            self._pass_time(1)
            raise no_acknowledge(address)
        return device

    def _pass_time(self, byte_count: int) -> None:
        if self._spend_ns is not None:
            self._spend_ns(round(byte_count * self._byte_ns))
