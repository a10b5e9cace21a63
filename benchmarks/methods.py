"""Tests every method on many simulated flights: error, width and coverage of intervals, causes of disagreements.

It simulates flights and sensors (without buses and counts), analyzes, and compares with the simulator's true curve
within each method's range of speeds. `python benchmarks/study.py methods` prints the results.
"""

import dataclasses
from typing import NamedTuple

import flights
import numpy as np
import pandas as pd
from flights import Rows, Setup

from flightpower.analysis.air.probe import ProbeCalibration
from flightpower.analysis.curve import Condition, Polar, lift_coefficient, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.flown import flown_condition, flown_lift
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS
from flightpower.analysis.methods.dynamic import DynamicEstimate, estimate_polar
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.methods import every_method
from flightpower.analysis.records.flight import DisagreementResult
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors.budget import DrawnErrors, ErrorBudget
from flightpower.sim.world import load_world

OVER_STALL = (1.2, 1.4, 1.7, 2.0, 2.3)


class Flown(NamedTuple):
    """One simulated flight: air data, stretches at rest, and the true curve at its density.

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
    single_runs: list[MethodEstimate]
    disagreements: list[DisagreementResult]
    condition: Condition


def draw_errors(budget: ErrorBudget, seed: int, **wrong: float) -> DrawnErrors:
    """Draw one day's errors and set those in `wrong`: names of `Systematic`, or `accel_x_bias`, `pitch_tilt`."""
    errors = flights.draw_errors(budget, seed)
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
    maneuvers = find(flown.table, flown.still)
    level = maneuvers.of(*LEVEL_RUNS)
    trajectory = reconstruct(flown.table, flown.still)
    estimate = estimate_polar(trajectory, level, aircraft, propeller)
    rows = pd.concat([flown.table.iloc[run.rows] for run in level])
    condition, flown_CL = flown_condition(rows, aircraft), flown_lift(rows, aircraft)
    others = every_method(
        trajectory, maneuvers.maneuvers, aircraft, propeller, condition, dynamic=estimate, dynamic_CL=flown_CL
    )
    return Analyzed(estimate, flown_CL, others.by_method, others.single_runs, others.disagreements, condition)


def compared(
    polar: Polar, flown_CL: tuple[float, float], V: np.ndarray, truth: np.ndarray, condition: Condition
) -> np.ndarray:
    """Return error and half the 95 % interval in percent (2, speeds); NaN outside the method's range of speeds."""
    power, error = power_required(V, polar, condition)
    CL = lift_coefficient(V, condition)
    seen = (CL >= 0.98 * flown_CL[0]) & (CL <= 1.02 * flown_CL[1])
    return np.where(seen, 100 * np.stack([power / truth - 1, NORMAL_95 * error / truth]), np.nan)


def one_flight(setup: Setup, **wrong: float) -> Rows:
    """Return each method's curve; causes of disagreement are titles without figures. wrong: as in `draw_errors`"""
    aircraft = load_aircraft(setup.aircraft)
    errors = draw_errors(load_world(setup.world).errors, setup.seed, **wrong)
    flown = fly(aircraft, flights.tunnel_probe(), errors, setup.plan, setup.turbulence_kt, setup.seed)
    result, V = analyzed(aircraft, flown), speeds(aircraft)
    truth = np.interp(V, flown.truth["speed_mps"], flown.truth["power_W"])
    curves = [("dynamic", result.dynamic.polar, result.flown_CL)]
    curves += [(e.method.title, e.polar, e.flown_CL) for e in result.estimates if e.polar is not None]
    curves += [("each run alone", e.polar, e.flown_CL) for e in result.single_runs if e.polar is not None]
    figures = [(title, compared(polar, flown_CL, V, truth, result.condition)) for title, polar, flown_CL in curves]
    causes = [
        f"{disagreement.methods[0]} - {disagreement.methods[1]}: {disagreement.culprit}"
        for disagreement in result.disagreements
    ]
    return [*figures, *((cause, np.empty((2, 0))) for cause in causes)]


def speeds(aircraft: Aircraft) -> np.ndarray:
    return np.array(OVER_STALL) * flights.stall_mps(aircraft)
