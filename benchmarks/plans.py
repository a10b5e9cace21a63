"""Compares planned flights with the shipped plan of the same length, flown in the simulator and analyzed.

    python benchmarks/plans.py --flights 60 --seed 1000 -o out/plans.jsonl
    python benchmarks/plans.py --cells 15:21 --flights 4 --seed 0

A cell is a turbulence W20 [kt] and a length [min]. Each flight is one line of the output file. Flights that are already
in the file are not flown again, so that an interrupted run continues.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import estimators
import flights
import numpy as np
import pandas as pd
import typer
from records import Record, counted, markdown, rounded

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.methods import dynamic
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.information import half_widths
from flightpower.analysis.missions.pieces import Hold, Land, Maneuver, Pilot, Porpoise, Run, Space, Stand, TakeOff, Turn
from flightpower.analysis.missions.search import Request, plan_flight, predicted
from flightpower.analysis.missions.simulator_plan import simulator_plan
from flightpower.analysis.missions.time_history import fly
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors import load_budget

SHIPPED = "full-test-flight"
BY_HAND = Pilot(autopilot=False, load=1.0)
HEIGHT_M, LEG_M = 40.0, 1300.0  # height and leg length of the shipped plan
KEY = ("aircraft", "question", "kt", "minutes", "plan", "pilot", "seed")
EARLIER_SEED = 999  # seed of the first flight, after which further flights are planned


def make_plans(
    aircraft_name: str,
    kt: float,
    minutes: float,
    question: str,
    folder: Path,
    *,
    known_drag: bool,
    pilot: Pilot = BY_HAND,
) -> dict[str, Any]:
    """Write a cell's planned and shipped plan. Returns paths and predicted half widths [%] at estimators.speeds.

    known_drag: plan after a first flight, full-test-flight in calm air, as with `flightpower plan --after`; only the
    drag in that flight's results is used.
    """
    name = f"{aircraft_name}-{question}-{kt:g}-{minutes:g}" + ("-after" if known_drag else "")
    cache = folder / f"{name}.json"
    if cache.is_file():
        plans: dict[str, Any] = json.loads(cache.read_text("utf-8"))
        return plans
    aircraft = load_aircraft(aircraft_name)
    A = analyzed(aircraft, SHIPPED, 0.0, EARLIER_SEED)[0].A if known_drag else None
    expected = expected_aircraft(aircraft, HEIGHT_M, A=A)
    request = Request(minutes, kt, Space(LEG_M, HEIGHT_M), pilot, question=question)
    plan = plan_flight(expected, request)
    shipped = shortened(expected, minutes)
    cell: dict[str, Any] = {}
    for which, text, covariances in (
        ("planned", simulator_plan(plan.maneuvers, expected, request), plan.covariances),
        ("shipped", simulator_plan(shipped, expected, request), predicted(shipped, expected, request)),
    ):
        path = folder / f"{name}-{which}.toml"
        path.write_text(text, "utf-8")
        cell[which] = {
            "path": str(path),
            "predicted": half_widths(covariances, expected, estimators.speeds(aircraft)).tolist(),
        }
    cache.write_text(json.dumps(cell), "utf-8")
    return cell


def shortened(expected: ExpectedAircraft, minutes: float) -> list[Maneuver]:
    """Return the shipped plan, full-test-flight, with fewer runs and steady points to fit a shorter time."""
    stall, fastest = expected.stall_mps, expected.fastest_mps
    turn = Turn(1.7 * stall, -np.pi)
    points = [(90.0, 1.2), (90.0, 1.15), (60.0, 1.25), None, (60.0, 1.4), None, (60.0, 1.7)]
    fast = [(60.0, 0.77 * fastest / stall), (60.0, 0.85 * fastest / stall)]
    pairs = max(1, round(5 * minutes / 21))
    fewer_points = {5: [*points, *fast], 4: [points[0], points[2], None, points[4], None, *fast]}.get(
        pairs, [points[0], None, points[6]]
    )

    def plan(share: float) -> list[Maneuver]:
        maneuvers: list[Maneuver] = [Stand(90.0), TakeOff(1.6 * stall)]
        for _ in range(pairs):
            maneuvers += [Hold(20.0, 1.12 * stall), Run(0.87, 13.0, 0.92 * fastest), Hold(10.0, 0.92 * fastest)]
            maneuvers += [Run(0.495, 2.5, 1.05 * stall), Hold(6.0, 1.3 * stall), Turn(1.7 * stall)]
        for point in fewer_points:
            if point is None:
                maneuvers += [Hold(6.0, 1.5 * stall), Porpoise(40.0 * share, 1.5 * stall, 0.7)]
            else:
                maneuvers += [Hold(point[0] * share, point[1] * stall), turn]
        return [*maneuvers, Hold(8.0, 1.3 * stall), Run(1.0, 1.0, 0.95 * fastest), Land(1.6 * stall), Stand(30.0)]

    low, high = 0.1, 1.0
    for _ in range(6):
        share = (low + high) / 2
        seconds = fly(plan(share), expected, HEIGHT_M, 3.0).starts_s[-1]
        low, high = (share, high) if seconds < 60 * minutes else (low, share)
    return plan(low)


def analyzed(aircraft: Aircraft, plan: str, kt: float, seed: int) -> tuple[Polar, flights.Flown, pd.DataFrame]:
    """Return the drag polar of a simulated flight, the flight, and its table of air data.

    Raises InputError if the estimation has not converged, so that `analyze` does not trust the curve.
    """
    probe = flights.tunnel_probe()
    flown = flights.flown(aircraft, flights.draw_errors(load_budget("study"), seed), plan, seed, kt)
    propeller = load_propeller(aircraft.propulsion.propeller or "")
    air, still, _ = flights.air_of(flown.table, aircraft, probe)
    runs, _ = find_runs(air)
    trajectory = reconstruct(air, still, SensorPriors(alpha_scale_sigma=probe.alpha_scale_sigma))
    estimate = dynamic.estimate_polar(trajectory, runs, aircraft, propeller)
    if not estimate.status.usable:
        raise InputError(f"{estimate.status}: gusts of {trajectory.gust_mps:.1f} m/s")
    return estimate.polar, flown, air


class Job(NamedTuple):
    """A flight to fly: the values of KEY, the predicted half widths, and the plan."""

    row: dict[str, Any]
    plan: str


def one_flight(job: Job) -> dict[str, Any]:
    """Return errors and half widths [% of the truth] at estimators.speeds, or why the flight ended too soon."""
    aircraft = load_aircraft(job.row["aircraft"])
    try:
        polar, flown, air = analyzed(aircraft, job.plan, job.row["kt"], job.row["seed"])
    except (InputError, np.linalg.LinAlgError, ValueError) as error:
        return {**job.row, "lost": str(error)}
    condition = Condition(
        aircraft.mass.weight_N, float(air.loc[air["flying"], "rho"].mean()), aircraft.geometry.wing_area_m2
    )
    V, truth = estimators.speeds(aircraft), flown.flight.power_required
    true_W = np.interp(V, truth["speed_mps"], truth["power_W"])
    power, sigma = power_required(V, polar, condition)
    return {
        **job.row,
        "error": (100 * (power / true_W - 1)).tolist(),
        "half": (100 * NORMAL_95 * sigma / true_W).tolist(),
        "seconds": float(air.index[-1]),
    }


def main(
    cells: Annotated[str, typer.Option(help="W20 [kt]:minutes, separated by commas.")] = (
        "15:21,3:21,0:21,15:15,3:15,0:15,15:8,3:8,0:8"
    ),
    count: Annotated[int, typer.Option("--flights", help="A cell and plan; one seed each.")] = 60,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    aircraft: Annotated[str, typer.Option(help="Aircraft.")] = "nexstar",
    question: Annotated[str, typer.Option("--question", help="What is planned for.")] = "curve",
    only: Annotated[str, typer.Option(help="planned, shipped, or both.")] = "both",
    known_drag: Annotated[bool, typer.Option(help="Plan with the drag that a first flight has found.")] = False,
    pilot: Annotated[str, typer.Option(help="exact, or average, off by 10 deg, 8 m and 1 m/s.")] = "exact",
    processes: Annotated[int, typer.Option("--jobs", help="Processes.")] = 2,
    output: Annotated[Path, typer.Option("-o", "--output", help="Lines of JSON, one a flight.")] = Path("plans.jsonl"),
) -> None:
    """Fly cell by cell and seed by seed, and print the table of all flights so far."""
    wanted = [(float(kt), float(minutes)) for kt, minutes in (cell.split(":") for cell in cells.split(","))]
    seeds = range(first_seed, first_seed + count)
    print(
        markdown(records(flown(Study(aircraft, question, wanted, seeds, known_drag, pilot, only), output, processes)))
    )


class Study(NamedTuple):
    """The flights to fly. cells: W20 [kt] and length [min]."""

    aircraft: str
    question: str
    cells: list[tuple[float, float]]
    seeds: range
    known_drag: bool = False
    pilot: str = "exact"
    only: str = "both"


def flown(study: Study, output: Path, jobs: int) -> list[dict[str, Any]]:
    """Return the lines of the requested flights and any others in the file; missing flights are flown."""
    output.parent.mkdir(parents=True, exist_ok=True)
    made = {cell: make_plans(study.aircraft, *cell, study.question, output.parent, known_drag=study.known_drag)
            for cell in study.cells}  # fmt: skip
    question = f"{study.question}, drag known" if study.known_drag else study.question
    wanted = {}
    for seed in study.seeds:
        for kt, minutes in study.cells:
            for name in ("planned", "shipped") if study.only == "both" else (study.only,):
                plan = made[kt, minutes][name]
                path = plan["path"] if study.pilot == "exact" else _flown_by_average_pilot(Path(plan["path"]))
                key = (study.aircraft, question, kt, minutes, name, study.pilot, seed)
                wanted[key] = Job(dict(zip(KEY, key, strict=True)) | {"predicted": plan["predicted"]}, path)
    flown_rows = flights.fly_missing(
        output, wanted, one_flight, lambda row: tuple(row[name] for name in KEY), jobs=jobs,
        summary=lambda row: row.get("lost", ""),
    )  # fmt: skip
    return list(flown_rows.values())


WANDER = '\n[wander]\nbank = "{bank} deg"\nheight = "{height} m"\nspeed = "{speed} m/s"\n'


def _flown_by_average_pilot(path: Path) -> str:
    """Return the plan, flown by a pilot who wanders in bank, height and speed."""
    new = path.with_name(path.stem + "-average.toml")
    text = path.read_text("utf-8")
    new.write_text(text.replace("\n[[segment]]", WANDER.format(bank=10, height=8, speed=1) + "\n[[segment]]", 1))
    return str(new)


def records(rows: Iterable[dict[str, Any]]) -> list[Record]:
    """Return a row per cell and plan: half widths at estimators.speeds, the worst of them, and its ratios."""
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("aircraft", "question", "kt", "minutes", "pilot", "plan"))
        groups.setdefault(key, []).append(row)
    worst: dict[tuple[Any, ...], float] = {}
    records = []
    for key in sorted(groups, key=lambda key: (*key[:5], key[5] != "shipped")):
        flown = [row for row in groups[key] if "half" in row]
        if not flown:
            continue
        half = np.median([row["half"] for row in flown], axis=0)
        share, counting = counted([np.mean(np.abs(row["error"]) < np.array(row["half"])) for row in flown])
        worst[key] = float(np.max(half))
        shipped = worst.get((*key[:5], "shipped"))
        name = f"{key[0]}, {key[1]}" + (f", {key[4]} pilot" if key[4] != "exact" else "")
        records.append({
            "aircraft, question": name, "W20, kt": f"{key[2]:g}", "min": f"{key[3]:g}", "plan": key[5],
            "flights": len(flown), "lost": len(groups[key]) - len(flown), "half width": rounded(half, 1),
            "worst": rounded(worst[key], 2),
            "coverage, %": rounded(share), "±": rounded(counting, 1),
            "predicted/obtained": rounded(np.max(flown[0]["predicted"]) / np.max(half), 2),
            "to shipped": rounded(worst[key] / shipped, 2) if shipped and key[5] == "planned" else None,
        })  # fmt: skip
    return records


if __name__ == "__main__":
    typer.run(main)
