"""The byte stream of a u-blox receiver on I2C ("DDC"), as a port (Receiver Description, section 13, "DDC port").

Prefer a serial line: the receiver stretches the I2C clock, which the Raspberry Pi's controller mishandles.
"""

from flightpower.daq.bus import I2CBus

WAITING, STREAM = 0xFD, 0xFF  # registers: number of bytes waiting, high byte first; the byte stream
NO_BYTES = 0xFFFF  # an idle receiver may return this count
MAX_BYTES = 256  # most bytes in one tick, to limit the time on the bus; enough for two solutions


class DdcPort:
    """Satisfies `daq.bus.BytePort`. Padding bytes (0xFF) are passed on; the UBX parser skips them."""

    def __init__(self, bus: I2CBus, address: int = 0x42):
        self._bus, self._address = bus, address

    def read_available(self) -> bytes:
        """The bytes waiting in the receiver, at most 256."""
        waiting = int.from_bytes(self._bus.write_read(self._address, bytes([WAITING]), 2), "big")
        if waiting in (0, NO_BYTES):
            return b""
        return self._bus.write_read(self._address, bytes([STREAM]), min(waiting, MAX_BYTES))

    def write(self, data: bytes) -> None:
        self._bus.write(self._address, data)
