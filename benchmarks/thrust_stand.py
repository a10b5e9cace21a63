"""Measures how a thrust stand affects the interval of power required, on the same flights with and without it.

Before each flight the simulated propeller stands still on a load cell: ten readings at five motor speeds, up and down,
1 % of noise each, and a scale wrong by 1 % (1 sigma). `calibrate thrust` compares them with the table that the analysis
gets. No buses and no counts, as in benchmarks/estimators.py. `python
benchmarks/study.py thrust-stand` repeats it.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import flights
import numpy as np
from estimators import speeds
from flights import Rows, Setup

from flightpower.analysis.air.thrust_stand import ThrustStand
from flightpower.analysis.calibrations.thrust import StandReadings, calibrate
from flightpower.analysis.curve import Condition, Polar, power_required, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from flightpower.analysis.methods import dynamic
from flightpower.analysis.methods.methods import every_method, fallback
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.plant import plant_of
from flightpower.sim.sensors.budget import DrawnErrors, ErrorBudget
from flightpower.sim.world import load_world

SHARES = (0.45, 0.6, 0.7, 0.8, 0.9)  # fractions of the highest motor speed
READING_ERROR, SCALE_ERROR = 0.01, 0.01
EVERY_LIFT = (0.01, 100.0)
BOW_AT_REST = 2.5  # change of thrust at J = 0, from the line through flight, per unit of bow


def stand_of(aircraft: Aircraft, errors: DrawnErrors, seed: int) -> ThrustStand:
    """Return the result of `calibrate thrust` with the propeller that is flown. Raises InputError if it gives none."""
    plant, rng = plant_of(aircraft, deviations=errors.deviations), np.random.default_rng([seed, 22])
    top = aircraft.propulsion.max_rpm / 60
    n = top * np.array([*SHARES, *reversed(SHARES)])
    thrust_N = plant.propeller.thrust_and_power(np.zeros(len(n)), n, SEA_LEVEL_DENSITY)[0]
    thrust_N = thrust_N * (1 + errors.deviations.thrust_scale) * (1 - 0.5 * errors.deviations.thrust_slope_J)
    thrust_N = thrust_N * (1 + SCALE_ERROR * rng.standard_normal()) * (1 + READING_ERROR * rng.standard_normal(len(n)))
    readings = StandReadings(n, thrust_N, np.full(len(n), SEA_LEVEL_DENSITY))
    stand, unsupported = calibrate(readings, load_propeller(aircraft.propulsion.propeller), SCALE_ERROR, "stand")
    if unsupported:
        raise InputError(unsupported)
    return stand


def one_flight(
    setup: Setup, *, states_errors: bool = False, steady: bool = False, curvature: float | None = None
) -> Rows:
    """Return rows by data used, without and with the stand, and thrust at rest in percent of the table's.

    with_curvature: the aircraft file states the world's errors of thrust. steady: use only the plan's steady points.
    curvature: [uncertainty] thrust_curvature. Empty if the flight ended too soon.
    """
    aircraft, probe, errors = load_aircraft(setup.aircraft), flights.tunnel_probe(), setup.drawn_errors
    if states_errors:
        aircraft = stating_thrust(aircraft, load_world(setup.world).errors)
    if curvature is not None:
        aircraft = replace(aircraft, uncertainty=replace(aircraft.uncertainty, thrust_curvature_fraction=curvature))
    try:
        flown = flights.flown(aircraft, errors, setup.plan, setup.seed, setup.turbulence_kt)
    except InputError:
        return []
    propeller = load_propeller(aircraft.propulsion.propeller)
    air, still, _ = flights.air_of(flown.table, aircraft, probe)
    rho = float(air.loc[air["flying"], "rho"].mean())
    condition = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    V = speeds(aircraft)
    truth = np.interp(V, flown.flight.power_required["speed_mps"], flown.flight.power_required["power_W"])
    trajectory = reconstruct(air, still, SensorPriors(alpha_scale_sigma=probe.alpha_scale_sigma))
    on_stand = stand_of(aircraft, errors, setup.seed).applied_to(aircraft)
    maneuvers = find(air, still).of("steady") if steady else find_runs(air)[0]
    figures = {}
    for title, flown_file in (("without", aircraft), ("with the stand", on_stand)):
        for data, polar, flown_CL in _estimates(trajectory, maneuvers, flown_file, propeller, condition):
            power, error = power_required(V, polar, condition)
            low, high = speed_at(np.array(flown_CL), condition)[::-1]
            compared = 100 * np.stack([power / truth - 1, NORMAL_95 * error / truth])
            figures[f"{data}, {title}"] = np.where((V > low) & (V < high), compared, np.nan)
    return sorted(figures.items(), key=lambda item: item[0].partition(",")[0])


def _estimates(
    trajectory: Trajectory, maneuvers: list[Maneuver], aircraft: Aircraft, propeller: Propeller, condition: Condition
) -> Iterator[tuple[str, Polar, tuple[float, float]]]:
    """Yield the data used, the polar, and its valid lift coefficients, from runs or else from steady points."""
    if not any(run.kind in LEVEL_RUNS for run in maneuvers):
        others = every_method(trajectory, maneuvers, aircraft, propeller, condition)
        estimate, flown_CL, _ = fallback(others.by_method, trajectory, aircraft, "flight")
        yield "steady points", estimate.polar, flown_CL
        return
    for data, kind in (("all runs", ""), ("one acceleration", "acceleration"), ("one deceleration", "deceleration")):
        chosen = [run for run in maneuvers if run.kind.startswith(kind)]
        if kind:
            chosen = sorted(chosen, key=lambda run: run.start_s - run.end_s)[:1]
        yield data, dynamic.estimate_polar(trajectory, chosen, aircraft, propeller).polar, EVERY_LIFT


def stating_thrust(aircraft: Aircraft, budget: ErrorBudget) -> Aircraft:
    """Return an aircraft that states the standard deviations with which the budget draws errors of thrust."""
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
