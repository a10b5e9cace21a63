"""Every method over many simulated flights: error, width and coverage of its interval, and causes of disagreements.

    python benchmarks/methods.py --errors study --flights 12
    python benchmarks/methods.py --errors bench --wrong alpha_offset_rad=0.02

Simulates flights and sensors (no buses, no counts), analyses, and compares with the simulator's true curve within each
method's range of speeds. `--wrong` sets one error of the budget to a given value instead of drawing it. docs/methods.md
quotes what this prints.
"""

import dataclasses
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import Annotated, NamedTuple

import flights
import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from analysis.airdata.probe import ProbeCalibration
from analysis.drag.comparison import MethodDisagreement
from analysis.drag.dynamic import DynamicEstimate, estimate_polar
from analysis.drag.estimate import every_method
from analysis.drag.method import MethodEstimate
from analysis.estimation.noise import NORMAL_95
from analysis.flown import flown_condition, flown_lift
from analysis.maneuvers.find import find
from analysis.maneuvers.kinds import LEVEL_RUNS
from analysis.polar import Condition, Polar, lift_coefficient, power_required
from analysis.trajectory.reconstruction import reconstruct
from flight.aircraft import Aircraft, load_aircraft
from flight.propeller_files import load_propeller
from sim.sensors import load_budget
from sim.sensors.budget import DrawnErrors, ErrorBudget

OVER_STALL = (1.2, 1.4, 1.7, 2.0, 2.3)


class Flown(NamedTuple):
    """One simulated flight: air data, where it stood, the true curve at its density.

    segments : kind, start_s, end_s of each segment of the plan
    """

    table: pd.DataFrame
    still: list[slice]
    truth: pd.DataFrame
    segments: pd.DataFrame


class Analyzed(NamedTuple):
    """The estimates of all methods from one flight."""

    dynamic: DynamicEstimate
    flown_CL: tuple[float, float]
    estimates: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[MethodDisagreement]
    at: Condition


def drawn(budget: ErrorBudget, seed: int, **wrong: float) -> DrawnErrors:
    """Random errors of one day, those in `wrong` set: names of `Systematic`, or `accel_x_bias`, `pitch_tilt`."""
    errors = flights.drawn(budget, seed)
    if "accel_x_bias" in wrong:
        errors = dataclasses.replace(errors, accel_bias=np.array([wrong.pop("accel_x_bias"), 0.0, 0.0]))
    if "pitch_tilt" in wrong:
        c, s = np.cos(wrong["pitch_tilt"]), np.sin(wrong.pop("pitch_tilt"))
        errors = dataclasses.replace(errors, imu_rotation=np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))
    return dataclasses.replace(errors, values=dataclasses.replace(errors.values, **wrong))


def fly(
    aircraft: Aircraft, probe: ProbeCalibration, errors: DrawnErrors, plan_name: str, turbulence_kt: float, seed: int
) -> Flown:
    flight, _, table = flights.flown(aircraft, errors, plan_name, seed, turbulence_kt)
    table["throttle"] = np.interp(table.index, flight.truth["time_s"], flight.truth["throttle"].fillna(0.0))
    air, still, _ = flights.air_of(table, aircraft, probe)
    segments = flight.truth.groupby("segment").agg(
        kind=("kind", "first"), start_s=("time_s", "first"), end_s=("time_s", "last")
    )
    return Flown(air, still, flight.power_required, segments)


def analyzed(aircraft: Aircraft, flown: Flown) -> Analyzed:
    propeller = load_propeller(aircraft.propulsion.propeller)
    found = find(flown.table, flown.still)
    level = found.of(*LEVEL_RUNS)
    trajectory = reconstruct(flown.table, flown.still)
    estimate = estimate_polar(trajectory, level, aircraft, propeller)
    rows = pd.concat([flown.table.iloc[run.rows] for run in level])
    at, flown_CL = flown_condition(rows, aircraft), flown_lift(rows, aircraft)
    others = every_method(trajectory, found.maneuvers, estimate, flown_CL, aircraft, propeller, at)
    return Analyzed(estimate, flown_CL, others.by_method, others.one_by_one, others.disagreements, at)


def compared(
    polar: Polar, flown_CL: tuple[float, float], V: np.ndarray, truth: np.ndarray, at: Condition
) -> np.ndarray:
    """Error and half the 95 % interval in per cent (2, speeds); NaN outside the method's range of speeds."""
    power, error = power_required(V, polar, at)
    CL = lift_coefficient(V, at)
    seen = (CL >= 0.98 * flown_CL[0]) & (CL <= 1.02 * flown_CL[1])
    return np.where(seen, 100 * np.stack([power / truth - 1, NORMAL_95 * error / truth]), np.nan)


class Job(NamedTuple):
    """One flight to simulate and to analyze."""

    aircraft: Aircraft
    probe: ProbeCalibration
    errors: str
    wrong: dict[str, float]
    plan: str
    turbulence_kt: float
    seed: int
    V: np.ndarray  # speeds to compare at


def one_flight(job: Job) -> tuple[list[tuple[str, np.ndarray]], list[str]]:
    """Title of each method and its curve compared with the truth; causes of disagreements."""
    flown = fly(
        job.aircraft, job.probe, drawn(load_budget(job.errors), job.seed, **job.wrong),
        job.plan, job.turbulence_kt, job.seed,
    )  # fmt: skip
    result = analyzed(job.aircraft, flown)
    truth = np.interp(job.V, flown.truth["speed_mps"], flown.truth["power_W"])
    curves = [("dynamic", result.dynamic.polar, result.flown_CL)]
    curves += [(e.method.title, e.polar, e.flown_CL) for e in result.estimates if e.polar is not None]
    curves += [("each run alone", e.polar, e.flown_CL) for e in result.one_by_one if e.polar is not None]
    figures = [(title, compared(polar, flown_CL, job.V, truth, result.at)) for title, polar, flown_CL in curves]
    return figures, [f"{one.first} - {one.second}: {one.cause}" for one in result.disagreements]


def main(
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "full-test-flight",
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    count: Annotated[int, typer.Option("--flights", help="How many; one seed each.")] = 12,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    wrong: Annotated[list[str] | None, typer.Option(help="NAME=VALUE: one error set instead of drawn.")] = None,
    aircraft_name: Annotated[str, typer.Option("--aircraft", help="Aircraft.")] = "nexstar",
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    aircraft, probe = load_aircraft(aircraft_name), flights.tunnel_probe()
    given = {name: float(value) for name, _, value in (text.partition("=") for text in wrong or [])}
    V = np.array(OVER_STALL) * flights.stall_mps(aircraft)
    gathered: dict[str, list[np.ndarray]] = {}
    causes: Counter[str] = Counter()
    console = Console(width=140)
    todo = [
        Job(aircraft, probe, errors, given, plan, turbulence_kt, seed, V)
        for seed in range(first_seed, first_seed + count)
    ]
    with ProcessPoolExecutor(jobs) as pool:
        for figures, found in track(pool.map(one_flight, todo), "flights", total=count, console=Console(stderr=True)):
            for title, values in figures:
                gathered.setdefault(title, []).append(values)
            causes.update(found)
    console.print(f"{errors} {given or ''}, {plan}, W20 = {turbulence_kt:g} kt, {count} flights from seed {first_seed}")
    table = Table("method", "", *(f"{v:.1f} m/s" for v in V), box=None)
    rows = []
    for title, curves in gathered.items():
        error, half = np.array(curves).transpose(1, 0, 2)
        rows.append(flights.as_markdown(title, error, half))
        for name, row, form in flights.error_rows(error, half):
            table.add_row(title, name, *(form.format(x) if np.isfinite(x) else "-" for x in row))
            title = ""
    console.print(table)
    print("", *rows, "", sep="\n")
    console.print("causes of disagreements:")
    for text, count in causes.most_common():
        console.print(f"  {count:3d} x {text}")


if __name__ == "__main__":
    typer.run(main)
