"""The grid of ticks, a sensor's life in the loop, and what is told about it; all on a clock moved by hand."""

import errno
import threading

import pytest
from scripted_parts import HandClock

from daq.health import Health, State
from daq.loop import every, turns
from daq.sensors import Sample, SensorFailure
from daq.station import Station
from flight.messages import Gps, Imu, Magnetometer, Rpm, Status

TICK_NS = 40_000_000


class Sensor:
    """Reads well, unless `trouble` is set; costs `cost_ns` on the clock."""

    def __init__(self, clock: HandClock, message=Imu, topic="/imu", cost_ns=0):
        self.clock, self.message, self.topic, self.cost_ns = clock, message, topic, cost_ns
        self.trouble: Exception | None = None
        self.started = 0
        self.waits: tuple[float, ...] = ()

    def start(self):
        self.started += 1
        yield from self.waits

    def read(self, now_ns):
        self.clock.ns += self.cost_ns
        if self.trouble is not None:
            raise self.trouble
        return [Sample(self.topic, now_ns, self.message())]


def beats(clock, count, stop=None, until_ns=None):
    """The first `count` beats; the caller acts between them."""
    ticker = every(TICK_NS, clock, stop or threading.Event(), until_ns)
    for _, beat in zip(range(count), ticker, strict=False):
        yield beat


def test_the_grid_does_not_drift():
    clock = HandClock()
    start_ns = clock.ns
    for beat in beats(clock, 1000):
        assert clock.ns == start_ns + beat.number * TICK_NS
        clock.ns += 7_654_321  # work


def test_a_stall_costs_the_ticks_it_lasted_and_is_not_made_up_for():
    clock = HandClock()
    start_ns = clock.ns
    seen = []
    for beat in beats(clock, 4):
        seen.append(beat)
        if beat.number == 1:
            clock.ns += 3 * TICK_NS + 1
    assert [(beat.number, beat.missed) for beat in seen] == [(0, 0), (1, 0), (5, 3), (6, 0)]
    assert clock.ns == start_ns + 6 * TICK_NS


def test_lateness_is_what_the_clock_woke_us_too_late():
    clock = HandClock()
    plain = clock.sleep_until_ns
    clock.sleep_until_ns = lambda due_ns: plain(due_ns + 250_000)
    assert [beat.late_ns for beat in beats(clock, 3)] == [250_000] * 3


def test_the_loop_ends_when_told_and_at_the_given_time():
    clock, stop = HandClock(), threading.Event()
    assert len(list(every(TICK_NS, clock, stop, clock.ns + 10 * TICK_NS))) == 10
    stop.set()
    assert list(every(TICK_NS, clock, stop)) == []


def station(sensor, lane="bus", name="imu"):
    return Station(name, lane, (sensor.topic,), lambda: sensor)


def statuses(place, clock, ticks):
    found = []
    for _ in range(ticks):
        found += [sample.message.status for sample in place.turn(clock.ns)]
        clock.ns += TICK_NS
    return found


def test_bringing_up_waits_without_holding_up_the_loop():
    clock = HandClock()
    sensor = Sensor(clock)
    sensor.waits = (0.1, 0.05)
    before_ns = clock.ns
    assert statuses(station(sensor), clock, 7) == [Status.STARTING] * 5 + [Status.OK] * 2
    assert clock.ns == before_ns + 7 * TICK_NS  # turns took no time


@pytest.mark.parametrize(
    ("trouble", "status"),
    [
        (OSError(errno.EREMOTEIO, ""), Status.NO_REPLY),
        (OSError(errno.ENXIO, ""), Status.NO_REPLY),
        (OSError(errno.ETIMEDOUT, ""), Status.TIMEOUT),
        (SensorFailure(Status.WRONG_DEVICE, "another part"), Status.WRONG_DEVICE),
        (ZeroDivisionError("a driver's mistake"), Status.FAULT),
    ],
)
def test_a_failure_is_logged_with_null_values_and_the_sensor_comes_back(trouble, status):
    clock = HandClock()
    sensor = Sensor(clock)
    place = station(sensor)
    assert statuses(place, clock, 3) == [Status.OK] * 3
    sensor.trouble = trouble
    failed = [place.turn(clock.ns + i * TICK_NS)[0].message for i in range(20)]
    clock.ns += 20 * TICK_NS
    assert failed == [Imu(status=status)] * 20
    assert sensor.started > 1
    sensor.trouble = None
    assert Status.OK in statuses(place, clock, 25)  # a second


def test_a_glitch_of_one_transfer_costs_one_reading_and_no_new_start():
    clock = HandClock()
    sensor = Sensor(clock)
    place = station(sensor)
    statuses(place, clock, 3)
    sensor.trouble = OSError(errno.EREMOTEIO, "")
    assert statuses(place, clock, 1) == [Status.NO_REPLY]
    sensor.trouble = None
    assert statuses(place, clock, 3) == [Status.OK] * 3
    assert sensor.started == 1


def test_a_port_that_cannot_be_opened_is_tried_again():
    clock = HandClock()
    sensor = Sensor(clock)
    there = False

    def make():
        if not there:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory", "/dev/ttyUSB0")
        return sensor

    place = Station("rpm", "/dev/ttyUSB0", ("/rpm",), make)
    assert "/dev/ttyUSB0" in place.open(clock.ns)
    assert set(statuses(place, clock, 20)) == {Status.NO_REPLY}
    there = True
    assert Status.OK in statuses(place, clock, 14)


def run(clock, places, ticks, act=lambda number: None):
    end_ns = clock.ns + ticks * TICK_NS
    found = []
    for turn in turns(places, rate_Hz=25, clock=clock, stop=threading.Event(), until_ns=end_ns):
        found.append(turn)
        act(turn.beat.number + 1)
    return found


def test_a_dead_sensor_costs_its_own_data_only():
    clock = HandClock()
    good, dead = Sensor(clock, Magnetometer, "/mag"), Sensor(clock)
    dead.trouble = OSError(errno.EREMOTEIO, "")
    found = run(clock, [station(dead), station(good, name="mag")], 50)
    assert [t.beat.missed for t in found] == [0] * 50
    assert all(s.message.status is Status.OK for t in found for s in t.samples if s.topic == "/mag")


def test_a_hanging_bus_is_tried_once_a_tick_and_other_buses_keep_their_ticks():
    clock = HandClock()
    hanging = [Sensor(clock, topic=topic, cost_ns=20_000_000) for topic in ("/imu", "/baro", "/static")]
    for sensor in hanging:
        sensor.trouble = OSError(errno.ETIMEDOUT, "")
    other = Sensor(clock, Rpm, "/rpm", cost_ns=1_000_000)
    places = [station(sensor, name=sensor.topic) for sensor in hanging] + [station(other, lane="tty", name="rpm")]
    found = run(clock, places, 50)
    assert sum(t.beat.missed for t in found) == 0
    assert max(t.beat.late_ns for t in found) == 0
    assert sum(s.topic == "/rpm" and s.message.status is Status.OK for t in found for s in t.samples) == 50
    assert {s.message.status for t in found for s in t.samples if s.topic == "/baro"} == {Status.TIMEOUT}


def test_each_turn_says_how_long_every_sensor_took():
    clock = HandClock()
    found = run(clock, [station(Sensor(clock, cost_ns=3_000_000))], 3)
    ticks = [sample.message for turn in found for sample in turn.samples if sample.topic == "/daq/tick"]
    assert [tick.duration_ns for tick in ticks] == [{"imu": 3_000_000}] * 3


def test_time_is_paired_once_a_second_and_a_jump_of_the_system_clock_stays_in_there():
    clock = HandClock()
    gps = Sensor(clock, lambda: Gps(utc_ns=1_463_218_201_000_000_000 + clock.ns), "/gps")

    def jump(number):
        if number == 50:
            clock.unix_offset_ns += 10**18

    found = run(clock, [station(gps, name="gps")], 100, jump)
    times = [sample.message for turn in found for sample in turn.samples if sample.topic == "/time"]
    assert len(times) == 4
    assert times[2].system_ns - times[1].system_ns == 10**18 + 10**9
    assert times[2].monotonic_ns - times[1].monotonic_ns == 10**9
    assert all(time.gps_utc_ns - time.monotonic_ns == 1_463_218_201_000_000_000 for time in times)


def test_events_tell_of_failure_and_recovery_once():
    clock = HandClock()
    sensor = Sensor(clock)

    def act(number):
        if number == 25:
            sensor.trouble = OSError(errno.EREMOTEIO, "Remote I/O error")
        if number == 500:
            sensor.trouble = None

    events = [event for turn in run(clock, [station(sensor)], 700, act) for event in turn.events]
    assert [event.severity for event in events] == ["info", "error", "info"]
    assert events[1].text == "imu failed: Remote I/O error"
    assert events[2].text == "imu works"


def test_a_flapping_sensor_does_not_flood_the_log():
    health = Health("imu")
    events = []
    for tick in range(25 * 60):  # a minute, changing every second
        now_ns = tick * TICK_NS
        good = tick // 25 % 2 == 0
        event = health.read([Status.OK], now_ns) if good else health.failed("Remote I/O error", now_ns)
        events += [event] if event else []
    assert 2 < len(events) <= 60 / 5 + 1
    assert "changes since" in events[-1].text


def test_a_sensor_that_only_says_stale_is_degraded_not_failed():
    health = Health("probe-alpha")
    health.read([Status.OK], 0)
    events = [health.read([Status.STALE], tick * TICK_NS) for tick in range(1, 300)]
    assert health.state is State.DEGRADED
    assert [event.severity for event in events if event] == ["warning"]


def test_parts_may_be_deaf_at_power_on_without_anybody_being_told():
    health = Health("imu")
    assert [health.failed("Remote I/O error", i * 500_000_000) for i in range(4)] == [None] * 4
    assert health.failed("Remote I/O error", 2_500_000_000).severity == "error"
