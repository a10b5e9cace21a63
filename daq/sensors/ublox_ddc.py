"""The byte stream of a u-blox receiver on I2C ("DDC"), as a port (Receiver Description, section 13, "DDC port").

Serial is to be preferred: the receiver stretches the I2C clock, which the Raspberry Pi's controller mishandles.
"""

from daq.bus import I2CBus

WAITING, STREAM = 0xFD, 0xFF  # number of bytes waiting, high byte first; the stream itself
NOTHING = 0xFFFF  # an idle receiver may fill the count with ones
AT_MOST = 256  # a tick: more would hold up the bus; two solutions fit


class DdcPort:
    """Satisfies `daq.bus.BytePort`. Bytes that only fill (0xFF) pass through; UBX frames are found between them."""

    def __init__(self, bus: I2CBus, address: int = 0x42):
        self._bus, self._address = bus, address

    def read_available(self) -> bytes:
        """What waits in the receiver, up to 256 bytes."""
        waiting = int.from_bytes(self._bus.write_read(self._address, bytes([WAITING]), 2), "big")
        if waiting in (0, NOTHING):
            return b""
        return self._bus.write_read(self._address, bytes([STREAM]), min(waiting, AT_MOST))

    def write(self, data: bytes) -> None:
        self._bus.write(self._address, data)
