"""Pools campaigns of simulated flights of one installation: half widths, coverage, detected differences, false alarms.

    python benchmarks/campaigns.py --campaigns 20
    python benchmarks/campaigns.py --campaigns 2 --flights 2 --seed 0 --weather 3 --drawn 200

Systematic errors of installation, propeller and aircraft are drawn once per campaign; IMU biases, transducer zeros and
the updraft once per flight. Configuration B is the same aircraft with 3 % more drag at every lift. Flights are
simulated without buses, counts and log (`benchmarks/flights.py`). When a flight has been analyzed, its statistics for
pooling are written as a line of the file of flights. A flight that has a line from this version of the code is not
flown again, so that an interrupted run continues. Pools of every size use the same flights. Campaigns below 10 are for
development; figures in the documentation come from others (seeds from 1000).
"""

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import campaign_figures
import flights
import msgspec
import numpy as np
import pandas as pd
import typer
from campaign_draws import MORE_DRAG
from estimators import speeds
from numpy.typing import ArrayLike, NDArray

from flightpower.analysis.air.flight_data import Calibrations
from flightpower.analysis.air.probe import ProbeCalibration
from flightpower.analysis.maneuvers.flown import flown_condition, flown_lift
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.maneuvers.runs_file import select
from flightpower.analysis.methods import dynamic
from flightpower.analysis.methods.assumed_values import with_assumption_uncertainty, with_transducer_uncertainty
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.results.assemble import pooling_statistics
from flightpower.analysis.trajectory.observability import prior_conflict, with_misfit
from flightpower.analysis.trajectory.priors import SensorPriors, stated_sigma
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.flight.aircraft import Aircraft, Installation, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth
from flightpower.sim.sensors.budget import DrawnErrors, of_installation
from flightpower.sim.world import World, load_world

ROOT = Path(__file__).parents[1]
PLAN, SEEDS_A_CAMPAIGN = "full-test-flight", 100
FIRST_SEED = {"A": 0, "B": 50, "C": 75}  # first seed of each configuration in a campaign
OF_AIRCRAFT = ("thrust_scale", "thrust_slope_J", "thrust_bow", "windmilling", "weight_scale")  # not of the installation
FOLDERS = ("analysis/air", "analysis/methods", "analysis/estimation", "analysis/maneuvers", "analysis/sources",
           "analysis/trajectory", "flight", "sim")  # fmt: skip


class Job(NamedTuple):
    """One flight of a campaign."""

    world: str
    weather_kt: float
    configuration: str
    campaign: int
    flight: int
    version: str

    @property
    def seed(self) -> int:
        """Seed for the turbulence and the errors of the day."""
        return SEEDS_A_CAMPAIGN * self.campaign + FIRST_SEED[self.configuration] + self.flight


def version(world: str) -> str:
    """Return a hash of everything on which a flight's statistics depend."""
    digest = hashlib.sha256(repr(load_world(world)).encode())
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".toml", ".csv") and path.parent.name != "worlds":
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def errors_of(world: World, job: Job) -> DrawnErrors:
    """Draw installation errors by campaign, errors of the day by the flight's seed. C has another installation."""
    first = SEEDS_A_CAMPAIGN * job.campaign
    installation = flights.draw_errors(world.errors, first)
    if job.configuration == "C":
        other = flights.draw_errors(world.errors, first + FIRST_SEED["C"])
        same = {name: getattr(installation.values, name) for name in OF_AIRCRAFT}
        installation = dataclasses.replace(other, values=dataclasses.replace(other.values, **same))
    return of_installation(flights.draw_errors(world.errors, job.seed), installation)


def aircraft_of(configuration: str, world: World, campaign: int) -> Aircraft:
    """Return the aircraft of a flight; B and C have more drag, which the analysis does not read."""
    aircraft = load_aircraft("nexstar")
    aerodynamics = dict(aircraft.aerodynamics or {})
    if configuration != "A":
        aerodynamics |= {name: (1 + MORE_DRAG) * aerodynamics[name] for name in ("CD0", "K")}
    return dataclasses.replace(
        aircraft,
        aerodynamics=aerodynamics,
        installation=Installation(name=f"campaign {campaign}"),
        uncertainty=world.uncertainty or aircraft.uncertainty,
    )


def analyzed(
    data: flights.AirOf, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller, probe: ProbeCalibration
) -> DynamicEstimate:
    """Analyze a flight as `analyze` does, with larger priors where these conflict with the data."""

    def trajectory_of(air: pd.DataFrame, prior_factor: ArrayLike) -> Trajectory:
        return reconstruct(
            air, data.still,
            SensorPriors(
                probe.alpha_scale_sigma,
                stated_sigma(aircraft.uncertainty, aircraft.wing_loading_Pa),
                factor=prior_factor,
            ),
            gust_length=aircraft.uncertainty.gust_length,
        )  # fmt: skip

    trajectory = trajectory_of(data.table, 1.0)
    conflict = prior_conflict(trajectory)
    if conflict.conflicting:
        trajectory = trajectory_of(data.table, conflict.factor)
    trajectory, _ = with_misfit(trajectory)

    def values_with(air: pd.DataFrame) -> NDArray[np.float64]:
        of_air = trajectory if air is data.table else trajectory_of(air, conflict.factor)
        return dynamic.estimate_values(of_air, runs, aircraft, propeller)

    transducers = with_transducer_uncertainty(None, values_with, data.table, aircraft)
    return with_assumption_uncertainty(dynamic.estimate_polar(trajectory, runs, aircraft, propeller), transducers)


def one_flight(job: Job) -> dict[str, Any]:
    """Return the line of one flight: the part of results.json that pooling reads, and the true power at `speeds`."""
    world, probe = load_world(job.world), flights.tunnel_probe()
    aircraft, errors = aircraft_of(job.configuration, world, job.campaign), errors_of(world, job)
    plan = load_plan(PLAN)
    air = dataclasses.replace(plan.air, turbulence_mps=job.weather_kt * flights.KNOT_MPS)
    plan = world.plan(dataclasses.replace(plan, air=air), job.seed)
    try:
        flown = fly(aircraft, plan, seed=job.seed, deviations=errors.deviations)
        table = flights.sensor_table(FlightSensorTruth(flown, errors), aircraft)
        propeller = world.table(aircraft.propulsion) or load_propeller(aircraft.propulsion.propeller)
        data = flights.air_of(table, aircraft, probe)
        runs = select(data.table, data.still, "log", None).level_runs
        estimate = analyzed(data, runs, aircraft, propeller, probe)
    except (InputError, np.linalg.LinAlgError) as error:
        return {**job._asdict(), "refused": str(error)}
    rows = np.concatenate([np.arange(len(data.table))[run.rows] for run in runs])
    condition = flown_condition(data.table.iloc[rows], aircraft)
    flown_CL = flown_lift(data.table.iloc[rows], aircraft)
    statistics = pooling_statistics(estimate, flown_CL, aircraft, propeller, Calibrations(probe))
    V, truth = speeds(aircraft), flown.power_required
    return {
        **job._asdict(),
        "power_W": np.interp(V, truth["speed_mps"], truth["power_W"]).tolist(),
        "results": {
            "software_version": "",
            "log": f"{job.configuration}{job.seed}.mcap",
            "aircraft": {
                "name": aircraft.name, "title": aircraft.title, "wing_area_m2": aircraft.geometry.wing_area_m2,
                "span_m": aircraft.geometry.span_m, "propeller": propeller.name,
            },
            "test": (test := {"weight_N": condition.weight_N, "air_density_kgpm3": condition.rho}),
            "air": {"temperature_K": float(data.table["temperature_K"].iloc[rows].mean())},
            "kind": Kind.POWER_REQUIRED,
            "curves": {
                Kind.POWER_REQUIRED: {"condition": test, "points": [], "statistics": msgspec.to_builtins(statistics)}
            },
        },
    }  # fmt: skip


class Study(NamedTuple):
    """The flights to fly. most: flights per configuration in a campaign; B and C fly only in the calmest weather."""

    worlds: Sequence[str]
    weather_kt: Sequence[float]
    campaigns: range
    most: Mapping[str, int]


def jobs_of(study: Study) -> Iterator[Job]:
    """Yield all flights, starting with five of each campaign, so that an interrupted run has some of everything."""
    versions = {name: version(name) for name in study.worlds}
    for block in range(0, max(study.most.values()), 5):
        for campaign in study.campaigns:
            for world in study.worlds:
                for weather in study.weather_kt:
                    for configuration in study.most if weather == min(study.weather_kt) else "A":
                        for flight in range(block, min(block + 5, study.most[configuration])):
                            yield Job(world, weather, configuration, campaign, flight, versions[world])


def flown(study: Study, file: Path, jobs: int) -> list[dict[str, Any]]:
    """Return the lines of all requested flights; flights that the file lacks are flown."""
    wanted = {tuple(job): job for job in jobs_of(study)}
    done = flights.fly_missing(file, wanted, one_flight, lambda line: tuple(line[name] for name in Job._fields),
                               jobs=jobs, summary=lambda line: line.get("refused", ""))  # fmt: skip
    return [done[identity] for identity in wanted]


def main(
    worlds: Annotated[list[str] | None, typer.Option("--worlds", help="Worlds; `study`.")] = None,
    weather_kt: Annotated[list[float] | None, typer.Option("--weather", help="W20 of turbulence [kt]; 3, 15.")] = None,
    campaigns: Annotated[int, typer.Option(help="Campaigns: installations.")] = 20,
    first: Annotated[int, typer.Option("--seed", help="The first campaign; its flights have 100 times this.")] = 10,
    most: Annotated[int, typer.Option("--flights", help="Flights of configuration A in each weather.")] = 20,
    with_B: Annotated[int, typer.Option("--flights-b", help="Flights of configuration B in the calmest weather.")] = 5,
    with_C: Annotated[int, typer.Option("--flights-c", help="The same of C, with a false installation name.")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    file: Annotated[Path, typer.Option(help="Where flights are kept, one a line.")] = Path("out/campaigns.jsonl"),
    draws: Annotated[int, typer.Option(help="Campaigns drawn from the flights' statistics, a row.")] = 0,
    fly_missing: Annotated[
        bool, typer.Option("--fly/--no-fly", help="Fly what is missing; or print the figures of what is in the file.")
    ] = True,
) -> None:
    """Fly what is missing and print the figures."""
    study = Study(worlds or ["study"], weather_kt or [3.0, 15.0], range(first, first + campaigns),
                  {"A": most, "B": with_B, "C": with_C})  # fmt: skip
    if not fly_missing:
        places = {tuple(job)[:-1] for job in jobs_of(study)}  # flights from any version of the code
        campaign_figures.print_figures(
            [line for line in flights.known_lines(file) if tuple(line[n] for n in Job._fields[:-1]) in places], draws
        )
        return
    campaign_figures.print_figures(flown(study, file, jobs), draws)


if __name__ == "__main__":
    typer.run(main)
