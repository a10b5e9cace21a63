"""Errors and intervals of battery power, highest level speed and rate of climb over simulated flights.

    .venv/bin/python benchmarks/answers.py --errors study --flights 8

Simulates flight and sensors (without buses and counts), analyses, and compares with trimmed flight of the same
simulated aircraft. The errors of propeller table, weight and battery meter are drawn from the budget. docs/answers.md
quotes the table.
"""

from concurrent.futures import ProcessPoolExecutor
from typing import Annotated, NamedTuple

import flights
import numpy as np
import typer
from estimators import speeds
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.optimize import brentq

from analysis.airdata.probe import ProbeCalibration
from analysis.drag import dynamic
from analysis.maneuvers.find_level import find_runs
from analysis.performance.analysis import performance_model, power_train_data
from analysis.performance.climb import full_throttle_performance
from analysis.performance.level_flight import level_flight
from analysis.polar import Condition, lift_coefficient
from analysis.trajectory.reconstruction import reconstruct
from flight.aircraft import Aircraft, load_aircraft
from flight.errors import InputError
from flight.propeller_files import load_propeller
from sim.air import ambient
from sim.plant import Deviations, plant_of
from sim.propulsion import power_train
from sim.sensors import load_budget
from sim.trim import Trimmer


def truth_of(aircraft: Aircraft, deviations: Deviations, rho: float, V: np.ndarray, climb_V: float) -> np.ndarray:
    """Battery power at each speed in trimmed level flight, the highest level speed, the best climb at one speed."""
    plant = plant_of(aircraft, deviations=deviations)
    height = brentq(lambda h: float(ambient(plant.air, h).density) - rho, -1000, 4000)
    trimmer = Trimmer(plant, height)
    propeller, powers = trimmer.plant.propeller, []
    for v in V:
        trim = trimmer.solve(V=float(v), climb=0.0)
        now = power_train(
            aircraft.propulsion, propeller, V=v, n=trim.unknowns.motor, throttle=trim.throttle, rho=trimmer.density
        )
        powers.append(float(now.battery_voltage_V * now.battery_current_A))
    low, high = 0.0, 15.0
    for _ in range(20):
        climb = (low + high) / 2
        try:
            trimmer.solve(V=climb_V, climb=climb)
            low = climb
        except InputError:
            high = climb
    return np.array([*powers, trimmer.V_max, low])


class Job(NamedTuple):
    """One simulated flight to analyze."""

    aircraft: Aircraft
    probe: ProbeCalibration
    errors: str
    plan: str
    turbulence_kt: float
    seed: int
    blind: bool


def one_flight(job: Job) -> np.ndarray:
    """Estimate, half width of the interval and truth of each quantity, (3, quantities)."""
    aircraft, probe, errors, plan, turbulence_kt, seed, blind = job
    drawn = flights.drawn(load_budget(errors), seed)
    flight, sensor_truth, table = flights.flown(aircraft, drawn, plan, seed, turbulence_kt)
    t = table.index.to_numpy()
    table["battery_V"], table["battery_A"] = sensor_truth.battery(t)
    if blind:
        table["battery_A"] = np.nan
    table["throttle"] = np.interp(t, flight.truth["time_s"], flight.truth["throttle"])
    propeller = load_propeller(aircraft.propulsion.propeller)
    air, still, _ = flights.air_of(table, aircraft, probe)
    runs, _ = find_runs(air)
    trajectory = reconstruct(air, still)
    estimate = dynamic.estimate_polar(trajectory, runs, aircraft, propeller)
    flown = np.concatenate([air["V_mps"].to_numpy()[run.rows] for run in runs])
    rho = float(np.nanmean(np.concatenate([air["rho"].to_numpy()[run.rows] for run in runs])))
    at = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    slow, fast = np.nanpercentile(flown, (1, 99))
    flown_CL = float(lift_coefficient(fast, at)), float(lift_coefficient(slow, at))
    model = performance_model(
        power_train_data(trajectory, aircraft, propeller), estimate, aircraft, propeller, flown_CL
    )
    V = speeds(aircraft)[1:]
    full = full_throttle_performance(model, at)
    level = level_flight(model, at, V)
    found = (level.battery, full.maximum_speed, full.best_climb)
    value = np.hstack([one.value for one in found])
    half = np.hstack([one.hi - one.value for one in found])
    assert np.isfinite([value, half]).all()
    return np.stack([value, half, truth_of(aircraft, drawn.deviations, rho, V, full.best_climb_speed)])


def main(
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "accel-decel",
    count: Annotated[int, typer.Option("--flights", help="How many; one seed each.")] = 8,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    blind: Annotated[bool, typer.Option("--blind", help="Without battery data.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    aircraft = load_aircraft("nexstar")
    probe = flights.tunnel_probe()
    console = Console(width=120)
    todo = [Job(aircraft, probe, errors, plan, turbulence_kt, s, blind) for s in range(first_seed, first_seed + count)]
    with ProcessPoolExecutor(jobs) as pool:
        done = track(pool.map(one_flight, todo), "flights", total=count, console=Console(stderr=True))
        value, half, truth = np.stack(list(done), axis=1)
    error, width = 100 * (value / truth - 1), 100 * half / truth
    names = [*(f"{v:.1f} m/s" for v in speeds(aircraft)[1:]), "top speed", "climb"]
    console.print(
        f"{errors}, {plan}, W20 = {turbulence_kt:g} kt, {count} flights from seed {first_seed}"
        f"{', no battery data' if blind else ''}; in %"
    )
    table = Table("", *names, box=None)
    for name, row, form in flights.error_rows(error, width):
        table.add_row(name, *(form.format(x) for x in row))
    console.print(table)
    print("", flights.as_markdown(plan, error, width), sep="\n")


if __name__ == "__main__":
    typer.run(main)
