"""The I2C side ("DDC") of a u-blox M8: the stream of its messages behind three register addresses.

Receiver description UBX-13003221, section "DDC port". That the receiver stretches the clock is not simulated.
"""

from collections.abc import Callable

from hw_fakes.ublox import FakeUbloxM8

ADDRESS = 0x42
WAITING_HIGH, WAITING_LOW, STREAM = 0xFD, 0xFE, 0xFF
NOTHING = 0xFF  # value of a register without content
BUFFER_BYTES = 4096  # of waiting messages; a message that does not fit is lost
EMPTIED_AFTER_NS = 1_500_000_000  # without any access the buffer is cleared (CFG-PRT, extendedTxTimeout not set)


class FakeUbloxDdc:
    """The receiver at 0x42. now_ns: gives the time since the start of the simulation [ns]."""

    def __init__(self, receiver: FakeUbloxM8, now_ns: Callable[[], int]):
        self._receiver = receiver
        self._now_ns = now_ns
        self._register = STREAM
        self._waiting = bytearray()
        self._touched_ns: float = float("-inf")

    def power_cycle(self, at_ns: int) -> None:
        """Supply off and on."""
        self._receiver.power_cycle(at_ns)
        self._register = STREAM
        self._waiting.clear()

    def write(self, data: bytes) -> None:
        """One byte selects a register; more bytes go to the receiver as part of its input stream."""
        self._catch_up()
        if len(data) == 1:
            self._register = data[0]
        elif data:
            self._receiver.receive(data, self._now_ns())

    def read(self, count: int) -> bytes:
        """Read from the selected register on; the stream register, selected after power-on, stays selected."""
        self._catch_up()
        length = len(self._waiting).to_bytes(2, "big")
        reply = bytearray()
        while len(reply) < count:
            if self._register == STREAM:
                wanted = count - len(reply)
                reply += self._waiting[:wanted].ljust(wanted, bytes([NOTHING]))
                del self._waiting[:wanted]
                break
            reply.append(length[self._register - WAITING_HIGH] if self._register >= WAITING_HIGH else NOTHING)
            self._register += 1
        return bytes(reply)

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _catch_up(self) -> None:
        """Buffer what the receiver has sent since the last access."""
        now_ns = self._now_ns()
        if now_ns - self._touched_ns > EMPTIED_AFTER_NS:
            self._waiting.clear()
        for sent_ns, data in self._receiver.output(now_ns):
            wanted = sent_ns - self._touched_ns <= EMPTIED_AFTER_NS and now_ns - self._touched_ns <= EMPTIED_AFTER_NS
            if wanted and len(self._waiting) + len(data) <= BUFFER_BYTES:
                self._waiting += data
        self._touched_ns = now_ns
