"""Reads the sensors of one bus, or of the serial ports, one after another, without holding up the other buses.

A transfer on a hanging bus takes as long as its timeout, which is longer than a tick at 100 Hz, and a faulty bus driver
in the kernel may take longer than its timeout. Even a non-blocking read of a serial line can take 300 ms on a busy
machine. Therefore buses and ports are read in separate threads, which mostly wait for I/O. Readings that have not
arrived by the deadline are returned in a later tick, with the number of the tick in which their read began. No new read
of that bus begins until the pending one has returned; in each tick skipped for this reason all sensors of the bus time
out.
"""

import threading
from collections.abc import Sequence
from typing import NamedTuple

from flightpower.daq.bus_load import BusLoad
from flightpower.daq.clock import Clock
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import Event

HANG_REPORT_NS = 500_000_000  # a bus that has not returned for this long is reported as hanging


class BusReadings(NamedTuple):
    """The readings of one bus, or of the ports, in one tick."""

    samples: list[Sample]
    events: list[Event]
    durations_ns: dict[str, int]  # by sensor


# A read that follows a late one may still begin up to this share of a tick before the deadline. So a bus that is busy
# for nine tenths of each tick catches up within a few ticks, and none of its sensors misses a tick.
LATEST_START = 0.5
NO_READINGS = BusReadings([], [], {})


class BusWorker:
    """Reads its sensors in order, in the caller's thread. After a timeout the other sensors on that bus are skipped."""

    def __init__(self, supervisors: Sequence[SensorSupervisor], clock: Clock, period_ns: int):
        self.name = ", ".join(dict.fromkeys(supervisor.device for supervisor in supervisors))
        self._supervisors = supervisors
        self._clock = clock
        self._load = BusLoad(self.name, period_ns)

    @property
    def slow(self) -> str:
        """Advice if the bus is too slow for the rate; otherwise empty."""
        return self._load.slow

    @property
    def late(self) -> bool:
        """Whether this tick's readings have missed the deadline."""
        return False

    def start_reading(self, tick: int) -> None:
        """Start reading for this tick if reading runs in another thread."""

    def collect(self, deadline_ns: int) -> BusReadings:
        """Return this tick's readings. Only workers with a thread keep `deadline_ns` (monotonic)."""
        return self._with_load(self._read())

    def _with_load(self, readings: BusReadings) -> BusReadings:
        """The readings, with an event if the bus turns out to be slow. Readings with a timeout are not counted."""
        for supervisor in self._supervisors:
            if supervisor.timed_out:
                return readings
        events = self._load.add(readings.durations_ns)
        return readings._replace(events=readings.events + events) if events else readings

    def _read(self) -> BusReadings:
        samples: list[Sample] = []
        events: list[Event] = []
        durations: dict[str, int] = {}
        begin_ns = self._clock.now_ns()
        hung: list[str] = []
        for supervisor in self._supervisors:
            if hung and supervisor.device in hung:
                samples += supervisor.skip(begin_ns)
                continue
            samples += supervisor.read(begin_ns)
            if supervisor.timed_out:
                hung.append(supervisor.device)
            if supervisor.events:
                events += supervisor.events
                supervisor.events.clear()
            end_ns = self._clock.now_ns()
            durations[supervisor.name] = end_ns - begin_ns
            begin_ns = end_ns
        return BusReadings(samples, events, durations)


class ThreadedBusWorker(BusWorker):
    """Reads in a separate thread, for a real clock: `collect` keeps its deadline even if the bus hangs.

    blocking: whether a read waits for the sensors to reply, as on a bus. A tick that begins while an earlier read is
    pending is then skipped, and logged as a timeout. If False (serial ports), a read returns only what has arrived.
    """

    def __init__(self, supervisors: Sequence[SensorSupervisor], clock: Clock, period_ns: int, *, blocking: bool):
        super().__init__(supervisors, clock, period_ns)
        self._blocking = blocking
        self._latest_start_ns = round(LATEST_START * period_ns)  # time before the deadline
        self._start_signal, self._done_signal = (
            threading.Lock(),
            threading.Lock(),
        )  # a signal: acquire waits for it, release sends it
        self._start_signal.acquire()
        self._done_signal.acquire()
        self._busy = False  # a read that missed its deadline has not returned yet
        self._started_ns = 0
        self._tick = self._started_tick = 0  # the current tick, and the tick of the latest read
        self._result = NO_READINGS
        self._late_readings = NO_READINGS
        self._skipped_samples: list[Sample] = []  # of skipped ticks; logged after the late readings
        self._hang_reported = False
        self._thread = threading.Thread(target=self._work, name=f"bus worker {self.name}", daemon=True)
        self._thread.start()

    @property
    def late(self) -> bool:
        return self._busy

    def start_reading(self, tick: int) -> None:
        self._tick = tick
        if self._busy and self._done_signal.acquire(blocking=False):
            self._take_late_readings()
        if not self._busy:
            self._start()

    def _start(self) -> None:
        self._started_ns, self._started_tick = self._clock.now_ns(), self._tick
        self._start_signal.release()

    def _done_by(self, end_ns: int) -> bool:
        """Wait for the read to end, but no longer than until `end_ns`. Returns whether it has ended."""
        return self._done_signal.acquire(timeout=max(0.0, (end_ns - self._clock.now_ns()) / 1e9))

    def collect(self, deadline_ns: int) -> BusReadings:
        if self._busy and self._blocking and self._done_by(deadline_ns - self._latest_start_ns):
            self._take_late_readings()
            self._start()
        late, self._late_readings = self._late_readings, NO_READINGS
        if not self._busy and self._done_by(deadline_ns):
            result = self._measured(self._result)
            if late is NO_READINGS:
                return result
            return BusReadings(late.samples + result.samples, late.events + result.events, result.durations_ns)
        self._busy = True
        now_ns = self._clock.now_ns()
        hangs = now_ns - self._started_ns > HANG_REPORT_NS
        samples, events = late.samples, late.events
        if hangs and not self._hang_reported:
            self._hang_reported = True
            text = f"{self.name} hangs: no answer for 0.5 s"
            events = [*events, Event(severity="error", sensor="daq", text=text)]
        if (self._blocking or hangs) and self._started_tick != self._tick:
            skipped = [sample for supervisor in self._supervisors for sample in supervisor.skip(now_ns)]
            self._skipped_samples += [sample._replace(tick=self._tick) for sample in skipped]
        if hangs:
            samples = samples + self._skipped_samples
            self._skipped_samples = []
        return BusReadings(samples, events, {})

    def _take_late_readings(self) -> None:
        """Collect a read that returned after its deadline."""
        self._busy = False
        result = self._measured(self._result)
        events = result.events
        if self._hang_reported:
            self._hang_reported = False
            events = [*events, Event(sensor="daq", text=f"{self.name} answers again")]
        samples = [sample._replace(tick=self._started_tick) for sample in result.samples] + self._skipped_samples
        self._skipped_samples = []
        self._late_readings = BusReadings(samples, events, {})

    def _measured(self, readings: BusReadings) -> BusReadings:
        return self._with_load(readings) if self._blocking else readings

    def _work(self) -> None:
        while True:
            self._start_signal.acquire()
            self._result = self._read()
            self._done_signal.release()


def bus_workers(
    supervisors: Sequence[SensorSupervisor], clock: Clock, period_ns: int, *, threaded: bool
) -> list[BusWorker]:
    """Workers for all sensors, in the sensors' order. threaded: a thread for each bus, and one for all ports."""
    if not threaded:
        return [BusWorker(group, clock, period_ns) for group in _by_device(supervisors)]
    buses = _by_device([supervisor for supervisor in supervisors if supervisor.blocking])
    ports = [supervisor for supervisor in supervisors if not supervisor.blocking]
    workers = [ThreadedBusWorker(group, clock, period_ns, blocking=True) for group in buses]
    return [*workers, *([ThreadedBusWorker(ports, clock, period_ns, blocking=False)] if ports else [])]


def _by_device(supervisors: Sequence[SensorSupervisor]) -> list[list[SensorSupervisor]]:
    devices = dict.fromkeys(supervisor.device for supervisor in supervisors)
    return [[supervisor for supervisor in supervisors if supervisor.device == device] for device in devices]
