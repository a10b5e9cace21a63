"""Buses and lines that hang, on a real clock: they cost their own data, and no tick of anybody else.

That nobody waits for them is shown without a stopwatch: what hangs comes back only after ticks have gone by meanwhile.
How late ticks are, and that none is missed, is a matter of the machine too: `benchmarks/daemon.py soak` measures it.
"""

import errno
import os
import threading

import pytest

from daq.clock import SystemClock
from daq.loop import turns
from daq.sensors import Sample
from daq.station import Station
from flight.messages import Imu, Rpm, Status

RATE_HZ = 50.0
IN_VAIN_S = 10.0  # something hangs for as long as this only if the loop waits for it


@pytest.fixture(autouse=True)
def real_time():
    """As the unit runs it: ahead of what else this machine does. Without the right to, as good as it goes."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except PermissionError:
        yield
        return
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Part:
    """Answers at once, or as `trouble` says."""

    def __init__(self, topic, message):
        self.topic, self.message = topic, message
        self.trouble = lambda: None

    def start(self):
        yield from ()

    def read(self, now_ns):
        self.trouble()
        return [Sample(self.topic, now_ns, self.message())]


class Ticks:
    """How far the loop is."""

    def __init__(self):
        self._number, self._changed = 0, threading.Condition()
        self.waited_in_vain = 0

    def tell(self, number):
        with self._changed:
            self._number = number
            self._changed.notify_all()

    def outlast(self, count):
        """Hang until the loop has done `count` more ticks."""
        with self._changed:
            until = self._number + count
            patience_s = 0.0 if self.waited_in_vain else IN_VAIN_S
            self.waited_in_vain += not self._changed.wait_for(lambda: self._number >= until, patience_s)


def run(act, ticks=150):
    """Two parts on a bus and one on a line; `act` is told each tick before its turn. The turns, by their number."""
    imu, baro, rpm = Part("/imu", Imu), Part("/mag", Imu), Part("/rpm", Rpm)
    places = [
        Station("imu", "i2c-1", ("/imu",), lambda: imu, may_hang=True),
        Station("rpm", "tty", ("/rpm",), lambda: rpm),
        Station("mag", "i2c-1", ("/mag",), lambda: baro, may_hang=True),
    ]
    clock, progress = SystemClock(), Ticks()
    found = {}
    until_ns = clock.now_ns() + round(ticks / RATE_HZ * 1e9)
    for turn in turns(places, rate_Hz=RATE_HZ, clock=clock, stop=threading.Event(), until_ns=until_ns, watched=True):
        found[turn.beat.number] = turn
        progress.tell(turn.beat.number)
        act(turn.beat.number + 1, imu, rpm, progress)
    assert not progress.waited_in_vain
    assert sum(turn.beat.missed for turn in found.values()) == max(found) + 1 - len(found)
    return found


def statuses(found, topic, begin=0, end=10**9):
    turns_between = (turn for number, turn in found.items() if begin <= number < end)
    return [s.message.status for turn in turns_between for s in turn.samples if s.topic == topic]


def assert_each_tick_has_its_message(found, topics=("/imu", "/mag")):
    assert all([s.topic for s in turn.samples].count(topic) == 1 for turn in found.values() for topic in topics)


def test_what_a_line_brings_late_is_logged_late_and_once():
    """A line that holds up its reader for five ticks: its next reading comes after them, with its own time."""

    asked_at = []

    def act(number, imu, rpm, progress):
        hang = number >= 50 and not asked_at
        rpm.trouble = (lambda: progress.outlast(5)) if hang else lambda: None
        asked_at.extend([number] * hang)

    found = run(act, ticks=80)
    assert_each_tick_has_its_message(found)
    times_ns = {number: [s.time_ns for s in turn.samples if s.topic == "/rpm"] for number, turn in found.items()}
    in_order = [time_ns for times in times_ns.values() for time_ns in times]
    assert in_order == sorted(set(in_order))
    numbers = list(found)
    asked = next(number for number in numbers if number >= asked_at[0])
    came = next(number for number in numbers if number > asked and times_ns[number])
    after = numbers[numbers.index(asked) + 1]
    assert not any(times_ns[number] for number in numbers if asked <= number < came) and came >= asked + 5
    assert found[asked].now_ns <= times_ns[came][0] < found[after].now_ns


def test_a_transfer_longer_than_a_tick_costs_no_tick():
    def act(number, imu, rpm, progress):
        def time_out():
            progress.outlast(3)
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

        imu.trouble = time_out if 50 <= number < 100 else lambda: None

    found = run(act)
    assert_each_tick_has_its_message(found)
    assert set(statuses(found, "/imu", 51, 99)) == {Status.TIMEOUT}
    assert Status.OK in statuses(found, "/imu", 110) and Status.OK in statuses(found, "/mag", 110)
    assert set(statuses(found, "/rpm")) == {Status.OK}


def test_a_bus_that_never_returns_is_told_and_left_alone():
    release = threading.Event()

    def act(number, imu, rpm, progress):
        if number >= 20:
            imu.trouble = lambda: release.wait(IN_VAIN_S)
        if number >= 100:
            imu.trouble = lambda: None
            release.set()

    found = run(act)
    assert_each_tick_has_its_message(found)
    assert set(statuses(found, "/imu", 22, 100)) == {Status.TIMEOUT}
    assert Status.OK in statuses(found, "/imu", 102)
    assert set(statuses(found, "/rpm")) == {Status.OK}
    texts = [event.text for turn in found.values() for event in turn.events]
    assert "i2c-1 hangs: it gave no answer for 0.5 s" in texts and "i2c-1 answers again" in texts


def test_a_healthy_tray_is_read_in_the_order_of_its_bus():
    found = run(lambda number, imu, rpm, progress: None, ticks=50)
    assert_each_tick_has_its_message(found)
    for topic in ("/imu", "/mag", "/rpm"):
        assert Status.OK in statuses(found, topic)
        assert set(statuses(found, topic)) <= {Status.OK, Status.TIMEOUT}  # a busy machine may hold up a bus
    for turn in found.values():
        assert [s.topic for s in turn.samples if s.topic in ("/imu", "/mag")] == ["/imu", "/mag"]
