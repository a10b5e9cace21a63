"""The state of a recording, issued once a second: a line for the terminal and systemd, a file for the status page."""

import enum
import time
from collections import deque
from pathlib import Path

import msgspec

from flightpower.daq.plausibility import Values
from flightpower.daq.sensor_health import SensorState
from flightpower.daq.terminal import print_error
from flightpower.flight.messages import Event, State

LATEST_EVENTS = 20
NO_NEWS_S = 3.0  # a status is written once a second; a status older than this is out of date
LEAST_RATE = 0.9  # as a fraction of the tray's rate
RECENT_S = 10.0  # missed ticks are reported for this long


def ticks_missed(number: int) -> str:
    """ "1 tick missed", "2 ticks missed"."""
    return f"{number} {'tick' if number == 1 else 'ticks'} missed"


def readable(text: str) -> str:
    """A text that can be written everywhere: file names may contain bytes that are not characters (PEP 383)."""
    return text.encode("utf-8", "backslashreplace").decode()


class RecordingState(enum.StrEnum):
    """Whether the daemon records, and if not, why."""

    RECORDING = "recording"
    WAITING = "waiting for the arm switch"
    CARD_FULL = "NOT RECORDING: the card is full"


IN_ORDER = frozenset({SensorState.OK, SensorState.WAITING})


class RecordingStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What the daemon is doing at the moment."""

    state: RecordingState
    log: str  # name of the log; empty while there is none
    elapsed_s: float
    ticks: int
    missed: int
    rate_Hz: float  # rate of the ticks since the last status
    free_bytes: int | None
    error: str  # why the disk cannot be written; empty if it can
    sensors: dict[str, SensorState]  # states by name
    slow: list[str]  # advice on buses that are too slow
    implausible: list[str] = []  # readings that contradict each other
    recent_missed: int = 0  # ticks missed in the last RECENT_S
    trouble: list[str] = []  # other problems, such as a low supply
    supply_low: bool | None = None  # supply of the computer; None if unknown
    processor_temperature_K: float | None = None
    age_s: float = 0.0  # filled in by a reader: how long ago this was written
    values: Values = Values()
    run: str = ""  # progress of the run that is being flown
    card: list[str] = []  # planned runs, and how many of each are flown
    reached: str = ""  # number of runs, speeds, and interval of power so far

    @property
    def failing(self) -> list[str]:
        """The sensors that do not work, listed by state: "imu, gps failed"."""
        by_state: dict[SensorState, list[str]] = {}
        for name, state in self.sensors.items():
            if state not in IN_ORDER:
                by_state.setdefault(state, []).append(name)
        return [f"{', '.join(names)} {state}" for state, names in by_state.items()]

    @property
    def grid_Hz(self) -> float:
        """The tray's rate, from the time since the first tick and the number of ticks, including missed ones."""
        return (self.ticks + self.missed - 1) / self.elapsed_s if self.elapsed_s > 0 else 0.0

    @property
    def late(self) -> list[str]:
        """Which samples were late or missed lately."""
        messages = []
        if self.rate_Hz < LEAST_RATE * self.grid_Hz:
            messages.append(f"{self.rate_Hz:.1f} of {self.grid_Hz:.1f} Hz")
        if self.recent_missed:
            messages.append(f"{ticks_missed(self.recent_missed)} in {RECENT_S:.0f} s")
        return messages

    @property
    def wrong(self) -> list[str]:
        """What the crew should know before the next run."""
        failing = ", ".join(self.failing)
        messages = [self.error, failing, *self.late, *self.slow, *self.implausible, *self.trouble]
        return [text for text in messages if text]

    @property
    def well(self) -> bool:
        """Whether there is nothing that the crew should know before the next run."""
        return self.state is not RecordingState.CARD_FULL and self.age_s <= NO_NEWS_S and not self.wrong

    @property
    def summary(self) -> str:
        """The state in one short line, for the ground station, the page and the log."""
        if self.age_s > NO_NEWS_S:
            return f"No news from the daemon for {self.age_s:.0f} s"
        if self.state is RecordingState.RECORDING:
            to = " to memory" if self.error else ""
            begin = f"recording{to} {self.elapsed_s / 60:.0f} min, {self.rate_Hz:.0f} Hz"
        else:
            begin = str(self.state)
        return f"{begin}: {'; '.join(self.wrong)}" if self.wrong else f"{begin}, all well" if self.well else begin

    @property
    def line(self) -> str:
        """The whole state in one line, for the terminal and systemd."""
        log = "to memory" if self.error or not self.log else self.log
        state = f"recording {log}" if self.state is RecordingState.RECORDING else str(self.state)
        free = "" if self.free_bytes is None else f", {self.free_bytes / 1e9:.1f} GB free"
        line = f"{state}, {self.elapsed_s:.0f} s, {self.ticks} ticks, {self.missed} missed{free}"
        return "; ".join([line, *(self.wrong or ["all well"])])

    @property
    def message(self) -> State:
        """The state as a message of the log."""
        return State(
            recording=self.state is RecordingState.RECORDING,
            well=self.well,
            rate_Hz=round(self.rate_Hz, 2),
            missed=self.missed,
            text=self.summary,
            run=self.run,
            supply_low=self.supply_low,
            processor_temperature_K=self.processor_temperature_K,
        )


class RunNews(msgspec.Struct, frozen=True, kw_only=True):
    """News of the runs as texts: verdicts, progress of the run being flown, the card, and the results so far."""

    verdicts: list[Event] = []
    progress: str = ""
    card: list[str] = []
    reached: str = ""


class PublishedEvent(msgspec.Struct, frozen=True, kw_only=True):
    """An event, and the time of its report by the system clock."""

    unix_s: float
    event: Event


class PublishedStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of the status file: the latest status and events, the latest event first."""

    status: RecordingStatus
    events: list[PublishedEvent]


class StatusFile:
    """Replaces a file with the latest status. The file must be on a file system in memory, such as /run."""

    def __init__(self, path: Path):
        self._path = path
        self._events: deque[PublishedEvent] = deque(maxlen=LATEST_EVENTS)
        self._failed = False

    def add(self, event: Event) -> None:
        self._events.appendleft(PublishedEvent(unix_s=time.time(), event=event))

    def write(self, status: RecordingStatus) -> None:
        """Replace the file. If it cannot be written, the recording continues without the page; stderr says so once."""
        beside = self._path.with_name(f"{self._path.name}.new")
        try:
            beside.write_bytes(msgspec.json.encode(PublishedStatus(status=status, events=list(self._events))))
            beside.replace(self._path)
        except OSError as error:
            if not self._failed:
                cause = error.strerror or error
                print_error(f"{self._path}: the status cannot be written ({cause}); recording goes on without it")
            self._failed = True
