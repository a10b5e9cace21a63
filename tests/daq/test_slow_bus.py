"""A bus that needs most of a tick or more: its answers are logged with their own time and tick, and the delay is
reported."""

import threading

import pytest
from scripted_parts import HandClock
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq import tray_check
from flightpower.daq.bus_load import READINGS, BusLoad
from flightpower.daq.bus_worker import ThreadedBusWorker
from flightpower.daq.daemon import record
from flightpower.daq.sensor_health import SensorState
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Imu, Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import I2C_BUS, FakeTray

GIVE_UP_S = 60.0
PERIOD_NS = 40_000_000


class SlowPart:
    """Answers when it is permitted to."""

    def __init__(self):
        self.permit = threading.Semaphore(0)
        self.answered = threading.Semaphore(0)

    def start(self):
        yield from ()

    def read(self, now_ns):
        assert self.permit.acquire(timeout=GIVE_UP_S)
        return [Sample("/imu", now_ns, Imu())]


class Bench:
    """A worker on a clock that is moved by hand; every tick ends without an answer unless one was permitted before."""

    def __init__(self, period_ns=PERIOD_NS):
        self.clock, self.part, self.period_ns = HandClock(0), SlowPart(), period_ns
        self.supervisor = SensorSupervisor("imu", "i2c-1", ("/imu",), lambda: self.part, blocking=True)
        self.worker = ThreadedBusWorker([self.supervisor], self.clock, period_ns, blocking=True)

    def tick(self, number, to_deadline_ns=0):
        self.clock.ns = number * self.period_ns
        self.worker.start_reading(number)
        return self.worker.collect(self.clock.ns + to_deadline_ns)

    def answer(self):
        """Let the pending read return, and wait until its thread has signaled this."""
        self.part.permit.release()
        self.worker._done_signal.acquire(timeout=GIVE_UP_S)
        self.worker._done_signal.release()


def test_a_reading_that_arrives_before_the_next_tick_is_logged_with_its_own_time_and_tick():
    bench = Bench()
    results = []
    for number in range(20):
        results += bench.tick(number).samples
        bench.answer()
    results += bench.tick(20).samples
    assert [(s.tick, s.time_ns, s.message.status) for s in results] == [
        (number, number * PERIOD_NS, Status.OK) for number in range(20)
    ]
    assert bench.supervisor.errors == 0 and bench.supervisor.health.state is SensorState.OK


def test_a_tick_that_is_passed_over_is_a_timeout_and_degrades_the_sensor():
    """The bus takes one and a half ticks: every second tick is passed over."""
    bench = Bench()
    results = []
    for number in range(60):
        results += bench.tick(number).samples
        if number % 2:
            bench.answer()
    expected = [(n, Status.TIMEOUT if n % 2 else Status.OK) for n in range(58)]
    assert [(s.tick, s.message.status) for s in results] == expected
    assert bench.supervisor.health.state is SensorState.DEGRADED and bench.supervisor.errors >= 29


def test_a_read_that_ends_early_in_the_next_tick_is_followed_by_that_ticks_read():
    """The bus needs 90 % of a tick and was held up for 20 %: if no read followed, the next tick would be passed
    over."""
    bench = Bench(GIVE_UP_S * 10**9)
    bench.tick(0)
    threading.Timer(0.05, bench.part.permit.release, ()).start()
    threading.Timer(0.1, bench.part.permit.release, ()).start()
    readings = bench.tick(1, round(0.8 * bench.period_ns))
    assert [(s.tick, s.message.status) for s in readings.samples] == [(0, Status.OK), (None, Status.OK)]
    assert bench.supervisor.errors == 0


def test_a_read_that_ends_late_in_the_next_tick_is_not_followed():
    bench = Bench(3 * 10**9)
    bench.tick(0)
    late = threading.Timer(2.0, bench.part.permit.release, (2,))  # later than half a tick before the deadline
    late.start()
    bench.tick(1, round(0.8 * bench.period_ns))
    assert bench.supervisor.errors == 1
    late.cancel()


def test_one_tick_passed_over_is_counted_and_degrades_nothing():
    bench = Bench()
    for number in range(60):
        bench.tick(number)
        if number != 30:
            bench.answer()
    assert bench.supervisor.errors == 1 and bench.supervisor.health.state is SensorState.OK


def test_a_slow_bus_is_reported_once_with_what_to_do_and_again_when_it_is_fast_enough():
    load = BusLoad("/dev/i2c-1", PERIOD_NS)
    slow, fast = {"imu": 18_000_000, "mag": 3_000_000, "baro": 10_000_000}, {"imu": 5_000_000, "mag": 1_000_000}
    events = [event.text for _ in range(3 * READINGS) for event in load.add(slow)]
    text = "/dev/i2c-1 needs 31 ms of 40: raise i2c_arm_baudrate, or move imu to another bus"
    assert events == [text] and load.slow == text
    events = [event.text for _ in range(3 * READINGS) for event in load.add(fast)]
    assert len(events) == 1 and "fast enough again" in events[0] and not load.slow


def test_as_many_sensors_are_moved_as_leave_less_than_half_of_a_tick():
    """The bus takes 38 ms of 40: without the IMU it takes 22, and without the barometer as well 8."""
    load = BusLoad("/dev/i2c-1", PERIOD_NS)
    slow = {"mag": 8_000_000, "imu": 16_000_000, "baro": 14_000_000}
    (text,) = (event.text for _ in range(3 * READINGS) for event in load.add(slow))
    assert text.endswith("or move imu and baro to another bus")


def test_a_bus_of_which_some_readings_are_late_is_slow_too_but_single_ones_are_not():
    """At the Pi's default 100 kHz and 50 Hz, 17 % of the readings took more than 0.8 of a tick, and the mean took
    0.65."""
    for every, expected in ((6, 1), (25, 0)):
        load = BusLoad("/dev/i2c-1", 20_000_000)
        events = [e for i in range(200) for e in load.add({"imu": 17_000_000 if i % every == 0 else 12_000_000})]
        assert len(events) == expected and bool(load.slow) is bool(expected)
        assert all("needs 17 ms of 20" in event.text for event in events)


def slow_tray(tmp_path, bit_rate_Hz):
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    fake.buses[I2C_BUS]._byte_ns = 9e9 / bit_rate_Hz
    return clock, fake, default_tray(tmp_path, fake)


def test_event_status_line_and_check_say_what_to_do(tmp_path):
    clock, fake, tray = slow_tray(tmp_path, 50e3)
    events, lines = [], []
    done = record(
        tray,
        buses=fake,
        clock=clock,
        until_ns=clock.now_ns() + 6 * 10**9,
        on_event=events.append,
        report=lines.append,
    )
    message = [event for event in events if "raise i2c_arm_baudrate" in event.text]
    assert len(message) == 1 and message[0].severity == "warning" and message[0].text.startswith("/dev/i2c-1 needs ")
    assert "raise i2c_arm_baudrate" in lines[-1].line
    assert any("i2c_arm_baudrate" in e.message.text for e in read_log(done.path).entries["/daq/event"])
    report = tray_check.check_tray(tray, buses=fake, clock=clock, seconds=2)
    assert not report.fit and any("raise i2c_arm_baudrate" in fact.text for fact in report.facts)


def test_every_tick_of_a_bus_that_is_too_slow_was_taken_or_missed(tmp_path):
    clock, fake, tray = slow_tray(tmp_path, 12e3)
    done = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 4 * 10**9, threaded=False)
    assert done.missed > 10 and done.ticks + done.missed == pytest.approx(4 * 25, abs=3)


def test_a_bus_of_the_recommended_rate_is_fast_enough(tmp_path):
    clock, fake, tray = slow_tray(tmp_path, 400e3)
    events = []
    record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 4 * 10**9, on_event=events.append)
    assert not any("i2c_arm_baudrate" in event.text for event in events)


def test_readings_lost_to_a_slow_bus_are_not_advised_to_be_unplugged():
    line = tray_check.check_topic("/imu", [Imu(status=Status.TIMEOUT)] * 10, 1.0, slow=["bus 1 is slow"])
    assert line.ok is False and line.advice == "bus 1 is slow"
