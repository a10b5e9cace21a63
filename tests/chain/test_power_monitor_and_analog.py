"""Power monitors and the analog converter against their fakes, which were written from the datasheets alone."""

import sys
from pathlib import Path

import numpy as np
import pytest

from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.part_identity import identify
from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.ads1115 import RATES_HZ as ads1115_rates
from flightpower.daq.sensors.ads1115 import ADS1115Driver, rate_code
from flightpower.daq.sensors.ina2xx import INA226, INA228, PowerMonitorDriver, averaging, cycle_us
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes import ina2xx
from flightpower.hw_fakes.ads1115 import FakeADS1115
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.i2c import FakeI2CBus
from flightpower.hw_fakes.tray import FakeTray

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth, constant

SHUNT_OHM = 0.0005
PARTS = [(INA226, ina2xx.INA226), (INA228, ina2xx.INA228)]
TRAY = """
directory = "logs"
[[sensors]]
driver = "ina226"
bus = "/dev/i2c-1"
shunt_ohm = 0.0005
[[sensors]]
driver = "ads1115"
bus = "/dev/i2c-1"
inputs = [0, 3]
"""


class Bench:
    """One part at 0x40 on a bus, with its clock."""

    def __init__(self, make):
        self.clock = SimulatedClock(start_ns=0)
        self.part = make(self.clock.now_ns)
        self.bus = FakeI2CBus({0x40: self.part}, spend_ns=self.clock.advance_ns)

    def started(self, driver):
        for wait_s in driver.start():
            self.clock.advance_ns(round(wait_s * 1e9))
        return driver

    def read(self, driver, ticks: int, period_ns: int = 40_000_000):
        """(time [s], message) of each sample."""
        samples = []
        for _ in range(ticks):
            self.clock.advance_ns(period_ns - self.clock.now_ns() % period_ns)
            samples += driver.read(self.clock.now_ns())
        return [(sample.time_ns * 1e-9, sample.message) for sample in samples]


def monitor(part, variant, volts, amperes, *, seed=1, period_s=0.04):
    truth = AnalyticSensorTruth(voltage_V=volts, current_A=amperes)
    bench = Bench(lambda now_ns: ina2xx.FakePowerMonitor(variant, truth, now_ns, seed, SHUNT_OHM))
    driver = PowerMonitorDriver(bench.bus, 0x40, part, shunt_ohm=SHUNT_OHM, period_s=period_s)
    return bench, bench.started(driver)


@pytest.mark.parametrize(("part", "variant"), PARTS, ids=["INA226", "INA228"])
@pytest.mark.parametrize(("volts", "amperes"), [(0.0, 0.0), (14.8, 37.5), (3.3, -2.0), (25.2, 120.0)])
def test_voltage_and_current_within_a_count(part, variant, volts, amperes):
    bench, driver = monitor(part, variant, constant(volts), constant(amperes))
    good = [m for _, m in bench.read(driver, 20) if m.status is Status.OK]
    assert good[-1].voltage_V == pytest.approx(volts, abs=part.volts_per_count)
    assert good[-1].current_A == pytest.approx(amperes, abs=part.shunt_volts_per_count / SHUNT_OHM)


@pytest.mark.parametrize(("part", "variant"), PARTS, ids=["INA226", "INA228"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_tick_has_a_value_and_its_time_is_right(part, variant, seed):
    """On a ramp of 1 A/s a wrong time is an offset. Neither phase nor rate (to 10 %) of the part's cycle is known."""
    bench, driver = monitor(part, variant, constant(12.0), lambda t: t, seed=seed)
    samples = bench.read(driver, 60)
    assert [m.status for _, m in samples[1:]] == [Status.OK] * 59
    cycle_s = cycle_us(part, *averaging(part, 0.04)) * 1e-6
    late_s = [t_s - m.current_A for t_s, m in samples[1:]]
    assert np.max(np.abs(late_s)) < 0.5 * cycle_s + 0.15 * cycle_s + 0.006


@pytest.mark.parametrize(("part", "variant"), PARTS, ids=["INA226", "INA228"])
def test_a_current_that_pulses_is_averaged(part, variant):
    """A speed controller draws its current in pulses of several hundred hertz: the mean is what empties the battery."""
    bench, driver = monitor(part, variant, constant(12.0), lambda t: 20 + 20 * np.sign(np.sin(2 * np.pi * 700 * t)))
    amperes = [m.current_A for _, m in bench.read(driver, 250) if m.status is Status.OK]
    assert np.mean(amperes) == pytest.approx(20, abs=1.0)


def test_the_averaging_fills_the_tick_but_never_exceeds_it():
    for part, _ in PARTS:
        for rate_Hz in (10, 25, 50, 100, 200):
            assert 0.4e6 / rate_Hz < 1.1 * cycle_us(part, *averaging(part, 1 / rate_Hz)) < 1e6 / rate_Hz


def test_overload_interruption_and_another_part_are_noticed():
    bench, driver = monitor(INA226, ina2xx.INA226, constant(12.0), constant(500.0))
    assert bench.read(driver, 5)[-1][1].status is Status.SATURATED
    bench.part.power_cycle(bench.clock.now_ns())
    with pytest.raises(SensorFailure, match="power-on defaults"):
        bench.read(driver, 1, period_ns=500_000)
    with pytest.raises(SensorFailure, match="INA228 expected"):
        bench.started(PowerMonitorDriver(bench.bus, 0x40, INA228, shunt_ohm=SHUNT_OHM, period_s=0.04))


def converter(inputs, seed=1, period_s=0.04, volts=lambda channel, t: 0.5 * channel - 0.7):
    bench = Bench(lambda now_ns: FakeADS1115(volts, now_ns, seed))
    driver = ADS1115Driver(bench.bus, 0x40, inputs=inputs, full_scale_V=2.048, period_s=period_s)
    return bench, bench.started(driver)


@pytest.mark.parametrize("period_s", [0.1, 0.04, 0.01, 0.005])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_inputs_take_turns_at_every_rate(period_s, seed):
    bench, driver = converter((0, 1, 3), seed, period_s)
    samples = bench.read(driver, 31, round(period_s * 1e9))
    assert [m.channel for _, m in samples] == [0, 1, 3] * 10
    assert {m.status for _, m in samples} == {Status.OK}
    for _, m in samples:
        assert m.voltage_V == pytest.approx(0.5 * m.channel - 0.7, abs=2.048 / 2**15)


def test_a_voltage_beyond_the_range_and_an_interruption_are_noticed():
    bench, driver = converter((2,), volts=lambda channel, t: 3.0)
    assert {m.status for _, m in bench.read(driver, 5)} == {Status.SATURATED}
    bench.part.power_cycle(bench.clock.now_ns())
    with pytest.raises(SensorFailure, match="power-on defaults"):
        bench.read(driver, 1)


def test_the_daemon_records_battery_and_analog_inputs(tmp_path):
    clock = SimulatedClock(start_ns=3_000_000_000)
    truth = AnalyticSensorTruth(voltage_V=constant(11.1), current_A=constant(30.0))
    fake, tray = FakeTray(truth, clock), parse_tray(TRAY, "tray.toml", tmp_path)
    names = [identify(table, fake, clock).text for table in tray.sensors]
    assert names[0].startswith("INA226, 0x40 on") and names[1].startswith("ADS1115 (answers")
    log = read_log(record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 4 * 10**9).path)
    battery = [e.message for e in log.entries["/battery"] if e.message.status is Status.OK]
    analog = [e.message for e in log.entries["/analog"] if e.message.status is Status.OK]
    assert len(battery) > 90 and len(analog) > 90
    assert (battery[-1].voltage_V, battery[-1].current_A) == pytest.approx((11.1, 30.0), abs=0.01)
    assert {m.channel: round(m.voltage_V, 3) for m in analog} == {0: round(11.1 / 11, 3), 3: 0.0}


def test_a_converter_takes_the_slowest_rate_that_ends_within_a_tick_and_else_its_fastest():
    """A nominal conversion lasts 1/rate, and 11 % longer with a slow oscillator; nine tenths of a tick are free."""
    for period_s, rate_Hz in ((0.2, 8), (0.04, 32), (0.02, 64), (0.01, 128), (0.0015, 860), (0.001, 860)):
        code, nominal_s = rate_code(period_s)
        assert (ads1115_rates[code], nominal_s) == (rate_Hz, 1 / rate_Hz)
