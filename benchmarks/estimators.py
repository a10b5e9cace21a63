"""Measures how good each estimator is: error of power required, width and coverage of intervals, and sensor errors.

It flies, simulates the sensors (without buses and counts, since it compares estimators rather than drivers), analyzes,
and compares with the simulator's true curve at five speeds. `python benchmarks/study.py estimators` prints the results.
"""

from dataclasses import replace

import flights
import numpy as np
import pandas as pd
from flights import Rows, Setup
from numpy.polynomial import Polynomial

from flightpower.analysis.air.transducers import air_data_errors
from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.methods import cross_check as checks
from flightpower.analysis.methods import dynamic
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.probe_maps import ALPHA_PORT_SLOPE
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors.budget import DrawnErrors

OVER_STALL = (1.1, 1.3, 1.6, 1.9, 2.2)
FLYING_M = 30.0
LEVEL_RAD = 0.15
SLOPE_DEGREE = 5  # degree of the polynomial for d alpha/d ln(dp_alpha) over alpha
SLOW_OVER_STALL = 1.237  # 13 m/s of the Nexstar


def one_flight(setup: Setup, *, cross_check: bool = False, calibrated: bool = False) -> Rows:
    """Return power required by method; titles with `path, …` have one number for all runs (2, 1), in the unit named.

    cross_check: also run output error. calibrated: calibrate transducers by a water column. Empty if the flight ended
    too soon.
    """
    aircraft, probe, errors = load_aircraft(setup.aircraft), flights.tunnel_probe(), setup.drawn_errors
    try:
        flown = flights.flown(aircraft, errors, setup.plan, setup.seed, setup.turbulence_kt)
    except InputError:
        return []
    flight, propeller = flown.flight, load_propeller(aircraft.propulsion.propeller)
    transducers = flights.transducers_of(errors, setup.seed) if calibrated else None
    measured = transducers.corrected(flown.table) if transducers else flown.table
    if transducers:  # part of the error that remains
        V_scale = (1 + errors.values.V_scale) / np.sqrt(transducers.airspeed.slope) - 1
        errors = replace(errors, values=replace(errors.values, V_scale=float(V_scale)))
    air, still, at_rest = flights.air_of(measured, aircraft, probe)
    runs, _ = find_runs(air)
    rho = float(air.loc[air["flying"], "rho"].mean())
    condition = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    truth = flight.power_required
    V = speeds(aircraft)
    true_power = np.interp(V, truth["speed_mps"], truth["power_W"])

    def compared(polar: Polar) -> np.ndarray:
        power, error = power_required(V, polar, condition)
        return 100 * np.stack([power / true_power - 1, NORMAL_95 * error / true_power])

    calibrated_errors = air_data_errors(transducers)._asdict() if transducers else {}
    trajectory = reconstruct(
        air, still, SensorPriors(alpha_scale_sigma=probe.alpha_scale_sigma, calibrated=calibrated_errors)
    )
    figures = trajectory_errors(trajectory, air, errors, flight.truth, SLOW_OVER_STALL * flights.stall_mps(aircraft))
    for name, kind in (("all runs", ""), ("one acceleration", "acceleration"), ("one deceleration", "deceleration")):
        chosen = [run for run in runs if run.kind.startswith(kind)]
        if kind:  # the longest run, which a user without better knowledge would choose
            chosen = sorted(chosen, key=lambda run: run.start_s - run.end_s)[:1]
        figures[name] = compared(dynamic.estimate_polar(trajectory, chosen, aircraft, propeller).polar)
    if cross_check:
        integrated = checks.on_runs_alone(
            air, runs, aircraft, propeller, gust_mps=trajectory.gust_mps, zeroed=at_rest is not None
        )
        if integrated:
            figures["output error"] = compared(integrated.polar)
    return list(figures.items())


def trajectory_errors(
    trajectory: Trajectory, air: pd.DataFrame, errors: DrawnErrors, truth: pd.DataFrame, slow_mps: float
) -> dict[str, np.ndarray]:
    """Return errors of the estimated sensor errors and of mean states over the flight, with half their 95 % intervals.

    Forces are taken in the IMU's axes, so the IMU's tilt counts as part of the offset of angle of attack and of pitch.
    The true slope and offset of the measured angle come from the best line over the angles flown, which includes the
    error of the probe's calibration; the slope acts through the calibration. The true airspeed scale includes the error
    of density.
    """
    values, tilt = errors.values, errors.imu_rotation[0, 2]
    t, air_t = trajectory.states.index.to_numpy(), air.index.to_numpy()

    def true(name: str, times_s: np.ndarray) -> np.ndarray:
        return np.interp(times_s, truth["time_s"], truth[name])

    # In a bank the IMU's tilt about the other axes also enters its pitch.
    high = (true("height_m", t) > FLYING_M) & (np.abs(true("roll_rad", t)) < LEVEL_RAD)
    V, alpha, rho = (true(name, air_t) for name in ("V_mps", "alpha_rad", "density_kgpm3"))
    flown = air["flying"].to_numpy() & air["alpha_rad"].notna().to_numpy()
    at_probe = air["alpha_by_upwash_rad"] + air["alpha_by_rotation_rad"]
    measured_slope = air["dalpha_dlndp_alpha_rad"]
    of_angle = Polynomial.fit((air["alpha_rad"] + at_probe)[flown], measured_slope[flown], SLOPE_DEGREE)
    true_slope = of_angle(alpha - tilt + at_probe)  # this leaves out the noise of the measured angle
    slope_error, offset = np.polyfit(true_slope[flown], (air["alpha_rad"] - alpha + tilt)[flown], 1)
    V_scale = (1 + values.V_scale) * np.sqrt((rho / air["rho"])[flown].mean()) - 1
    true_values = {
        "alpha_bias": (offset, np.degrees(1), "deg"),
        "alpha_scale": (slope_error + 2 * V_scale, 100, "%"),
        "V_scale": (V_scale, 100, "%"),
        "gps_latency": (values.gps_latency_s, 1000, "ms"),
    }
    figures = {}
    for name, (true_value, factor, unit) in true_values.items():
        figures[f"path, {name} [{unit}]"] = factor * with_half_interval(
            trajectory.value(name) - true_value, trajectory.standard_error(name)
        )

    means = {"theta": (true("pitch_rad", t) - tilt, np.degrees(1), "deg")}
    means |= {f"wind_{axis}": (true(f"wind_{axis}_mps", t), 1.0, "m/s") for axis in ("north", "east")}
    for name, (true_state, factor, unit) in means.items():
        i = STATES.index(name)
        random, sensitivity = (
            trajectory.draws[:, high, i].mean(axis=1),
            trajectory.state_sensitivity[high, i].mean(axis=0),
        )
        error = np.sqrt(np.mean(random**2) + sensitivity @ trajectory.covariance @ sensitivity)
        off = np.mean((trajectory.states[name] - true_state)[high])
        figures[f"path, {name}, mean [{unit}]"] = factor * with_half_interval(off, error)

    slow = flown & (V < slow_mps)
    bias, slope = trajectory.value("alpha_bias"), trajectory.value("alpha_scale") - 2 * trajectory.value("V_scale")
    by_slope = (measured_slope - bias) / (1 + slope)
    alpha_rad = air["alpha_rad"] - bias - slope * by_slope
    of_slope, qbar_Pa = by_slope[slow].mean(), air["qbar_Pa"][slow].mean()
    by_V_scale = -2 * of_slope + (2 * air["alpha_by_upwash_rad"] + air["alpha_by_rotation_rad"])[slow].mean()
    changes = {
        "alpha_bias": 1.0,
        "alpha_scale": of_slope,
        "V_scale": by_V_scale,
        "dp_alpha_zero": 1 / (ALPHA_PORT_SLOPE * qbar_Pa),
        "q_c_zero": by_V_scale / (2 * qbar_Pa),
    }
    by = np.array([changes.get(name, 0.0) for name in SENSOR_ERRORS])
    off = np.mean((alpha_rad - alpha + tilt)[slow])
    figures[f"path, angle of attack below {slow_mps:.0f} m/s [deg]"] = np.degrees(
        with_half_interval(off, np.sqrt(by @ trajectory.covariance @ by))
    )
    return figures


def with_half_interval(error: float, standard_error: float) -> np.ndarray:
    """Return the error and half the 95 % interval (2, 1)."""
    return np.array([[error], [NORMAL_95 * standard_error]])


def speeds(aircraft: Aircraft) -> np.ndarray:
    return np.array(OVER_STALL) * flights.stall_mps(aircraft)
