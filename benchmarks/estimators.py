"""How well each estimator does over many simulated flights: error of power required, width and coverage of intervals.

    python benchmarks/estimators.py --errors study --turbulence-kt 3 --flights 20

Flies, lets the sensors feel (no buses, no counts: this compares estimators, not drivers), analyses, and compares with
the simulator's true curve at five speeds. docs/estimators.md quotes what this prints.
"""

import dataclasses
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.interpolate import CubicSpline

from analysis.airdata.air import air_data
from analysis.airdata.probe import ProbeCalibration, calibrate, read_tunnel
from analysis.path.reconstruct import reconstruct
from analysis.power import curve, dynamic, output_error
from analysis.runs import find_runs
from analysis.stillness import still_segments, zeros
from flight.aircraft import Aircraft, load_aircraft
from flight.propeller import load_propeller
from sim import fly as flying
from sim.plan import load_plan
from sim.plant import plant_of
from sim.sensors import TrayFelt, draw, load_budget
from sim.trim import Trimmer
from sim.tunnel import calibrate as tunnel_measurements
from sim.tunnel import write_calibration

KNOT_MPS = 0.514444
TICK_S, FIFO_S, SAMPLES = 0.04, 0.005, 8
GPS_S = 0.1
OVER_STALL = (1.1, 1.3, 1.6, 1.9, 2.2)
HEIGHT_M = 100.0


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


def one_flight(
    aircraft: Aircraft,
    probe: ProbeCalibration,
    errors: str,
    plan_name: str,
    turbulence_kt: float,
    seed: int,
    single: str,
) -> dict[str, tuple[np.ndarray, float]]:
    """By method: error and half the 95 % interval in per cent of the truth (2, speeds), and seconds."""
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
    if single:
        runs = [run for run in runs if run.kind == single][:1]
    rho = float(air.loc[air["flying"], "rho"].mean())
    at = curve.Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    truth = flight.power_required
    V = speeds(aircraft)
    true_power = np.interp(V, truth["speed_mps"], truth["power_W"])

    def compared(polar: curve.Polar, began: float) -> tuple[np.ndarray, float]:
        seconds = time.perf_counter() - began
        power, error = curve.power_required(V, polar, at)
        return 100 * np.stack([power / true_power - 1, curve.NORMAL_95 * error / true_power]), seconds

    began = time.perf_counter()
    two_steps = dynamic.estimate_polar(air, reconstruct(air, still), runs, aircraft, propeller).polar
    figures = {"two steps": compared(two_steps, began)}
    began = time.perf_counter()
    integrated = output_error.estimate_polar(air, runs, aircraft, zeroed=at_rest is not None).polar
    return figures | {"output error": compared(integrated, began)}


def speeds(aircraft: Aircraft) -> np.ndarray:
    return np.array(OVER_STALL) * Trimmer(plant_of(aircraft), HEIGHT_M).V_stall


def main(
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "full-test-flight",
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    flights: Annotated[int, typer.Option(help="How many; seeds 0, 1, …")] = 20,
    first_seed: Annotated[int, typer.Option(help="The first seed.")] = 0,
    single: Annotated[str, typer.Option(help="acceleration or deceleration: only the flight's first one.")] = "",
    aircraft_name: Annotated[str, typer.Option("--aircraft", help="Aircraft.")] = "nexstar",
) -> None:
    aircraft = load_aircraft(aircraft_name)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tunnel.csv"
        write_calibration(path, tunnel_measurements(seed=0), replace=False)
        probe = calibrate(read_tunnel(path), "tunnel.csv")
    gathered: dict[str, list[tuple[np.ndarray, float]]] = {}
    for seed in track(range(first_seed, first_seed + flights), "flights", console=Console(stderr=True)):
        for method, values in one_flight(aircraft, probe, errors, plan, turbulence_kt, seed, single).items():
            gathered.setdefault(method, []).append(values)
    console = Console(width=120)
    what = f"{single or 'all runs'}, {flights} flights from seed {first_seed}"
    console.print(f"{errors}, {plan}, W20 = {turbulence_kt:g} kt, {what}; error of power required in %")
    table = Table("method", "", *(f"{v:.1f} m/s" for v in speeds(aircraft)), "s a flight", box=None)
    for method, values in gathered.items():
        error, half = np.array([figures for figures, _ in values]).transpose(1, 0, 2)
        took = f"{np.median([seconds for _, seconds in values]):.2f}"
        for name, row, form in (
            ("95 % of errors below", np.percentile(np.abs(error), 95, axis=0), "{:.1f}"),
            ("mean", error.mean(axis=0), "{:+.1f}"),
            ("half width of intervals", np.median(half, axis=0), "{:.1f}"),
            ("coverage, %", 100 * np.mean(np.abs(error) < half, axis=0), "{:.0f}"),
        ):
            table.add_row(method, name, *(form.format(x) for x in row), took)
            method, took = "", ""
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
