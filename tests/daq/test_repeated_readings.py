"""A part that repeats itself is found in flight if its values changed before, and nowhere else."""

import numpy as np
import pytest
from scripted_parts import HandClock

from flightpower.daq.repeated_readings import InFlight, RepeatedReadingsOfSensor
from flightpower.daq.sampling_loop import cycles
from flightpower.daq.sensor_supervisor import SensorSupervisor
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import AbsolutePressure, Battery, Controls, DifferentialPressure, Gps, Imu, Status

TICK_NS = 40_000_000
NOISE = np.random.default_rng(3)


def imu(number: int) -> Imu:
    counts = {f"{of}_{axis}_counts": number + i / 8 for i, of in enumerate(("accel", "gyro")) for axis in "xyz"}
    return Imu(temperature_counts=2000.0, **counts)


def static(number: int) -> AbsolutePressure:
    return AbsolutePressure(pressure_counts=number, temperature_counts=8_000_000, pressure_Pa=95_000.0)


def airspeed(number: int) -> DifferentialPressure:
    return DifferentialPressure(pressure_counts=number, temperature_counts=700, differential_pressure_Pa=150.0)


def gps(number: int) -> Gps:
    return Gps(latitude_deg=47 + number * 1e-7, height_m=500.0, velocity_north_mps=14 + number * 1e-3, itow_ms=0)


def reported_after_s(topic, message_of, *, frozen_s=3.0, flown_s=10.0, in_flight=True, period_s=0.04, noise=True):
    """How long after the repetition began the first stale message came [s]; None if none came."""
    readings = RepeatedReadingsOfSensor()
    ticks, first_stale_s = round(flown_s / period_s), None
    values = NOISE.integers(-500, 500, ticks) if noise else np.zeros(ticks, dtype=int)
    for tick in range(round((flown_s + frozen_s) / period_s)):
        message = message_of(int(values[min(tick, ticks - 1)]))
        now_ns = round(tick * period_s * 1e9)
        ((_, _, got, _),) = readings.marked([Sample(topic, now_ns, message)], now_ns, in_flight=in_flight)
        if got.status is Status.STALE:
            assert got == type(message)(status=Status.STALE)
            first_stale_s = tick * period_s - (flown_s - period_s) if first_stale_s is None else first_stale_s
        else:
            assert first_stale_s is None and got is message
    return first_stale_s


@pytest.mark.parametrize(
    ("topic", "message_of", "period_s", "within_s"),
    [
        ("/imu", imu, 0.04, 0.05), ("/static", static, 0.04, 1.05), ("/probe/airspeed", airspeed, 0.04, 1.05),
        ("/probe/airspeed", airspeed, 0.01, 1.02), ("/gps", gps, 0.1, 0.55),
    ],
)  # fmt: skip
def test_what_repeats_itself_in_flight_is_stale(topic, message_of, period_s, within_s):
    assert reported_after_s(topic, message_of, period_s=period_s) <= within_s


def test_nothing_is_said_on_the_ground_or_of_what_never_changed():
    assert reported_after_s("/probe/airspeed", airspeed, in_flight=False) is None
    assert reported_after_s("/imu", imu, noise=False) is None
    assert reported_after_s("/imu", imu, flown_s=2.0) is None  # not known well enough yet


def test_what_may_stand_still_is_not_compared():
    for topic, message in (("/controls", Controls(pulse_us=[1500] * 8)), ("/battery", Battery(voltage_V=15.0))):
        assert reported_after_s(topic, lambda _, message=message: message) is None


def test_a_calm_transducer_is_not_stale_although_its_counts_often_repeat():
    """In an hour with 1.5 counts of noise at 25 Hz, each fourth reading equals the one before, up to nine in a row."""
    readings = RepeatedReadingsOfSensor()
    counts = np.rint(NOISE.normal(8000, 1.5, 90_000)).astype(int).tolist()
    for tick, count in enumerate(counts):
        ((_, _, got, _),) = readings.marked(
            [Sample("/probe/airspeed", 0, airspeed(count))], tick * TICK_NS, in_flight=True
        )
        assert got.status is Status.OK


def test_it_stays_stale_after_landing_until_it_changes():
    """A frozen airspeed no longer shows flight, but that must not make it a measurement again."""
    readings = RepeatedReadingsOfSensor()
    for tick in range(300):
        readings.marked([Sample("/static", 0, static(tick))], tick * TICK_NS, in_flight=True)
    statuses = []
    for tick in range(300, 600):
        (sample,) = readings.marked([Sample("/static", 0, static(299))], tick * TICK_NS, in_flight=tick < 400)
        statuses.append(sample.message.status)
    assert statuses[-1] is Status.STALE
    (sample,) = readings.marked([Sample("/static", 0, static(300))], 600 * TICK_NS, in_flight=False)
    assert sample.message.status is Status.OK


def test_flight_is_seen_by_the_tube_or_the_receiver_and_ends_five_seconds_after():
    flight = InFlight()
    assert not flight.update([Sample("/probe/airspeed", 0, DifferentialPressure(differential_pressure_Pa=30.0))], 0)
    assert not flight.update([Sample("/gps", 0, Gps(velocity_north_mps=8.0, velocity_east_mps=8.0))], 0)
    assert flight.update([Sample("/gps", 0, Gps(velocity_north_mps=9.0, velocity_east_mps=9.0))], 0)
    assert flight.update([], 4_900_000_000) and not flight.update([], 5_000_000_000)
    assert not flight.update(
        [Sample("/probe/alpha", 0, DifferentialPressure(differential_pressure_Pa=90.0))], 6 * 10**9
    )
    assert flight.update([Sample("/probe/airspeed", 0, DifferentialPressure(differential_pressure_Pa=41.0))], 6 * 10**9)


class Frozen:
    """Airspeed whose counts change until 8 s, and then no more."""

    def start(self):
        yield 0.0

    def read(self, now_ns):
        return [Sample("/probe/airspeed", now_ns, airspeed(min(now_ns, 8_000_000_000) // TICK_NS))]


def test_the_loop_tells_every_supervisor_that_the_aircraft_flies():
    clock = HandClock(start_ns=0)
    supervisor = SensorSupervisor("airspeed", "/dev/i2c-1", ("/probe/airspeed",), Frozen)

    class Never:
        def is_set(self):
            return False

    stale_ns, events = [], []
    for cycle in cycles([supervisor], rate_Hz=25, clock=clock, stop=Never(), until_ns=12 * 10**9):
        events += [event.text for event in cycle.events]
        stale_ns += [cycle.now_ns for sample in cycle.samples if sample.message.status is Status.STALE]
    assert stale_ns[0] * 1e-9 == pytest.approx(9.0, abs=0.05) and events[-1] == "airspeed degraded: stale"
