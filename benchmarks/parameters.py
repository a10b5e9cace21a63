"""Compares values for an autopilot with the simulator's truth, for randomly drawn aircraft.

A seed draws an aircraft (`benchmarks/planned_aircraft.py`) and the errors of its sensors, propeller and weight. It
flies the whole test flight, and its log is analyzed. Truth is trimmed flight of the same simulated aircraft: cruise is
where battery power over speed is least among the speeds flown; power, sink and climb are taken at the cruise found.
`python benchmarks/study.py parameters --turbulence-kt 3` repeats it.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import answers
import chain
import numpy as np
from flights import Rows, Setup
from planned_aircraft import aircraft_of

from flightpower.analysis.cli.route import read_results
from flightpower.analysis.performance.autopilot_parameters import PX4
from flightpower.analysis.records.flight import Interval, Results
from flightpower.analysis.results.parameter_file import climb_at_cruise, sink_at_fastest
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.complete_aircraft import CompleteAircraft
from flightpower.flight.errors import InputError
from flightpower.sim.plant import Deviations

SPEEDS = 31  # number of speeds at which the true battery power is computed


class Value(NamedTuple):
    """A value for an autopilot, with its interval and the truth."""

    name: str
    estimate: Interval
    truth: float

    @property
    def has_both_ends(self) -> bool:
        return self.estimate.lo is not None and self.estimate.hi is not None

    def error_and_half_width(self) -> np.ndarray:
        """Error of the interval's middle, and half width [% of the truth], (2, 1)."""
        low, high = np.array([self.estimate.lo, self.estimate.hi], dtype=float) / self.truth
        return 100 * np.array([[(low + high) / 2 - 1], [(high - low) / 2]])


def values_of(
    results: Results, craft: CompleteAircraft, deviations: Deviations, required: np.ndarray
) -> Iterator[Value]:
    """Yield the values with their truth. required: true speed [m/s] and power required [W], (n, 2)"""
    rho, weight_N = results.test.air_density_kgpm3, results.test.weight_N
    to_equivalent = (rho / SEA_LEVEL_DENSITY) ** 0.5
    own = {
        parameter.name: Interval(value=parameter.value, lo=parameter.lo, hi=parameter.hi)
        for parameter in results.autopilot_parameters
    }
    cruise_mps = own["FW_AIRSPD_TRIM"].value / to_equivalent
    flown = results.power_required[0].speed_mps, results.power_required[-1].speed_mps
    V = np.linspace(*flown, SPEEDS)
    *battery_W, _, climb_mps = answers.truth_of(craft, deviations, rho, V, cruise_mps)
    fine = np.linspace(*flown, 2000)
    per_meter = np.polynomial.Polynomial.fit(V, battery_W / V, 6)(fine)
    yield Value("cruise", own["FW_AIRSPD_TRIM"], float(fine[np.argmin(per_meter)]) * to_equivalent)
    if power := own.get("cruise_power"):
        yield Value("cruise power", power.times(0.01), float(np.interp(cruise_mps, V, battery_W)))
    if sink := own.get("FW_T_SINK_MIN"):
        yield Value("sink at cruise", sink, float(np.interp(cruise_mps, *required.T)) / weight_N)
    if fastest := sink_at_fastest(results):
        yield Value("sink at the fastest", fastest, float(np.interp(flown[1], *required.T)) / weight_N)
    if climb := climb_at_cruise(results):
        yield Value("climb at cruise", climb, float(climb_mps))


def one_flight(setup: Setup) -> Rows:
    """Return errors and half widths [% of the truth] of one aircraft's values; a missing value is a title only.

    If the half width exceeds the error, the truth is inside; the error is that of the middle of the interval.
    """
    craft = aircraft_of(np.random.default_rng([setup.seed, 51]), f"drawn-{setup.seed}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "own.toml"
        file.write_text(craft.text.split("\n# Simulated like")[0] + "\n", "utf-8")
        try:
            chain.fly(setup, folder, "--no-hardware", "--like", setup.aircraft, aircraft=file)
            battery = f"{craft.propulsion.battery_energy_Wh:.1f} Wh"
            chain.run("analyze", folder / "log.mcap", "--quiet", "-o", folder / "report", "--battery-Wh", battery)
            results = read_results(folder / "report" / "results.json")
        except (InputError, RuntimeError) as error:
            return [(f"lost: {str(error).strip().splitlines()[-1][-120:]}", np.empty((2, 0)))]
        if not any(parameter.firmware == PX4 for parameter in results.autopilot_parameters):
            return [("no values", np.empty((2, 0)))]
        values = list(values_of(results, craft, setup.drawn_errors.deviations, chain.read_truth(folder)))
    return [(value.name, value.error_and_half_width()) for value in values if value.has_both_ends]
