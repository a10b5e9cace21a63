"""How well each estimator does over many simulated flights: error of power required, width and coverage of intervals.

    python benchmarks/estimators.py --errors study --turbulence-kt 3 --flights 200

Flies, lets the sensors feel (no buses, no counts: this compares estimators, not drivers), analyses, and compares with
the simulator's true curve at five speeds. docs/estimators.md quotes what this prints.
"""

import dataclasses
import pathlib
import tempfile
from concurrent.futures import ProcessPoolExecutor
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.interpolate import CubicSpline

from analysis.airdata.air import air_data
from analysis.airdata.probe import ProbeCalibration, calibrate, read_tunnel
from analysis.path.reconstruct import Path, reconstruct
from analysis.power import curve, dynamic, output_error
from analysis.runs import find_runs
from analysis.stillness import still_segments, zeros
from flight.aircraft import Aircraft, load_aircraft
from flight.propeller import load_propeller
from sim import fly as flying
from sim.plan import load_plan
from sim.plant import plant_of
from sim.sensors import TrayFelt, draw, load_budget
from sim.sensors.budget import Errors
from sim.trim import Trimmer
from sim.tunnel import calibrate as tunnel_measurements
from sim.tunnel import write_calibration

KNOT_MPS = 0.514444
TICK_S, FIFO_S, SAMPLES = 0.04, 0.005, 8
GPS_S = 0.1
OVER_STALL = (1.1, 1.3, 1.6, 1.9, 2.2)
HEIGHT_M = 100.0
FLYING_M = 30.0


def felt_table(felt: TrayFelt, aircraft: Aircraft) -> pd.DataFrame:
    """What `analysis.channels.synchronise` would make of the flight's log, but for counts and jitter."""
    t = np.arange(0, felt.duration_s, TICK_S)
    fine = (t[:, None] + (np.arange(SAMPLES) - (SAMPLES - 1) / 2) * FIFO_S).ravel()
    force, rate = (values.reshape(-1, SAMPLES, 3).mean(axis=1) for values in felt.imu(fine))
    table = {f"a{axis}_mps2": force[:, i] for i, axis in enumerate("xyz")}
    table |= {f"{axis}_radps": rate[:, i] for i, axis in enumerate("pqr")}
    for name, column in (("alpha", "dp_alpha_Pa"), ("beta", "dp_beta_Pa"), ("airspeed", "q_c_Pa")):
        table[column] = felt.differential_pressure_Pa(name, t)
    table["static_Pa"] = felt.absolute_pressure_Pa("static", t)
    table["static_temperature_K"] = felt.transducer_temperature_K("static", t)
    table["n_revps"] = felt.motor_speed_revps(t)
    pulses = felt.servo_pulses_us(t)[:, aircraft.elevator.channel - 1]
    table["elevator_rad"] = np.array([aircraft.elevator.angle_of_pulse_rad(pulse) for pulse in pulses])
    asked = np.arange(0, felt.duration_s, GPS_S)
    velocity = felt.gps(asked).velocity_ned_mps
    for i, axis in enumerate(("north", "east", "down")):
        table[f"gps_{axis}_mps"] = CubicSpline(asked, velocity[:, i])(t)
    return pd.DataFrame(table, index=pd.Index(t, name="t_s"))


class Job(NamedTuple):
    """One flight to fly and to analyse."""

    aircraft: Aircraft
    probe: ProbeCalibration
    errors: str
    plan: str
    turbulence_kt: float
    seed: int
    cross_check: bool


def one_flight(job: Job) -> dict[str, np.ndarray]:
    """By method: error and half the 95 % interval in per cent of the truth (2, speeds). By `path, …`: error and half
    the interval of one number that all runs share (2, 1), in the unit named."""
    aircraft, probe, errors, plan_name, turbulence_kt, seed, cross_check = job
    budget = load_budget(errors)
    # Vibration needs the part's own low-pass filter, which is a matter for the whole chain and not for this table.
    budget = dataclasses.replace(budget, noise=dataclasses.replace(budget.noise, vibration_mps2=0.0))
    drawn = draw(budget, seed)
    plan = load_plan(plan_name)
    if turbulence_kt:
        plan = dataclasses.replace(plan, air=dataclasses.replace(plan.air, turbulence_mps=turbulence_kt * KNOT_MPS))
    flight = flying.fly(aircraft, plan, seed=seed, deviations=drawn.deviations)
    table = felt_table(TrayFelt(flight, drawn), aircraft)
    propeller = load_propeller(aircraft.propulsion.propeller)
    still = still_segments(table, 1 / TICK_S)
    at_rest = zeros(table, still)
    air = air_data(table, aircraft, probe, propeller, at_rest).table
    runs, _ = find_runs(air)
    rho = float(air.loc[air["flying"], "rho"].mean())
    at = curve.Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    truth = flight.power_required
    V = speeds(aircraft)
    true_power = np.interp(V, truth["speed_mps"], truth["power_W"])

    def compared(polar: curve.Polar) -> np.ndarray:
        power, error = curve.power_required(V, polar, at)
        return 100 * np.stack([power / true_power - 1, curve.NORMAL_95 * error / true_power])

    path = reconstruct(air, still, alpha_scale_sigma=probe.alpha_scale_sigma)
    figures = path_figures(path, drawn, flight.truth)
    for name, kind in (("all runs", ""), ("one acceleration", "acceleration"), ("one deceleration", "deceleration")):
        chosen = [run for run in runs if run.kind.startswith(kind)]
        if kind:  # the longest, as one who has to choose would
            chosen = sorted(chosen, key=lambda run: run.start_s - run.end_s)[:1]
        figures[name] = compared(dynamic.estimate_polar(air, path, chosen, aircraft, propeller).polar)
    if cross_check:
        integrated = output_error.estimate_polar(air, runs, aircraft, zeroed=at_rest is not None, propeller=propeller)
        figures["output error"] = compared(integrated.polar)
    return figures


def path_figures(path: Path, drawn: Errors, truth: pd.DataFrame) -> dict[str, np.ndarray]:
    """Errors of the path's shared numbers, and of mean pitch, which has no interval of its own.

    Forces are taken in the IMU's axes: its tilt belongs to the offset of angle of attack, and to pitch.
    """
    values, tilt = drawn.values, drawn.imu_rotation[0, 2]
    slope = 1 + values.alpha_scale - 2 * values.V_scale
    known = {
        "alpha_bias": ((values.alpha_offset_rad + tilt) * slope, np.degrees(1), "deg"),
        "alpha_scale": (values.alpha_scale, 100, "%"),
        "V_scale": (values.V_scale, 100, "%"),
        "gps_latency": (values.gps_latency_s, 1000, "ms"),
    }
    t = path.states.index.to_numpy()
    high = np.interp(t, truth["time_s"], truth["height_m"]) > FLYING_M
    pitch = (path.states["theta"] - np.interp(t, truth["time_s"], truth["pitch_rad"]) + tilt)[high]
    figures = {"path, pitch [deg]": np.array([[np.degrees(pitch.mean())], [np.nan]])}
    for name, (true, factor, unit) in known.items():
        half = curve.NORMAL_95 * path.standard_error(name)
        figures[f"path, {name} [{unit}]"] = factor * np.array([[path.value(name) - true], [half]])
    return figures


def speeds(aircraft: Aircraft) -> np.ndarray:
    return np.array(OVER_STALL) * Trimmer(plant_of(aircraft), HEIGHT_M).V_stall


def main(
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "full-test-flight",
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    flights: Annotated[int, typer.Option(help="How many; seeds 0, 1, …")] = 20,
    first_seed: Annotated[int, typer.Option(help="The first seed.")] = 0,
    cross_check: Annotated[bool, typer.Option(help="Output error too.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    aircraft_name: Annotated[str, typer.Option("--aircraft", help="Aircraft.")] = "nexstar",
) -> None:
    aircraft = load_aircraft(aircraft_name)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "tunnel.csv"
        write_calibration(path, tunnel_measurements(seed=0), replace=False)
        probe = calibrate(read_tunnel(path), "tunnel.csv")
    todo = [
        Job(aircraft, probe, errors, plan, turbulence_kt, seed, cross_check)
        for seed in range(first_seed, first_seed + flights)
    ]
    gathered: dict[str, list[np.ndarray]] = {}
    with ProcessPoolExecutor(jobs) as pool:
        done = track(pool.map(one_flight, todo), "flights", total=flights, console=Console(stderr=True))
        for figures in done:
            for name, values in figures.items():
                gathered.setdefault(name, []).append(values)
    console = Console(width=120)
    console.print(f"{errors}, {plan}, W20 = {turbulence_kt:g} kt, {flights} flights from seed {first_seed}")
    print_power(console, {k: v for k, v in gathered.items() if not k.startswith("path")}, speeds(aircraft))
    print_path(console, {k.removeprefix("path, "): v for k, v in gathered.items() if k.startswith("path")})


def print_power(console: Console, gathered: dict[str, list[np.ndarray]], V: np.ndarray) -> None:
    table = Table("power required, errors in %", "", *(f"{v:.1f} m/s" for v in V), box=None)
    for method, values in gathered.items():
        error, half = np.array(values).transpose(1, 0, 2)
        for name, row, form in (
            ("95 % of errors below", np.nanpercentile(np.abs(error), 95, axis=0), "{:.1f}"),
            ("mean", np.nanmean(error, axis=0), "{:+.1f}"),
            ("half width of intervals", np.nanmedian(half, axis=0), "{:.1f}"),
            ("coverage, %", 100 * np.sum(np.abs(error) < half, axis=0) / np.isfinite(error).sum(axis=0), "{:.0f}"),
        ):
            table.add_row(method, name, *(form.format(x) for x in row))
            method = ""
    console.print(table)


def print_path(console: Console, gathered: dict[str, list[np.ndarray]]) -> None:
    table = Table("path, errors", "rms", "mean", "stated, 1 sigma", "coverage, %", box=None)
    for name, values in gathered.items():
        error, half = np.array(values)[:, :, 0].T
        stated = ("", "")
        if np.isfinite(half).all():
            covered = f"{100 * np.mean(np.abs(error) < half):.0f}"
            stated = (f"{np.median(half) / curve.NORMAL_95:.3f}", covered)
        table.add_row(name, f"{np.sqrt(np.mean(error**2)):.3f}", f"{error.mean():+.3f}", *stated)
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
