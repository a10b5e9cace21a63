"""What thrust on a stand does for the interval of power required: the same simulated flights with and without it.

    python benchmarks/thrust_stand.py --world study --flights 16 --seed 1000
    python benchmarks/thrust_stand.py --world propeller --stated --flights 16 --seed 1000

Before each flight the simulated propeller stands still on a load cell: ten readings at five motor speeds, up and down,
1 % of noise each, and a scale wrong by 1 % (1 sigma). `calibrate thrust` compares them with the table that the analysis
gets. No buses and no counts, as in benchmarks/estimators.py. docs/calibration.md quotes what this prints.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Annotated, NamedTuple

import flights
import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from analysis.drag import dynamic
from analysis.drag.estimate import every_method, fallback
from analysis.estimation.noise import NORMAL_95
from analysis.ground.thrust_stand import StandReadings, ThrustStand, calibrate
from analysis.maneuvers.find import find
from analysis.maneuvers.find_level import find_runs
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.polar import Condition, Polar, power_required, speed_at
from analysis.trajectory.reconstruction import Trajectory, reconstruct
from flight.aircraft import Aircraft, load_aircraft
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.errors import InputError
from flight.propeller import Propeller
from flight.propeller_files import load_propeller
from sim.plant import plant_of
from sim.sensors.budget import DrawnErrors, ErrorBudget
from sim.world import load_world

OVER_STALL = (1.1, 1.3, 1.6, 1.9, 2.2)
SHARES = (0.45, 0.6, 0.7, 0.8, 0.9)  # of the highest motor speed
READING_ERROR, SCALE_ERROR = 0.01, 0.01
EVERY_LIFT = (0.01, 100.0)
BOW_AT_REST = 2.5  # change at J = 0 from the straight line through flight, by one unit of bow


class Job(NamedTuple):
    aircraft: Aircraft
    world: str
    plan: str
    turbulence_kt: float
    seed: int
    steady: bool  # by steady points alone


def stand_of(aircraft: Aircraft, errors: DrawnErrors, seed: int) -> ThrustStand:
    """The result of `calibrate thrust` with the propeller that is flown. Raises InputError where it writes none."""
    plant, rng = plant_of(aircraft, deviations=errors.deviations), np.random.default_rng([seed, 22])
    top = aircraft.propulsion.max_rpm / 60
    n = top * np.array([*SHARES, *reversed(SHARES)])
    thrust_N = plant.propeller.thrust_and_power(np.zeros(len(n)), n, SEA_LEVEL_DENSITY)[0]
    thrust_N = thrust_N * (1 + errors.deviations.thrust_scale) * (1 - 0.5 * errors.deviations.thrust_slope_J)
    thrust_N = thrust_N * (1 + SCALE_ERROR * rng.standard_normal()) * (1 + READING_ERROR * rng.standard_normal(len(n)))
    readings = StandReadings(n, thrust_N, np.full(len(n), SEA_LEVEL_DENSITY))
    found, unsupported = calibrate(readings, load_propeller(aircraft.propulsion.propeller), SCALE_ERROR, "stand")
    if unsupported:
        raise InputError(unsupported)
    return found


def one_flight(job: Job) -> dict[str, np.ndarray]:
    """By data used: error and half the 95 % interval in per cent of the truth (2, speeds), without and with the stand;
    thrust at rest in per cent of the table's. Empty where the flight ended too soon."""
    aircraft, world, plan, turbulence_kt, seed, steady = job
    drawn, probe = flights.drawn(load_world(world).errors, seed), flights.tunnel_probe()
    try:
        flown = flights.flown(aircraft, drawn, plan, seed, turbulence_kt)
    except InputError:
        return {}
    propeller = load_propeller(aircraft.propulsion.propeller)
    air, still, _ = flights.air_of(flown.table, aircraft, probe)
    rho = float(air.loc[air["flying"], "rho"].mean())
    at = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    V = np.array(OVER_STALL) * flights.stall_mps(aircraft)
    truth = np.interp(V, flown.flight.power_required["speed_mps"], flown.flight.power_required["power_W"])
    trajectory = reconstruct(air, still, alpha_scale_sigma=probe.alpha_scale_sigma)
    on_stand = stand_of(aircraft, drawn, seed).applied_to(aircraft)
    found = find(air, still).of("steady") if steady else find_runs(air)[0]
    figures = {}
    for title, given in (("without", aircraft), ("with the stand", on_stand)):
        for data, polar, flown_CL in _estimates(trajectory, found, given, propeller, at):
            power, error = power_required(V, polar, at)
            low, high = speed_at(np.array(flown_CL), at)[::-1]
            compared = 100 * np.stack([power / truth - 1, NORMAL_95 * error / truth])
            figures[f"{data}, {title}"] = np.where((V > low) & (V < high), compared, np.nan)
    return dict(sorted(figures.items(), key=lambda item: item[0].partition(",")[0]))


def _estimates(
    trajectory: Trajectory, found: list[Maneuver], aircraft: Aircraft, propeller: Propeller, at: Condition
) -> Iterator[tuple[str, Polar, tuple[float, float]]]:
    """Data used, polar, and lift coefficients that it is valid for: of the runs, else of steady points."""
    if not any(run.kind in LEVEL_RUNS for run in found):
        others = every_method(trajectory, found, None, (0, 1), aircraft, propeller, at)
        estimate, flown_CL = fallback(others.by_method, trajectory, aircraft, "flight")
        yield "steady points", estimate.polar, flown_CL
        return
    for data, kind in (("all runs", ""), ("one acceleration", "acceleration"), ("one deceleration", "deceleration")):
        chosen = [run for run in found if run.kind.startswith(kind)]
        if kind:
            chosen = sorted(chosen, key=lambda run: run.start_s - run.end_s)[:1]
        yield data, dynamic.estimate_polar(trajectory, chosen, aircraft, propeller).polar, EVERY_LIFT


def stating_thrust(aircraft: Aircraft, budget: ErrorBudget) -> Aircraft:
    """The aircraft file with the standard deviations that the budget draws errors of thrust with."""
    s, root = budget.systematic, math.sqrt(3)
    return replace(
        aircraft,
        uncertainty=replace(
            aircraft.uncertainty,
            thrust_scale_fraction=s.thrust_scale / root,
            thrust_slope=s.thrust_slope_J / root,
            thrust_curvature_fraction=BOW_AT_REST * s.thrust_bow / root,
        ),
    )


def main(
    world: Annotated[str, typer.Option(help="World or error budget.")] = "study",
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "accel-decel",
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    count: Annotated[int, typer.Option("--flights", help="How many; one seed each.")] = 16,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    stated: Annotated[bool, typer.Option("--stated", help="State the world's errors of thrust.")] = False,
    steady: Annotated[bool, typer.Option("--steady", help="By the steady points of the plan alone.")] = False,
    curvature: Annotated[float | None, typer.Option(help="[uncertainty] thrust_curvature, such as 0.")] = None,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    aircraft = load_aircraft("nexstar")
    if stated:
        aircraft = stating_thrust(aircraft, load_world(world).errors)
    if curvature is not None:
        aircraft = replace(aircraft, uncertainty=replace(aircraft.uncertainty, thrust_curvature_fraction=curvature))
    todo = [Job(aircraft, world, plan, turbulence_kt, seed, steady) for seed in range(first_seed, first_seed + count)]
    gathered: dict[str, list[np.ndarray]] = {}
    with ProcessPoolExecutor(jobs) as pool:
        for figures in track(pool.map(one_flight, todo), "flights", total=count, console=Console(stderr=True)):
            for name, values in figures.items():
                gathered.setdefault(name, []).append(values)
    console = Console(width=120)
    console.print(f"{world}{', stated' if stated else ''}, {plan}, W20 = {turbulence_kt:g} kt, seeds from {first_seed}")
    table = Table("power required, errors in %", "", *(f"{ratio} V_stall" for ratio in OVER_STALL), box=None)
    for name, values in gathered.items():
        error, half = np.array(values).transpose(1, 0, 2)
        known = np.isfinite(error).sum(axis=0)
        rms = np.sqrt(np.nansum(error**2, axis=0) / np.where(known, known, np.nan))
        table.add_row(name, "rms", *(f"{x:.1f}" for x in rms))
        for title, row, form in flights.error_rows(error, half):
            table.add_row("", title, *(form.format(x) for x in row))
    console.print(table)
    console.print(f"{len(next(iter(gathered.values()), []))} of {count} flights were flown")


if __name__ == "__main__":
    typer.run(main)
