"""Buses that hang, on a real clock: they cost their own data, and no tick of anybody else, also at 100 Hz."""

import errno
import os
import threading
import time

import pytest

from daq.clock import SystemClock
from daq.loop import turns
from daq.sensors import Sample
from daq.station import Station
from flight.messages import Imu, Rpm, Status

RATE_HZ = 100.0
TIMEOUT_S = 0.02  # what `LinuxI2C` bounds a transfer to: two ticks at 100 Hz


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


def time_out():
    time.sleep(TIMEOUT_S)
    raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))


def run(act, ticks=150):
    """Two parts on a bus and one on a port; `act` is told each tick before its turn. Statuses by topic and tick."""
    imu, baro, rpm = Part("/imu", Imu), Part("/mag", Imu), Part("/rpm", Rpm)
    places = [
        Station("imu", "i2c-1", ("/imu",), lambda: imu, may_hang=True),
        Station("rpm", "tty", ("/rpm",), lambda: rpm),
        Station("mag", "i2c-1", ("/mag",), lambda: baro, may_hang=True),
    ]
    clock = SystemClock()
    found = []
    until_ns = clock.now_ns() + round(ticks / RATE_HZ * 1e9)
    for turn in turns(places, rate_Hz=RATE_HZ, clock=clock, stop=threading.Event(), until_ns=until_ns, watched=True):
        found.append(turn)
        act(turn.beat.number + 1, imu, rpm)
    return found


def statuses(found, topic):
    return [s.message.status for turn in found for s in turn.samples if s.topic == topic]


def assert_no_tick_was_lost(found):
    """On a machine with other work a tick may come late and the next be skipped: not for as long as a timeout."""
    assert sum(turn.beat.missed for turn in found) <= 1
    assert set(statuses(found, "/rpm")) == {Status.OK}
    assert all(len([s for s in turn.samples if s.topic == topic]) == 1 for turn in found for topic in ("/imu", "/mag"))


def test_what_a_line_brings_late_is_logged_late_and_once():
    """A line that holds up its reader for five ticks: its next reading comes after them, with its own time."""

    def act(number, imu, rpm):
        rpm.trouble = (lambda: time.sleep(0.05)) if number == 50 else lambda: None

    found = run(act, ticks=80)
    assert sum(turn.beat.missed for turn in found) <= 1
    assert set(statuses(found, "/imu")) == {Status.OK}
    per_tick = [[s.time_ns for s in turn.samples if s.topic == "/rpm"] for turn in found]
    times_ns = [time_ns for times in per_tick for time_ns in times]
    assert times_ns == sorted(set(times_ns))
    held = next(i for i in range(45, 60) if not per_tick[i])
    late = next(i for i in range(held, 70) if len(per_tick[i]) == 2)
    assert 4 <= late - held <= 6
    assert per_tick[late][0] - found[held].now_ns < 5e6  # begun in the tick in which it was asked for


def test_a_timeout_longer_than_a_tick_costs_no_tick():
    def act(number, imu, rpm):
        imu.trouble = time_out if 50 <= number < 100 else lambda: None

    found = run(act)
    assert_no_tick_was_lost(found)
    assert set(statuses(found, "/imu")[52:99]) == {Status.TIMEOUT}
    assert set(statuses(found, "/imu")[110:]) == {Status.OK} == set(statuses(found, "/mag")[110:])


def test_a_bus_that_never_returns_is_told_and_left_alone():
    release = threading.Event()

    def act(number, imu, rpm):
        if number == 20:
            imu.trouble = lambda: release.wait(10)
        if number == 100:
            imu.trouble = lambda: None
            release.set()

    found = run(act)
    assert_no_tick_was_lost(found)
    assert set(statuses(found, "/imu")[22:100]) == {Status.TIMEOUT}
    assert statuses(found, "/imu")[-1] is Status.OK
    texts = [event.text for turn in found for event in turn.events]
    assert "i2c-1 hangs: it gave no answer for 0.5 s" in texts and "i2c-1 answers again" in texts


@pytest.mark.parametrize("topic", ["/imu", "/mag", "/rpm"])
def test_a_healthy_tray_gives_every_sensor_at_every_tick(topic):
    found = run(lambda number, imu, rpm: None, ticks=50)
    assert statuses(found, topic) == [Status.OK] * len(found)
