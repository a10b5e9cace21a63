"""Values for an autopilot, of aircraft drawn at random, against the simulator's truth.

    python benchmarks/parameters.py --flights 2                      # seeds below 1000 are for development
    python benchmarks/parameters.py --seed 1000 --flights 20 --jobs 2

A seed draws an aircraft (`benchmarks/planned_aircraft.py`) and the errors of its sensors, propeller and weight. It
flies the whole test flight in 3 kt, and its log is analyzed. Truth is trimmed flight of the same simulated aircraft:
cruise is where battery power over speed is least among the speeds flown; power, sink and climb are taken at the cruise
found.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import answers
import chain
import numpy as np
import typer
from flights import Setup
from planned_aircraft import MODEL, aircraft_of

from flightpower.analysis.cli.route import read_results
from flightpower.analysis.performance.autopilot_parameters import PX4
from flightpower.analysis.records.flight import Interval, Results
from flightpower.analysis.results.parameter_file import climb_at_cruise, sink_at_fastest
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.complete_aircraft import CompleteAircraft
from flightpower.flight.errors import InputError
from flightpower.sim.plant import Deviations

SPEEDS = 31  # at which the battery's true power is computed


class Value(NamedTuple):
    """A value with its interval, and the truth."""

    name: str
    estimate: Interval
    truth: float


def values_of(
    results: Results, craft: CompleteAircraft, deviations: Deviations, required: np.ndarray
) -> Iterator[Value]:
    """required: true speed [m/s] and power required [W], (n, 2)"""
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


def one_aircraft(seed: int) -> dict[str, Any]:
    craft = aircraft_of(np.random.default_rng([seed, 51]), f"drawn-{seed}")
    setup = Setup(MODEL, "study", "full-test-flight", 3.0, seed)
    line: dict[str, Any] = {"seed": seed, "kg": round(craft.mass_kg, 2), "propeller": craft.propulsion.propeller}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "own.toml"
        file.write_text(craft.text.split("\n# Simulated like")[0] + "\n", "utf-8")
        try:
            chain.fly(setup, folder, "--no-hardware", "--like", MODEL, aircraft=file)
            battery = f"{craft.propulsion.battery_energy_Wh:.1f} Wh"
            chain.run("analyze", folder / "log.mcap", "--quiet", "-o", folder / "report", "--battery-Wh", battery)
            results = read_results(folder / "report" / "results.json")
        except (InputError, RuntimeError) as error:
            return {**line, "lost": str(error)[-200:]}
        if not any(parameter.firmware == PX4 for parameter in results.autopilot_parameters):
            return {**line, "lost": "no values"}
        lines = values_of(results, craft, setup.drawn.deviations, chain.read_truth(folder))
        line["values"] = {
            line.name: [line.estimate.value, line.estimate.lo, line.estimate.hi, line.truth] for line in lines
        }
    return line


def main(
    seed: Annotated[int, typer.Option(help="Of the first aircraft.")] = 0,
    flights: Annotated[int, typer.Option(help="Aircraft.")] = 2,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    values: dict[str, list[list[float]]] = {}
    with ProcessPoolExecutor(jobs) as pool:
        for line in pool.map(one_aircraft, range(seed, seed + flights)):
            print(json.dumps(line), flush=True)
            for name, figures in line.get("values", {}).items():
                values.setdefault(name, []).append(figures)
    everything = []
    for name, of in values.items():
        value, lo, hi, truth = np.array(of).T
        inside = (lo <= truth) & (truth <= hi)
        everything.append(inside)
        error, half = np.abs(value / truth - 1), (hi - lo) / 2 / truth
        print(
            f"{name}: {inside.sum()} of {len(inside)} inside, median error {100 * np.median(error):.1f} %,"
            f" median half width {100 * np.median(half):.1f} %"
        )
    if everything:
        print(f"all: {100 * np.mean(np.concatenate(everything)):.0f} % of {sum(map(len, everything))} inside")


if __name__ == "__main__":
    typer.run(main)
