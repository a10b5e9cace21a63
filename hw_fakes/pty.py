"""Serves a fake serial part on a real pseudo-terminal, in real time, for pyserial and other processes."""

import os
import select
import termios
import threading
import tty
from typing import Protocol

POLL_S = 0.002

BAUD_OF_CODE = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}


class SerialPort(Protocol):
    """The computer's end of the line, such as `hw_fakes.port.FakePort`."""

    baud: int

    def read_available(self) -> bytes: ...

    def write(self, data: bytes) -> None: ...


class PtyServer:
    """Serves `port` on a pseudo-terminal until closed; `path` is the path to open.

    The baud rate is set by whoever opens the path, as on a real line. Bytes that are not read in time are lost, as
    when the kernel's buffer of a real line is full. Use it as a context manager. The part's clock must advance by
    itself.
    """

    def __init__(self, port: SerialPort):
        self._port = port
        self._controller, self._terminal = (
            os.openpty()
        )  # keeping the terminal open preserves the line between two openings
        tty.setraw(self._terminal)
        os.set_blocking(self._controller, False)
        self.path = os.ttyname(self._terminal)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=f"pty {self.path}", daemon=True)
        self._thread.start()

    def __enter__(self) -> "PtyServer":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop serving; an open line then behaves as if unplugged."""
        if not self._stop.is_set():
            self._stop.set()
            self._thread.join()
            os.close(self._controller)
            os.close(self._terminal)

    def _serve(self) -> None:
        while not self._stop.is_set():
            readable, _, _ = select.select([self._controller], [], [], POLL_S)
            code = termios.tcgetattr(self._controller)[5]
            self._port.baud = BAUD_OF_CODE.get(code, self._port.baud)
            if readable:
                self._port.write(os.read(self._controller, 4096))
            data = self._port.read_available()
            try:
                while data:
                    data = data[os.write(self._controller, data) :]
            except BlockingIOError:  # the reader is too slow
                pass
