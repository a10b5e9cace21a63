"""The sampling loop: reads every sensor once a tick. Ticks lie on an absolute time grid."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from flightpower.daq.bus_worker import bus_workers
from flightpower.daq.clock import Clock
from flightpower.daq.process_setup import computes_while_it_waits, use_every_processor, use_one_processor
from flightpower.daq.repeated_readings import InFlight
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import FIRST_UTC_NS, LAST_UTC_NS, Event, Gps, Tick, Time

TIME_EVERY_NS = 1_000_000_000
STARTING_NS = 5_000_000_000  # time to start the sensors, in which a late bus is no sign of trouble
DEADLINE_TICKS = 0.8  # deadline of the readings; the rest of the tick is for encoding them


class StopFlag(Protocol):
    """A flag that ends the loop when set: a `threading.Event`, or anything like it."""

    def is_set(self) -> bool: ...


class GridTick(NamedTuple):
    """One tick of the grid: its number, how late it began [ns], how many ticks were skipped just before it."""

    number: int
    late_ns: int
    missed: int


class Cycle(NamedTuple):
    """Everything that was read in one tick."""

    tick: GridTick
    now_ns: int  # monotonic time at which reading began
    samples: list[Sample]
    events: list[Event]
    slow: list[str] = []  # noqa: RUF012  what to do about buses that are too slow
    autopilot_system: int | None = None  # MAVLink system of the autopilot, once it has been heard


def grid_ticks(period_ns: int, clock: Clock, stop: StopFlag, until_ns: int | None = None) -> Iterator[GridTick]:
    """Yield ticks on a fixed grid that starts now. Missed ticks are counted and skipped, not made up for.

    until_ns: monotonic time of the end; a tick at exactly this time is not produced.
    """
    start_ns, number, missed = clock.now_ns(), 0, 0
    while not stop.is_set():
        due_ns = start_ns + number * period_ns
        if until_ns is not None and due_ns >= until_ns:
            return
        clock.sleep_until_ns(due_ns)
        yield GridTick(number, clock.now_ns() - due_ns, missed)
        following = max(number + 1, -((start_ns - clock.now_ns()) // period_ns))
        number, missed = following, following - number - 1


def cycles(
    supervisors: Sequence[SensorSupervisor],
    *,
    rate_Hz: float,
    clock: Clock,
    stop: StopFlag,
    until_ns: int | None = None,
    threaded: bool = False,
) -> Iterator[Cycle]:
    """Read all sensors at each tick. Every cycle ends with /daq/tick; /time is added once a second.

    threaded: separate threads read buses and ports within DEADLINE_TICKS; this needs a real clock. Readings that arrive
    later come with a later cycle and carry the number of their own tick.
    """
    time_due_ns = clock.now_ns()
    period_ns = round(1e9 / rate_Hz)
    gps_utc: tuple[int, int] | None = None  # (UTC, monotonic) of the latest solution with date and time
    # Only until a bus is late: the cause in the kernel may also hold up the other threads on that processor.
    devices = {supervisor.device for supervisor in supervisors if supervisor.blocking}
    one_processor = threaded and not any(map(computes_while_it_waits, devices)) and use_one_processor()
    workers = bus_workers(supervisors, clock, period_ns, threaded=threaded)
    flight, in_flight = InFlight(), False
    autopilots = [supervisor for supervisor in supervisors if "/attitude" in supervisor.topics]
    try:
        for tick in grid_ticks(period_ns, clock, stop, until_ns):
            begin_ns = clock.now_ns()
            deadline_ns = begin_ns - tick.late_ns + round(DEADLINE_TICKS * period_ns)
            samples: list[Sample] = []
            events: list[Event] = []
            durations: dict[str, int] = {}
            for worker in workers:
                worker.start_reading(tick.number)
            for worker in workers:
                readings = worker.collect(deadline_ns)
                samples += readings.samples
                events += readings.events
                durations |= readings.durations_ns
                if one_processor and worker.late and tick.number * period_ns > STARTING_NS:
                    one_processor = False
                    use_every_processor(whole_process=True)
            for topic, time_ns, solution, _ in samples:
                if isinstance(solution, Gps) and solution.utc_ns is not None:
                    if not FIRST_UTC_NS <= solution.utc_ns < LAST_UTC_NS:
                        solution.utc_ns = None
                    elif topic == "/gps":
                        gps_utc = (solution.utc_ns, time_ns)
            if flight.update(samples, begin_ns) is not in_flight:
                in_flight = not in_flight
                for supervisor in supervisors:
                    supervisor.in_flight = in_flight
            if begin_ns >= time_due_ns:
                time_due_ns += TIME_EVERY_NS * (1 + (begin_ns - time_due_ns) // TIME_EVERY_NS)
                samples.append(Sample("/time", clock.now_ns(), time_message(clock, gps_utc)))
            message = Tick(late_ns=tick.late_ns, missed=tick.missed, duration_ns=durations)
            samples.append(Sample("/daq/tick", begin_ns, message))
            slow = [worker.slow for worker in workers if worker.slow]
            systems = [autopilot.system_id for autopilot in autopilots]
            yield Cycle(tick, begin_ns, samples, events, slow, next(filter(None, systems), None))
    finally:
        if one_processor:
            use_every_processor(whole_process=True)


def time_message(clock: Clock, gps_utc: tuple[int, int] | None) -> Time:
    """One instant on every clock. GPS time is extrapolated from the latest solution; it lags by its latency."""
    now_ns = clock.now_ns()
    utc_ns = None if gps_utc is None else gps_utc[0] + now_ns - gps_utc[1]
    return Time(monotonic_ns=now_ns, system_ns=clock.unix_ns(), gps_utc_ns=utc_ns)
