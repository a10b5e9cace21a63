"""The grid of ticks, sensors that start and fail in the loop, and the reports on them, on a simulated clock."""

import errno
import threading

import pytest
from scripted_parts import HandClock

from flightpower.daq import sampling_loop
from flightpower.daq.bus_worker import NO_READINGS
from flightpower.daq.missed_ticks import MissedTicks
from flightpower.daq.sampling_loop import GridTick, cycles, grid_ticks, time_message
from flightpower.daq.sensor_health import SensorHealth, SensorState
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample, SensorFailure
from flightpower.flight.messages import Gps, Imu, Magnetometer, Rpm, Status

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


def first_ticks(clock, count, stop=None, until_ns=None):
    """The first `count` ticks; the caller acts between them."""
    ticker = grid_ticks(TICK_NS, clock, stop or threading.Event(), until_ns)
    for _, tick in zip(range(count), ticker, strict=False):
        yield tick


def test_the_grid_does_not_drift():
    clock = HandClock()
    start_ns = clock.ns
    for tick in first_ticks(clock, 1000):
        assert clock.ns == start_ns + tick.number * TICK_NS
        clock.ns += 7_654_321  # work


def test_a_stall_costs_the_ticks_it_lasted_and_is_not_made_up_for():
    clock = HandClock()
    start_ns = clock.ns
    seen = []
    for tick in first_ticks(clock, 4):
        seen.append(tick)
        if tick.number == 1:
            clock.ns += 3 * TICK_NS + 1
    assert [(tick.number, tick.missed) for tick in seen] == [(0, 0), (1, 0), (5, 3), (6, 0)]
    assert clock.ns == start_ns + 6 * TICK_NS


def test_lateness_is_what_the_clock_woke_us_too_late():
    clock = HandClock()
    plain = clock.sleep_until_ns
    clock.sleep_until_ns = lambda due_ns: plain(due_ns + 250_000)
    assert [tick.late_ns for tick in first_ticks(clock, 3)] == [250_000] * 3


def test_the_loop_ends_when_told_and_at_the_given_time():
    clock, stop = HandClock(), threading.Event()
    assert len(list(grid_ticks(TICK_NS, clock, stop, clock.ns + 10 * TICK_NS))) == 10
    stop.set()
    assert list(grid_ticks(TICK_NS, clock, stop)) == []


def supervisor(sensor, device="bus", name="imu"):
    return SensorSupervisor(name, device, (sensor.topic,), lambda: sensor)


def statuses(supervised, clock, ticks):
    statuses = []
    for _ in range(ticks):
        statuses += [sample.message.status for sample in supervised.read(clock.ns)]
        clock.ns += TICK_NS
    return statuses


def test_bringing_up_waits_without_holding_up_the_loop():
    clock = HandClock()
    sensor = Sensor(clock)
    sensor.waits = (0.1, 0.05)
    before_ns = clock.ns
    assert statuses(supervisor(sensor), clock, 7) == [Status.STARTING] * 5 + [Status.OK] * 2
    assert clock.ns == before_ns + 7 * TICK_NS  # reading took no time


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
    supervised = supervisor(sensor)
    assert statuses(supervised, clock, 3) == [Status.OK] * 3
    sensor.trouble = trouble
    failed = [supervised.read(clock.ns + i * TICK_NS)[0].message for i in range(20)]
    clock.ns += 20 * TICK_NS
    assert failed == [Imu(status=status)] * 20
    assert sensor.started > 1
    sensor.trouble = None
    assert Status.OK in statuses(supervised, clock, 25)  # a second


def test_a_glitch_of_one_transfer_costs_one_reading_and_no_new_start():
    clock = HandClock()
    sensor = Sensor(clock)
    supervised = supervisor(sensor)
    statuses(supervised, clock, 3)
    sensor.trouble = OSError(errno.EREMOTEIO, "")
    assert statuses(supervised, clock, 1) == [Status.NO_REPLY]
    sensor.trouble = None
    assert statuses(supervised, clock, 3) == [Status.OK] * 3
    assert sensor.started == 1


def test_a_port_that_cannot_be_opened_is_tried_again():
    clock = HandClock()
    sensor = Sensor(clock)
    there = False

    def make():
        if not there:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory", "/dev/ttyUSB0")
        return sensor

    supervised = SensorSupervisor("rpm", "/dev/ttyUSB0", ("/rpm",), make)
    assert "/dev/ttyUSB0" in str(supervised.open(clock.ns))
    assert set(statuses(supervised, clock, 20)) == {Status.NO_REPLY}
    there = True
    assert Status.OK in statuses(supervised, clock, 14)


def run(clock, supervisors, ticks, act=lambda number: None):
    end_ns = clock.ns + ticks * TICK_NS
    result = []
    for cycle in cycles(supervisors, rate_Hz=25, clock=clock, stop=threading.Event(), until_ns=end_ns):
        result.append(cycle)
        act(cycle.tick.number + 1)
    return result


class WorkerWithDeadline:
    """Reads nothing; keeps the deadlines that it was given."""

    slow = ""

    def __init__(self):
        self.deadlines_ns = []

    def start_reading(self, tick):
        pass

    def collect(self, deadline_ns):
        self.deadlines_ns.append(deadline_ns)
        return NO_READINGS


def test_readings_are_waited_for_until_80_percent_of_the_tick_even_if_it_began_late(monkeypatch):
    """The rest of the tick is for encoding; a later deadline would delay the next tick whenever a bus hangs."""
    clock, worker = HandClock(), WorkerWithDeadline()
    sleep_until_ns = clock.sleep_until_ns
    clock.sleep_until_ns = lambda due_ns: sleep_until_ns(due_ns + 5_000_000)  # each tick begins 5 ms late
    monkeypatch.setattr(sampling_loop, "bus_workers", lambda *_, **__: [worker])
    start_ns = clock.ns
    run(clock, [], 3)
    into_the_tick = [(deadline_ns - start_ns) / TICK_NS - i for i, deadline_ns in enumerate(worker.deadlines_ns)]
    assert into_the_tick == pytest.approx([0.8] * 3)


def test_a_dead_sensor_costs_its_own_data_only():
    clock = HandClock()
    good, dead = Sensor(clock, Magnetometer, "/mag"), Sensor(clock)
    dead.trouble = OSError(errno.EREMOTEIO, "")
    result = run(clock, [supervisor(dead), supervisor(good, name="mag")], 50)
    assert [t.tick.missed for t in result] == [0] * 50
    assert all(s.message.status is Status.OK for t in result for s in t.samples if s.topic == "/mag")


def test_a_hanging_bus_is_tried_once_a_tick_and_other_buses_keep_their_ticks():
    clock = HandClock()
    hanging = [Sensor(clock, topic=topic, cost_ns=20_000_000) for topic in ("/imu", "/baro", "/static")]
    for sensor in hanging:
        sensor.trouble = OSError(errno.ETIMEDOUT, "")
    other = Sensor(clock, Rpm, "/rpm", cost_ns=1_000_000)
    supervisors = [supervisor(sensor, name=sensor.topic) for sensor in hanging] + [
        supervisor(other, device="tty", name="rpm")
    ]
    result = run(clock, supervisors, 50)
    assert sum(t.tick.missed for t in result) == 0
    assert max(t.tick.late_ns for t in result) == 0
    assert sum(s.topic == "/rpm" and s.message.status is Status.OK for t in result for s in t.samples) == 50
    assert {s.message.status for t in result for s in t.samples if s.topic == "/baro"} == {Status.TIMEOUT}


def test_each_tick_logs_how_long_every_sensor_took():
    clock = HandClock()
    result = run(clock, [supervisor(Sensor(clock, cost_ns=3_000_000))], 3)
    ticks = [sample.message for cycle in result for sample in cycle.samples if sample.topic == "/daq/tick"]
    assert [tick.duration_ns for tick in ticks] == [{"imu": 3_000_000}] * 3


def test_time_is_paired_once_a_second_and_a_jump_of_the_system_clock_stays_in_there():
    clock = HandClock()
    gps = Sensor(clock, lambda: Gps(utc_ns=1_463_218_201_000_000_000 + clock.ns), "/gps")

    def jump(number):
        if number == 50:
            clock.unix_offset_ns += 10**18

    result = run(clock, [supervisor(gps, name="gps")], 100, jump)
    times = [sample.message for cycle in result for sample in cycle.samples if sample.topic == "/time"]
    assert len(times) == 4
    assert times[2].system_ns - times[1].system_ns == 10**18 + 10**9
    assert times[2].monotonic_ns - times[1].monotonic_ns == 10**9
    assert all(time.gps_utc_ns - time.monotonic_ns == 1_463_218_201_000_000_000 for time in times)


def test_after_a_stall_of_seconds_time_is_paired_on_the_same_grid_of_seconds():
    clock = HandClock()
    start_ns = clock.ns

    def stall(number):
        if number == 10:
            clock.ns += 2_500_000_000

    result = run(clock, [], 150, stall)
    times = [sample.message for cycle in result for sample in cycle.samples if sample.topic == "/time"]
    paired_s = [(time.monotonic_ns - start_ns) / 1e9 for time in times]
    assert paired_s == pytest.approx([0.0, 2.88, 3.0, 4.0, 5.0], abs=0.04)


def test_events_tell_of_failure_and_recovery_once():
    clock = HandClock()
    sensor = Sensor(clock)

    def act(number):
        if number == 25:
            sensor.trouble = OSError(errno.EREMOTEIO, "Remote I/O error")
        if number == 500:
            sensor.trouble = None

    events = [event for cycle in run(clock, [supervisor(sensor)], 700, act) for event in cycle.events]
    assert [event.severity for event in events] == ["info", "error", "info"]
    assert events[1].text == "imu failed: Remote I/O error"
    assert events[2].text == "imu works"


def test_a_flapping_sensor_does_not_flood_the_log():
    health = SensorHealth("imu")
    events = []
    for tick in range(25 * 60):  # a minute, changing every second
        now_ns = tick * TICK_NS
        good = tick // 25 % 2 == 0
        event = health.read([Status.OK], now_ns) if good else health.failed("Remote I/O error", now_ns)
        events += [event] if event else []
    assert 2 < len(events) <= 60 / 5 + 1
    assert "changes since" in events[-1].text


def test_a_sensor_that_only_says_stale_is_degraded_not_failed():
    health = SensorHealth("probe-alpha")
    health.read([Status.OK], 0)
    events = [health.read([Status.STALE], tick * TICK_NS) for tick in range(1, 300)]
    assert health.state is SensorState.DEGRADED
    assert [event.severity for event in events if event] == ["warning"]


def test_parts_may_be_deaf_at_power_on_without_anybody_being_told():
    health = SensorHealth("imu")
    assert [health.failed("Remote I/O error", i * 500_000_000) for i in range(4)] == [None] * 4
    assert health.failed("Remote I/O error", 2_500_000_000).severity == "error"


def test_gps_time_runs_on_from_the_latest_solution():
    clock = HandClock()
    solution = (1_463_218_201_000_000_000, clock.ns)
    clock.ns += 700_000_000
    assert time_message(clock, solution).gps_utc_ns == 1_463_218_201_700_000_000


def test_skipped_readings_count_as_errors():
    clock = HandClock()
    supervised = supervisor(Sensor(clock))
    statuses(supervised, clock, 3)
    supervised.skip(clock.ns)
    assert supervised.errors == 1


def test_single_stale_readings_with_good_ones_between_are_not_degraded():
    health = SensorHealth("mag")
    for tick in range(100):
        health.read([Status.OK if tick % 10 else Status.STALE], tick * TICK_NS)
    assert health.state is SensorState.OK


def test_a_counter_that_is_silent_while_the_motor_stands_has_not_failed():
    """This holds until its first frame; after that, silence may mean a broken wire."""
    health = SensorHealth("esc_counter", silent_at_rest=True)
    assert not any(health.read([Status.NO_DATA], i * 10**9) for i in range(60))
    assert health.state is SensorState.WAITING
    assert health.read([Status.OK], 60 * 10**9) is not None and health.state is SensorState.OK
    for i in range(61, 64):
        health.read([Status.NO_DATA], i * 10**9)
    assert health.state is SensorState.DEGRADED


def test_missed_ticks_are_news_at_most_every_five_seconds_and_a_stall_is_an_error():
    missed = MissedTicks(40_000_000)
    assert missed.add(GridTick(1, 0, 0), 0) == []
    (single,) = MissedTicks(40_000_000).add(GridTick(5, 0, 1), 0)
    assert single.text.startswith("1 tick missed, less than 0.1 s in a row")
    (first,) = missed.add(GridTick(5, 0, 3), 10**9)
    assert first.severity == "warning" and first.text.startswith("3 ticks missed, 0.1 s in a row")
    assert missed.add(GridTick(8, 0, 2), 2 * 10**9) == []
    (second,) = missed.add(GridTick(160, 0, 150), 8 * 10**9)
    assert second.severity == "error" and second.text.startswith("152 ticks missed, 6.0 s in a row")
    assert missed.add(GridTick(161, 0, 0), 20 * 10**9) == []
