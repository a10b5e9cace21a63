"""Shows the output of `daq run` on stderr: events, and a status line on a terminal."""

import os
import shutil
import sys

from flightpower.flight.messages import Event


def print_error(line: str) -> None:
    """Print a line to stderr, which may be closed."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        return


def show_event(event: Event) -> None:
    """Print an event. Under systemd the prefix <n> is its priority in the journal (sd-daemon(3))."""
    priority = {"error": "<3>", "warning": "<4>"}.get(event.severity, "<6>")
    print_error(f"{priority if 'JOURNAL_STREAM' in os.environ else ''}{event.text}")


def has_terminal() -> bool:
    """Whether the process has a controlling terminal."""
    try:
        os.close(os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY))
    except OSError:
        return False
    return True


class StatusLine:
    """A line on the terminal that is overwritten once a second. Does nothing when stderr is not a terminal."""

    def __init__(self) -> None:
        self._on = sys.stderr.isatty()

    def show(self, line: str) -> None:
        self._write(f"\r{line[: shutil.get_terminal_size().columns - 1]}\x1b[K")

    def clear(self) -> None:
        self._write("\r\x1b[K")

    def _write(self, text: str) -> None:
        if self._on:
            try:
                sys.stderr.write(text)
                sys.stderr.flush()
            except OSError:
                self._on = False
