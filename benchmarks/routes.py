"""Compares missions flown by the simulator in wind with the prediction of `flightpower route`.

    python benchmarks/routes.py --flights 5                      # seeds below 1000 are for development
    python benchmarks/routes.py --seed 1000 --flights 200 --jobs 2
    python benchmarks/routes.py --seed 1000 --flights 200 --jobs 2 --curve 5
    python benchmarks/routes.py --seed 1000 --flights 20 --curve 5 --wind-sd 0    # errors of curve and turbulence only

A seed draws an installation, of which one flight is analyzed, or several flights on different days are pooled. The
performance model, the weight and the air go into the prediction. The seed also draws a mission of a few legs with
climbs, and the wind; the prediction gets a wind with an error drawn from its standard deviation. The simulator's
autopilot flies the mission in the true wind and matching Dryden turbulence, with an airspeed error. The truth is the
battery's mean power times the time that courses and distances take in the true wind, because the simulator needs some
seconds more or less to level off and roll out.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Annotated, Any, NamedTuple

import answers
import flights
import msgspec
import numpy as np
import typer
from flights import Setup, stall_mps
from records import Record, counted, markdown, rounded
from rich.console import Console
from rich.progress import track

from flightpower.analysis.air.flight_data import Calibrations
from flightpower.analysis.curve import Condition
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.flights.power_train import pooled_use
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.missions.energy import Battery, ground_speed
from flightpower.analysis.missions.mission import HOME, Mission, Place, Step, Wind
from flightpower.analysis.missions.power import aerodynamic_source
from flightpower.analysis.missions.prediction import RESOLUTION, Air, Flight, Route
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.stored_model import model_of, model_result
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.results.assemble import pooling_statistics
from flightpower.analysis.trajectory import dryden
from flightpower.flight.aircraft import Aircraft, Installation, load_aircraft
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.air import WIND_HEIGHT_M, ambient
from flightpower.sim.air import Air as SimulatedAir
from flightpower.sim.fly import fly
from flightpower.sim.pilot import pilot_named, wrap_angle
from flightpower.sim.plan import Plan
from flightpower.sim.segments import LEVEL_OFF_S, ROLL_OUT_S, ClimbSegment, HoldSegment, TurnSegment
from flightpower.sim.sensors.budget import of_installation
from flightpower.sim.world import load_world

WIND_SD_MPS = 1.0
STRONGEST_MPS = 8.0
SETTLING_S = 20.0  # time at the first course and speed before the mission begins
BANK_RAD = 0.6
DAYS = 100  # number of seeds for an installation
AIRCRAFT = ("nexstar", "light-1kg", "survey-6kg")


class Flown(NamedTuple):
    """Energy [Wh] and time [s] flown, share of draws below that energy, and the prediction's median and limits."""

    energy_Wh: float
    time_s: float
    share_below: float
    median_Wh: float
    low_Wh: float
    high_Wh: float
    wind_mps: float


def mission_of(rng: np.random.Generator, leg_m: float) -> Mission:
    """Draw three to five legs on courses that turn by 40 to 140 deg, half of them with a climb or descent."""
    place, course, steps = HOME._replace(height_m=80.0), rng.uniform(0, 2 * np.pi), []
    for number in range(int(rng.integers(3, 6))):
        distance_m = leg_m * rng.uniform(0.6, 1.4)
        height_m = float(np.clip(place.height_m + rng.choice([0.0, rng.uniform(-40, 40)]), 40.0, 150.0))
        place = Place(place.east_m + distance_m * np.sin(course), place.north_m + distance_m * np.cos(course), height_m)
        steps.append(Step(f"leg {number + 1}", place))
        course += rng.choice([-1, 1]) * np.radians(rng.uniform(40, 140))
    return Mission(HOME._replace(height_m=80.0), tuple(steps))


def plan_of(route: Route, wind: Wind, air: SimulatedAir, airspeed: float) -> tuple[Plan, float]:
    """Return a plan that holds the courses, after SETTLING_S, and its time [s]. airspeed: flown over wanted"""
    legs, V = route.legs, route.V * airspeed
    across = wind.east_mps * np.cos(legs.course_rad) - wind.north_mps * np.sin(legs.course_rad)
    heading = legs.course_rad - np.arcsin(across / V)
    seconds = legs.distance_m / ground_speed(V, legs.course_rad, np.array(wind.east_mps), np.array(wind.north_mps))
    segments: list[Any] = [HoldSegment(duration_s=SETTLING_S, speed_mps=float(V[0]))]
    height_m = route.mission.start.height_m
    for i, step in enumerate(route.mission.steps):
        left_s, v = float(seconds[i]), float(V[i])
        if i > 0:
            angle = wrap_angle(float(heading[i] - heading[i - 1]))
            segments.append(TurnSegment(angle_rad=angle, bank_rad=BANK_RAD, speed_mps=v))
            left_s -= max(abs(angle) - 0.35, 0.0) * v / (GRAVITY_MPS2 * np.tan(BANK_RAD)) + ROLL_OUT_S
        climb_m = step.to.height_m - height_m
        if abs(climb_m) > 1.0:
            rate_mps = min(abs(climb_m) / max(left_s - LEVEL_OFF_S / 2, 1.0), float(legs.rate_mps[i]))
            segments.append(ClimbSegment(height_m=step.to.height_m, climb_mps=rate_mps, speed_mps=v))
            left_s -= abs(climb_m) / rate_mps + LEVEL_OFF_S / 2
            height_m = step.to.height_m
        if left_s > 0.5:
            segments.append(HoldSegment(duration_s=left_s, speed_mps=v))
    plan = Plan(
        name="route", title="", segments=tuple(segments), air=air, pilot=pilot_named("autopilot"),
        heading_rad=float(heading[0]), height_m=route.mission.start.height_m,
    )  # fmt: skip
    return plan, float(np.sum(np.maximum(seconds, np.abs(legs.climb_m) / legs.rate_mps)))


def curve_of(setup: Setup, count: int, craft: Aircraft) -> tuple[PerformanceModel, Condition]:
    """Return the curve of `count` flights of the seed's installation, each with its own errors and gusts."""
    if count == 1:
        model, condition, *_ = answers.estimated(setup)
        return model, condition
    named = replace(craft, installation=Installation(name="study"))
    results: list[dict[str, Any]] = []
    for seed in range(DAYS * setup.seed, DAYS * setup.seed + count):
        day = flights.draw_errors(load_world(setup.world).errors, seed)
        curve = answers.estimated(setup._replace(seed=seed), errors=of_installation(day, setup.drawn_errors))
        statistics = pooling_statistics(
            curve.drag, curve.model.flown_CL, named, curve.model.propeller, Calibrations(flights.tunnel_probe())
        )
        results.append({
            "log": f"{seed}.mcap",
            "aircraft": {
                "name": craft.name, "title": craft.title, "wing_area_m2": craft.geometry.wing_area_m2,
                "span_m": craft.geometry.span_m, "propeller": curve.model.propeller.name,
            },
            "software_version": "",
            "test": (test := {"weight_N": curve.condition.weight_N, "air_density_kgpm3": curve.condition.rho}),
            "kind": Kind.POWER_REQUIRED,
            "curves": {
                Kind.POWER_REQUIRED: {"condition": test, "points": [], "statistics": msgspec.to_builtins(statistics)}
            },
            "battery": {"energy_Wh": 1.0, "usable": 1.0},
            "use": {"power_train": {"measured": True}, "model": msgspec.to_builtins(model_result(curve.model))},
        })  # fmt: skip
    pool = joint_pool(results)
    use = pooled_use(pool)
    assert use is not None
    return model_of(use.model), pool.condition


def one_mission(seed: int, aircraft: str, world: str, curve: int = 1, wind_sd_mps: float = WIND_SD_MPS) -> Flown:
    rng = np.random.default_rng([seed, 50])
    craft = load_aircraft(aircraft)
    setup = Setup(aircraft, world, "full-test-flight", 3.0, seed)
    model, condition = curve_of(setup, curve, craft)
    sources = aerodynamic_source(model, condition, 0.0, (RESOLUTION.draws, rng))
    wind_mps, direction = rng.uniform(0, STRONGEST_MPS), rng.uniform(0, 2 * np.pi)
    true = Wind(wind_mps * np.sin(direction), wind_mps * np.cos(direction), 0.0)
    forecast = Wind(*(np.array(true[:2]) + wind_sd_mps * rng.standard_normal(2)).tolist(), wind_sd_mps)
    simulated = SimulatedAir(
        wind_mps=wind_mps * profile(WIND_HEIGHT_M) / profile(80.0),
        wind_from_rad=direction + np.pi,
        turbulence_mps=wind_mps * profile(WIND_HEIGHT_M) / profile(80.0),
    )
    ground = ambient(simulated, 0.0)
    battery = Battery(3600 * (craft.propulsion.battery_energy_Wh or 74.0), reserve=0.2)
    assumed = Flight(
        forecast,
        battery,
        Air(float(ground.pressure), float(ground.temperature)),
        craft.mass.weight_N,
        stall_mps=stall_mps(craft),
    )
    leg_m = 60.0 * float(np.sqrt(2 * condition.weight_N / (condition.rho * condition.wing_area_m2)))
    route = Route(sources, mission_of(rng, leg_m), assumed, rng)
    plan, time_s = plan_of(route, true, simulated, 1 + GPS.scale_sigma * rng.standard_normal())
    flight = fly(craft, plan, seed=seed, deviations=setup.drawn_errors.deviations)
    truth = flight.truth
    after = truth[truth["time_s"] >= SETTLING_S]
    energy_J = time_s * float(np.ptp(after["battery_energy_J"]) / np.ptp(after["time_s"]))
    drawn_J = route.left()[0].sum(axis=1)
    low, median, high = np.quantile(drawn_J, [0.025, 0.5, 0.975]) / 3600
    return Flown(
        energy_J / 3600,
        time_s,
        float(np.mean(drawn_J < energy_J)),
        float(median),
        float(low),
        float(high),
        float(wind_mps),
    )


def profile(height_m: float) -> float:
    return float(dryden.mean_wind_profile(height_m))


def main(
    seed: Annotated[int, typer.Option(help="Of the first flight; those of the next aircraft follow.")] = 0,
    flights: Annotated[int, typer.Option(help="Missions of each aircraft.")] = 5,
    aircraft: Annotated[list[str] | None, typer.Option(help="May be repeated.")] = None,
    world: Annotated[str, typer.Option(help="World or error budget of the analyzed flight.")] = "study",
    curve: Annotated[int, typer.Option(help="Flights that give the curve.")] = 1,
    wind_sd: Annotated[float, typer.Option(help="Of each component of the wind that is said, m/s.")] = WIND_SD_MPS,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    print(markdown(records(aircraft or AIRCRAFT[:1], world, range(seed, seed + flights), curve, jobs, wind_sd)))


def records(
    aircraft: Sequence[str], world: str, seeds: range, curve: int, jobs: int, wind_sd_mps: float = WIND_SD_MPS
) -> list[Record]:
    """Return a record per aircraft, and one for all.

    Each aircraft has its own seeds; with a common seed, two aircraft would have the same wind and errors.
    """
    flights: dict[str, list[Flown]] = {}
    with ProcessPoolExecutor(jobs) as pool:
        for i, name in enumerate(aircraft):
            own = range(seeds.start + i * len(seeds), seeds.start + (i + 1) * len(seeds))
            lines = pool.map(
                partial(one_mission, aircraft=name, world=world, curve=curve, wind_sd_mps=wind_sd_mps), own
            )
            flights[name] = list(track(lines, f"missions of {name}", total=len(seeds), console=Console(stderr=True)))
    every = {"all": [*chain.from_iterable(flights.values())]} if len(flights) > 1 else {}
    return [_record(name, curve, lines) for name, lines in (flights | every).items()]


def _record(aircraft: str, curve: int, lines: Sequence[Flown]) -> Record:
    """Return errors, intervals and safe returns over missions."""
    below = np.array([flown.share_below for flown in lines])
    error = np.array([flown.median_Wh / flown.energy_Wh - 1 for flown in lines])
    ends = np.array([(flown.low_Wh, flown.high_Wh) for flown in lines])
    half = np.where(np.isfinite(ends[:, 1]), np.diff(np.nan_to_num(ends))[:, 0] / 2, np.inf)
    half /= [flown.energy_Wh for flown in lines]
    inside, counting = counted((below > 0.025) & (below < 0.975))
    returns = {
        f"return, {100 * probability:.0f} % said": rounded(100 * np.mean(below < probability))
        for probability in (0.5, 0.8, 0.95)
    }
    return {
        "aircraft": aircraft, "flights of the curve": curve, "missions": len(lines),
        "error, median, %": rounded(100 * np.median(np.abs(error)), 1), "mean, %": rounded(100 * np.mean(error), 1),
        "half width, %": rounded(100 * np.median(half), 1), "coverage, %": rounded(inside), "±": rounded(counting, 1),
        **returns,
    }  # fmt: skip


if __name__ == "__main__":
    typer.run(main)
