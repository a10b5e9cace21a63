"""Buses and serial lines that hang, on a real clock, cost their own data and no tick of other sensors.

That the loop does not wait for them is shown without measuring time: a read that hangs returns only after the loop has
done further ticks. Lateness and missed ticks also depend on the machine: `benchmarks/daemon.py soak` measures them.
"""

import errno
import os
import threading

import pytest

from flightpower.daq import sampling_loop
from flightpower.daq.clock import SystemClock
from flightpower.daq.process_setup import PROCESSORS
from flightpower.daq.sampling_loop import cycles
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import Imu, Rpm, Status

RATE_HZ = 50.0
GIVE_UP_S = 60.0  # a read hangs for as long as this only if the loop waits for it


@pytest.fixture(autouse=True)
def real_time():
    """Use the real-time priority of the systemd unit, if permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except PermissionError:
        yield
        return
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Part:
    """Answers at once, unless `trouble` hangs or raises."""

    def __init__(self, topic, message):
        self.topic, self.message = topic, message
        self.trouble = lambda: None

    def start(self):
        yield from ()

    def read(self, now_ns):
        self.trouble()
        return [Sample(self.topic, now_ns, self.message())]


class Ticks:
    """Holds the number of the loop's latest tick."""

    def __init__(self):
        self._number, self._changed = 0, threading.Condition()
        self.gave_up = 0

    def tell(self, number):
        with self._changed:
            self._number = number
            self._changed.notify_all()

    def outlast(self, count):
        """Hang until the loop has done `count` more ticks."""
        with self._changed:
            until = self._number + count
            patience_s = 0.0 if self.gave_up else GIVE_UP_S
            self.gave_up += not self._changed.wait_for(lambda: self._number >= until, patience_s)


def run(act, ticks=150):
    """Run two parts on a bus and one on a line; `act` is called before each tick. Returns the cycles by tick number."""
    imu, baro, rpm = Part("/imu", Imu), Part("/mag", Imu), Part("/rpm", Rpm)
    supervisors = [
        SensorSupervisor("imu", "i2c-1", ("/imu",), lambda: imu, blocking=True),
        SensorSupervisor("rpm", "tty", ("/rpm",), lambda: rpm),
        SensorSupervisor("mag", "i2c-1", ("/mag",), lambda: baro, blocking=True),
    ]
    clock, progress = SystemClock(), Ticks()
    result = {}
    until_ns = clock.now_ns() + round(ticks / RATE_HZ * 1e9)
    for cycle in cycles(
        supervisors, rate_Hz=RATE_HZ, clock=clock, stop=threading.Event(), until_ns=until_ns, threaded=True
    ):
        result[cycle.tick.number] = cycle
        progress.tell(cycle.tick.number)
        act(cycle.tick.number + 1, imu, rpm, progress)
    assert not progress.gave_up
    assert sum(cycle.tick.missed for cycle in result.values()) == max(result) + 1 - len(result)
    return result


@pytest.mark.skipif(len(PROCESSORS) < 2, reason="there is one processor only")
def test_threads_share_a_processor_until_a_bus_is_late(monkeypatch):
    """This needs real-time priority. A bus that is late may keep its processor busy while the others go on
    elsewhere."""
    if os.sched_getscheduler(0) != os.SCHED_FIFO:
        pytest.skip("no real-time priority here")
    monkeypatch.setattr(sampling_loop, "STARTING_NS", 0)
    processors = {}

    def act(number, imu, rpm, ticks):
        imu.trouble = (lambda: ticks.outlast(2)) if number == 20 else (lambda: None)
        threads = [thread.native_id for thread in threading.enumerate() if thread.name.startswith("bus worker i2c-1")]
        processors[number] = [os.sched_getaffinity(thread) for thread in (0, threads[-1])]

    run(act, ticks=40)
    assert processors[10] == [{max(PROCESSORS)}] * 2 and processors[30] == [PROCESSORS] * 2
    run(lambda *_: None, ticks=5)
    assert os.sched_getaffinity(0) == PROCESSORS


def of_tick(result, topic):
    """The messages of a topic by the tick that they belong to, whenever they came."""
    messages = {}
    for number, cycle in result.items():
        for sample in cycle.samples:
            if sample.topic == topic:
                messages.setdefault(number if sample.tick is None else sample.tick, []).append(sample)
    return messages


def in_order_of_ticks(result, topic):
    """Whether the messages of a topic were logged in the order of their ticks."""
    ticks = [
        number if sample.tick is None else sample.tick
        for number, cycle in result.items()
        for sample in cycle.samples
        if sample.topic == topic
    ]
    return ticks == sorted(ticks)


def statuses(result, topic, begin=0, end=10**9):
    messages = of_tick(result, topic)
    return [s.message.status for number in sorted(messages) if begin <= number < end for s in messages[number]]


def assert_each_tick_has_its_message(result, topics=("/imu", "/mag")):
    """The last ticks are excepted, since their answers may come after the end."""
    for topic in topics:
        messages = of_tick(result, topic)
        assert all(len(each) == 1 for each in messages.values())
        assert set(messages) <= set(result) and set(list(result)[:-2]) <= set(messages)


def test_late_readings_of_a_line_are_logged_late_and_once():
    """A line holds up its reader for five ticks; its next reading comes after them, with its own time."""

    asked_at = []

    def act(number, imu, rpm, progress):
        hang = number >= 50 and not asked_at
        rpm.trouble = (lambda: progress.outlast(5)) if hang else lambda: None
        asked_at.extend([number] * hang)

    result = run(act, ticks=80)
    assert_each_tick_has_its_message(result)
    times_ns = {number: [s.time_ns for s in cycle.samples if s.topic == "/rpm"] for number, cycle in result.items()}
    in_order = [time_ns for times in times_ns.values() for time_ns in times]
    assert in_order == sorted(set(in_order))
    numbers = list(result)
    request = next(number for number in numbers if number >= asked_at[0])
    came = next(number for number in numbers if number > request and times_ns[number])
    after = numbers[numbers.index(request) + 1]
    assert not any(times_ns[number] for number in numbers if request <= number < came) and came >= request + 5
    assert result[request].now_ns <= times_ns[came][0] < result[after].now_ns


def test_a_transfer_longer_than_a_tick_costs_no_tick():
    def act(number, imu, rpm, progress):
        def time_out():
            progress.outlast(3)
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

        imu.trouble = time_out if 50 <= number < 100 else lambda: None

    result = run(act)
    assert_each_tick_has_its_message(result)
    assert set(statuses(result, "/imu", 51, 99)) == {Status.TIMEOUT}
    hung = any("hangs" in event.text for cycle in result.values() for event in cycle.events)  # on a busy machine
    assert hung or in_order_of_ticks(result, "/imu"), "the answer owed to a tick comes before the timeouts after it"
    assert Status.OK in statuses(result, "/imu", 110) and Status.OK in statuses(result, "/mag", 110)
    assert set(statuses(result, "/rpm")) == {Status.OK}


def test_a_bus_that_hangs_is_reported_and_not_read_until_it_returns():
    release = threading.Event()

    def act(number, imu, rpm, progress):
        if number >= 20:
            imu.trouble = lambda: release.wait(GIVE_UP_S)
        if number >= 100:
            imu.trouble = lambda: None
            release.set()

    result = run(act)
    assert_each_tick_has_its_message(result)
    assert set(statuses(result, "/imu", 22, 100)) == {Status.TIMEOUT}
    assert Status.OK in statuses(result, "/imu", 102)
    assert set(statuses(result, "/rpm")) == {Status.OK}
    texts = [event.text for cycle in result.values() for event in cycle.events]
    assert "i2c-1 hangs: no answer for 0.5 s" in texts and "i2c-1 answers again" in texts


def test_a_healthy_tray_is_read_in_the_order_of_its_bus():
    result = run(lambda number, imu, rpm, progress: None, ticks=50)
    assert_each_tick_has_its_message(result)
    for topic in ("/imu", "/mag", "/rpm"):
        assert Status.OK in statuses(result, topic)
        assert set(statuses(result, topic)) <= {Status.OK, Status.TIMEOUT}  # a busy machine may hold up a bus
    for cycle in result.values():
        assert [s.topic for s in cycle.samples if s.topic in ("/imu", "/mag")] == ["/imu", "/mag"]
