"""The I2C side ("DDC") of a u-blox M8: the stream of its messages behind three register addresses.

Receiver description UBX-13003221, section "DDC port". That the receiver stretches the clock is not simulated.
"""

from collections.abc import Callable

from hw_fakes.ublox import FakeUbloxM8

ADDRESS = 0x42
WAITING_HIGH, WAITING_LOW, STREAM = 0xFD, 0xFE, 0xFF
NOTHING = 0xFF  # what a register without anything behind it reads as
BUFFER_BYTES = 4096  # of messages that wait; what does not fit is lost whole
EMPTIED_AFTER_NS = 1_500_000_000  # without any access the buffer is cleared (CFG-PRT, extendedTxTimeout not set)


class FakeUbloxDdc:
    """The receiver at 0x42. now_ns: the time that is 0 where the simulation begins [ns]."""

    def __init__(self, receiver: FakeUbloxM8, now_ns: Callable[[], int]):
        self._receiver = receiver
        self._now_ns = now_ns
        self._register = STREAM
        self._waiting = bytearray()
        self._touched_ns: float = float("-inf")

    def power_cycle(self, at_ns: int) -> None:
        """Supply gone and back."""
        self._receiver.power_cycle(at_ns)
        self._register = STREAM
        self._waiting.clear()

    def write(self, data: bytes) -> None:
        """One byte points to a register; more are a piece of the stream to the receiver."""
        self._catch_up()
        if len(data) == 1:
            self._register = data[0]
        elif data:
            self._receiver.receive(data, self._now_ns())

    def read(self, count: int) -> bytes:
        """From the register pointed to onwards; the pointer stays on the stream, where it also is after power-on."""
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
        """Let wait what the receiver has sent since it was last touched."""
        now_ns = self._now_ns()
        if now_ns - self._touched_ns > EMPTIED_AFTER_NS:
            self._waiting.clear()
        for sent_ns, data in self._receiver.output(now_ns):
            wanted = sent_ns - self._touched_ns <= EMPTIED_AFTER_NS and now_ns - self._touched_ns <= EMPTIED_AFTER_NS
            if wanted and len(self._waiting) + len(data) <= BUFFER_BYTES:
                self._waiting += data
        self._touched_ns = now_ns
