"""Measures the drivers' CPU time per tick without that of the fake parts: `python benchmarks/bench.py drivers`.

It is thread CPU time, so that other work on the machine does not count. It includes a few microseconds for reading that
clock.
"""

import tempfile
import time
from pathlib import Path
from statistics import fmean, quantiles

from records import Record, rounded

from flightpower.daq.config import parse_tray
from flightpower.daq.driver_factory import driver_factory
from flightpower.flight.aircraft import load_aircraft
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray, TrayVariant
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

EXAMPLE = Path(__file__).resolve().parent.parent / "daq" / "tray.example.toml"
LIMIT_US = 1000.0  # limit per tick for the whole tray
SETTLING_TICKS = 75  # startup and configuration are not part of a tick's cost


class Timed:
    """Wraps an object and adds up the CPU time of its methods in the shared list `spent_ns`."""

    def __init__(self, target, spent_ns: list[int]):
        self._target, self._spent_ns = target, spent_ns

    def __getattr__(self, name):
        method = getattr(self._target, name)

        def timed(*arguments):
            start_ns = time.thread_time_ns()
            try:
                return method(*arguments)
            finally:
                self._spent_ns[0] += time.thread_time_ns() - start_ns

        return timed


class TimedBuses:
    """The buses of a tray, whose CPU time is counted."""

    def __init__(self, tray: FakeTray, spent_ns: list[int]):
        self._tray, self._spent_ns = tray, spent_ns

    def i2c(self, device):
        return Timed(self._tray.i2c(device), self._spent_ns)

    def port(self, device, baud):
        return Timed(self._tray.port(device, baud), self._spent_ns)


def measure(seconds: float) -> tuple[dict[str, list[float]], list[float]]:
    """Return the CPU time [us] at each tick of each driver, and of all fake parts together."""
    aircraft = load_aircraft("nexstar")
    errors = draw(load_budget("bench"), 0)
    sensor_truth = FlightSensorTruth(
        fly(aircraft, load_plan("accel-decel"), seed=0, deviations=errors.deviations), errors
    )
    clock, spent_ns = SimulatedClock(), [0]
    fake = FakeTray(sensor_truth, clock, 0, variant=TrayVariant(pole_pairs=aircraft.propulsion.pole_pairs))
    tray = parse_tray(EXAMPLE.read_text("utf-8"), str(EXAMPLE), Path(tempfile.gettempdir()))
    buses = TimedBuses(fake, spent_ns)
    drivers = {table.name: driver_factory(table, tray, buses, aircraft)() for table in tray.sensors}
    for driver in drivers.values():
        for wait_s in driver.start():
            clock.advance_ns(round(wait_s * 1e9))
    period_ns = round(1e9 / tray.rate_Hz)
    drivers_us: dict[str, list[float]] = {name: [] for name in drivers}
    fakes_us: list[float] = []
    for tick in range(round(seconds * tray.rate_Hz) + SETTLING_TICKS):
        clock.sleep_until_ns((clock.now_ns() // period_ns + 1) * period_ns)
        all_fakes_ns = 0
        for name, driver in drivers.items():
            spent_ns[0] = 0
            start_ns = time.thread_time_ns()
            driver.read(clock.now_ns())
            took_ns = time.thread_time_ns() - start_ns
            all_fakes_ns += spent_ns[0]
            if tick >= SETTLING_TICKS:
                drivers_us[name].append((took_ns - spent_ns[0]) / 1e3)
        if tick >= SETTLING_TICKS:
            fakes_us.append(all_fakes_ns / 1e3)
    return drivers_us, fakes_us


def records(*, seconds: float = 60.0) -> list[Record]:
    """Return CPU times of each driver, and of all drivers against the limit that 99 of 100 ticks must meet."""
    drivers_us, fakes_us = measure(seconds)
    whole_us = [sum(tick) for tick in zip(*drivers_us.values(), strict=True)]
    limit = {"ratio": rounded(quantiles(whole_us, n=100)[98] / LIMIT_US, 2), "at most": 1.0}
    rows = [row(name, values) for name, values in drivers_us.items()]
    return [*rows, row("all drivers", whole_us) | limit, row("the fake parts", fakes_us)]


def row(name: str, values: list[float]) -> Record:
    """Return a row of microseconds per tick."""
    figures = {"mean, us": fmean(values), "99 %, us": quantiles(values, n=100)[98], "worst, us": max(values)}
    return {"driver": name} | {title: rounded(value, 1) for title, value in figures.items()}
