"""Finds errors and intervals of battery power, highest level speed and rate of climb over simulated flights.

It simulates flight and sensors (without buses and counts), analyzes, and compares with trimmed flight of the same
simulated aircraft. The errors of propeller table, weight and battery meter are drawn from the budget. `python
benchmarks/study.py answers` repeats it.
"""

from typing import NamedTuple

import flights
import numpy as np
import pandas as pd
from estimators import speeds
from flights import Rows, Setup
from scipy.optimize import brentq

from flightpower.analysis.curve import Condition, lift_coefficient
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.methods import dynamic
from flightpower.analysis.performance.analysis import performance_model, power_train_data
from flightpower.analysis.performance.climb import full_throttle_performance
from flightpower.analysis.performance.level_flight import PerformanceModel, level_flight
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.air import ambient
from flightpower.sim.plant import Deviations, plant_of
from flightpower.sim.propulsion import power_train
from flightpower.sim.sensors.budget import DrawnErrors
from flightpower.sim.trim import Trimmer


def truth_of(aircraft: Aircraft, deviations: Deviations, rho: float, V: np.ndarray, climb_V: float) -> np.ndarray:
    """Return battery power in trimmed level flight at each V, the highest level speed, the best climb at `climb_V`."""
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


class Estimated(NamedTuple):
    """Performance and drag estimated from a flight, its weight and air, and the air data behind them."""

    model: PerformanceModel
    condition: Condition
    air: pd.DataFrame
    drag: dynamic.DynamicEstimate


def estimated(setup: Setup, *, blind: bool = False, errors: DrawnErrors | None = None) -> Estimated:
    """Fly and analyze. blind: without battery data     errors: used in place of the seed's errors"""
    aircraft, probe, errors = load_aircraft(setup.aircraft), flights.tunnel_probe(), errors or setup.drawn_errors
    flight, sensor_truth, table = flights.flown(aircraft, errors, setup.plan, setup.seed, setup.turbulence_kt)
    t = table.index.to_numpy()
    table["battery_V"], current_A = sensor_truth.battery(t)
    table["battery_A"] = (
        current_A
        + _mean_current_A(flight.truth, t)
        - np.interp(t, flight.truth["time_s"], flight.truth["battery_current_A"])
    )
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
    condition = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    slow, fast = np.nanpercentile(flown, (1, 99))
    flown_CL = float(lift_coefficient(fast, condition)), float(lift_coefficient(slow, condition))
    model = performance_model(
        power_train_data(trajectory, aircraft, propeller), estimate, aircraft, propeller, flown_CL
    )
    return Estimated(model, condition, air, estimate)


def _mean_current_A(truth: pd.DataFrame, t_s: np.ndarray) -> np.ndarray:
    """Return the mean current over each tick, from the energy, as a meter shows it.

    At an instant just after a change of throttle, the current is up to 1.4 % larger.
    """
    time_s, half_s = truth["time_s"], flights.TICK_S / 2
    begin_J, end_J = (np.interp(t_s + shift_s, time_s, truth["battery_energy_J"]) for shift_s in (-half_s, half_s))
    voltage_V = np.interp(t_s, time_s, truth["battery_voltage_V"])
    return np.asarray((end_J - begin_J) / flights.TICK_S / np.maximum(voltage_V, 1.0))


def one_flight(setup: Setup, *, blind: bool = False) -> Rows:
    """Return rows for power at each of `columns`, highest level speed and climb rate. blind: without battery data"""
    aircraft, errors = load_aircraft(setup.aircraft), setup.drawn_errors
    model, condition, *_ = estimated(setup, blind=blind)
    V = speeds(aircraft)[1:]
    full = full_throttle_performance(model, condition)
    level = level_flight(model, condition, V)
    answers = (level.battery, full.maximum_speed, full.best_climb)
    value = np.hstack([answer.value for answer in answers])
    half = np.hstack([answer.hi - answer.value for answer in answers])
    assert np.isfinite([value, half]).all()
    truth = truth_of(aircraft, errors.deviations, condition.rho, V, full.best_climb_speed)
    return [(setup.plan, 100 * np.stack([value / truth - 1, half / truth]))]


def columns(aircraft: Aircraft) -> list[str]:
    return [*(f"{v:.1f} m/s" for v in speeds(aircraft)[1:]), "top speed", "climb"]
