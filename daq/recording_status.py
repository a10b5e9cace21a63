"""The state of a recording, once a second: a line for the terminal and systemd, a file for the status page."""

from collections import deque
from pathlib import Path

import msgspec

from flight.messages import Event

LATEST_EVENTS = 20


class RecordingStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What the daemon does at the moment."""

    recording: bool
    waiting_for_switch: bool
    log: str  # name of the file; empty while there is none
    elapsed_s: float
    ticks: int
    missed: int
    free_bytes: int | None
    error: str  # why the disk cannot be written; empty when it can
    sensors: dict[str, str]  # state by name
    slow: list[str]  # what to do about buses that are too slow

    @property
    def line(self) -> str:
        """All of it in one line."""
        if self.recording:
            state = f"recording {self.log or 'to memory'}"
        else:
            state = "waiting for the arm switch" if self.waiting_for_switch else "NOT RECORDING: the card is full"
        error = f"{self.error}; " if self.error else ""
        free = "" if self.free_bytes is None else f", {self.free_bytes / 1e9:.1f} GB free"
        failing = ", ".join(f"{name} {state}" for name, state in self.sensors.items() if state != "ok")
        line = (
            f"{state}, {self.elapsed_s:.0f} s, {self.ticks} ticks, {self.missed} missed{free}; "
            f"{error}{failing or 'all sensors ok'}"
        )
        return "; ".join([line, *self.slow])


class PublishedStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of the status file: the latest status and events, the latest event first."""

    status: RecordingStatus
    events: list[Event]


class StatusFile:
    """Replaces a file with the latest status. The file has to be on a file system in memory, such as /run."""

    def __init__(self, path: Path):
        self._path = path
        self._events: deque[Event] = deque(maxlen=LATEST_EVENTS)

    def add(self, event: Event) -> None:
        self._events.appendleft(event)

    def write(self, status: RecordingStatus) -> None:
        """Replace the file. A file that cannot be written costs the status page, not the recording."""
        beside = self._path.with_name(f"{self._path.name}.new")
        try:
            beside.write_bytes(msgspec.json.encode(PublishedStatus(status=status, events=list(self._events))))
            beside.replace(self._path)
        except OSError:
            return
