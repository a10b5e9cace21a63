"""Flies plans of randomly drawn aircraft in the simulator: compares path and result with what was planned.

    python benchmarks/planned_aircraft.py --flights 3                    # seeds below 1000 are for development
    python benchmarks/planned_aircraft.py --seed 1000 --flights 30 --jobs 2

A seed draws weight (0.7 to 12 kg), wing loading, aspect ratio, one of the shipped propellers of about this size, and
the wind (0 to 15 kt). The aircraft is scaled from the Nexstar (`sim fly --like nexstar`); the planner reads a file with
its wing, weight, propeller, motor and battery. The simulator flies `plan.toml` in the wind and turbulence of the plan,
and the flight is analyzed. Before its first flight an aircraft's drag is assumed; `drag_known` is what the plan would
have promised with the drag found in the flight.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import plans
import typer

from flightpower.analysis.curve import Condition, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.missions.card import uncovered_mps
from flightpower.analysis.missions.expected_aircraft import expected_aircraft
from flightpower.analysis.missions.information import half_widths
from flightpower.analysis.missions.pieces import Space
from flightpower.analysis.missions.search import Request, plan_flight
from flightpower.analysis.missions.simulator_plan import simulator_plan
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.complete_aircraft import CompleteAircraft, load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.like import scaled_from

PROPELLERS = ("apc-10x5e", "apc-12x8e", "apc-12x8e-windmilling", "blade-11x5", "blade-16x10")
MODEL, HEIGHT_M, LEG_M = "nexstar", 40.0, 500.0
LIGHTEST_KG, HEAVIEST_KG, WINDIEST_KT = 0.7, 12.0, 15.0


def aircraft_of(rng: np.random.Generator, name: str) -> CompleteAircraft:
    """Draw an aircraft. Wing loading and propeller grow with the cube root of weight, as for similar aircraft."""
    model = load_complete_aircraft(MODEL)
    mass_kg = float(np.exp(rng.uniform(np.log(LIGHTEST_KG), np.log(HEAVIEST_KG))))
    size = (mass_kg / model.mass_kg) ** (1 / 3)
    loading_Pa = model.wing_loading_Pa * size * rng.uniform(0.8, 1.2)
    area_m2 = mass_kg * GRAVITY_MPS2 / loading_Pa
    span_m = float(np.sqrt(area_m2 * rng.uniform(6.0, 10.0)))
    fit = 0.3048 * size
    by_size = sorted(PROPELLERS, key=lambda propeller: abs(np.log(load_propeller(propeller).diameter_m / fit)))
    propeller = str(rng.choice(by_size[:3]))
    short = f"""name = "{name}"
[geometry]
span = "{span_m:.3f} m"
wing_area = "{area_m2:.4f} m^2"
[mass]
weight = "{mass_kg:.3f} kg"
[propulsion]
propeller = "{propeller}"
"""
    p = scaled_from(short, name, model).propulsion
    text = f"""{short}motor_kv_rpm_per_volt = {p.motor_kv_rpm_per_volt:.1f}
motor_resistance = "{p.motor_resistance_ohm:.5f} ohm"
motor_no_load_current = "{p.motor_no_load_current_A:.3f} A"
battery_voltage = "{p.battery_voltage_V:.2f} V"
battery_resistance = "{p.battery_resistance_ohm:.5f} ohm"
"""
    return scaled_from(text, name, model)


def one_aircraft(seed: int, minutes: float) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 51])
    craft, kt = aircraft_of(rng, f"drawn {seed}"), float(rng.uniform(0.0, WINDIEST_KT))
    line: dict[str, Any] = {
        "seed": seed, "kg": round(craft.mass_kg, 2), "kt": round(kt, 1), "propeller": craft.propulsion.propeller
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.toml"
        try:
            nominal = parse_aircraft(craft.text, "drawn")
            planned = plan_flight(
                expected_aircraft(nominal, HEIGHT_M), Request(minutes, kt, Space(LEG_M, HEIGHT_M), plans.BY_HAND)
            )
            line["covered"] = not len(uncovered_mps(planned))
            path.write_text(simulator_plan(planned.maneuvers, planned.aircraft, planned.request), "utf-8")
            polar, flown, air = plans.analyzed(craft, str(path), 0.0, seed)
        except InputError as error:
            return {**line, "lost": str(error)}
    truth = flown.flight.truth
    in_air = truth[(truth["height_m"] > 0.9 * HEIGHT_M)]
    propeller = load_propeller(craft.propulsion.propeller)
    V, n = in_air["V_mps"].to_numpy(), in_air["motor_speed_revps"].to_numpy()
    inside = propeller.covers(V / (n * propeller.diameter_m), 60 * n)
    V = planned.question.speeds
    condition = Condition(craft.mass.weight_N, float(air.loc[air["flying"], "rho"].mean()), craft.geometry.wing_area_m2)
    power, sigma = power_required(V, polar, condition)
    true = flown.flight.power_required
    true_W = np.interp(V, true["speed_mps"], true["power_W"])
    half = 100 * NORMAL_95 * sigma / power
    return {
        **line,
        "inside": float(np.mean(inside)),
        "farthest_m": float(np.hypot(in_air["north_m"], in_air["east_m"]).max()),
        "promised": float(np.max(planned.half_widths)),
        "obtained": float(np.max(half)),
        "true_inside": float(np.mean(np.abs(power / true_W - 1) < half / 100)),
        "drag_known": float(np.max(half_widths(planned.covariances, replace(planned.aircraft, A=polar.A), V))),
        "fastest": [planned.aircraft.fastest_mps / planned.aircraft.stall_mps, float(V[-1])],
    }


def main(
    seed: Annotated[int, typer.Option(help="Of the first aircraft.")] = 0,
    flights: Annotated[int, typer.Option(help="Aircraft.")] = 3,
    minutes: Annotated[float, typer.Option(help="Of each flight.")] = 15.0,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    lines = []
    with ProcessPoolExecutor(jobs) as pool:
        for line in pool.map(partial(one_aircraft, minutes=minutes), range(seed, seed + flights)):
            print(json.dumps(line), flush=True)
            lines.append(line)
    flown = [line for line in lines if "lost" not in line]
    if not flown:
        return
    covered_ones = [line for line in flown if line["covered"]]
    print(f"aircraft {len(lines)}, flown as planned and analyzed {len(flown)}")
    print(f"warned that the propeller's table does not cover the flight: {len(flown) - len(covered_ones)}")
    print(f"95 % of samples in the table, of the others: {sum(line['inside'] >= 0.95 for line in covered_ones)}"
          f" of {len(covered_ones)}")  # fmt: skip
    print(f"farthest from the take-off: median {np.median([line['farthest_m'] for line in flown]):.0f} m,"
          f" at most {max(line['farthest_m'] for line in flown):.0f} m")  # fmt: skip
    for name, title in (("promised", "promised"), ("drag_known", "the same with the drag that is found,")):
        ratio = np.array([line[name] / line["obtained"] for line in covered_ones])
        print(f"{title} over obtained half width: {np.round(np.sort(ratio), 2).tolist()};"
              f" within 15 %: {int(np.sum(np.abs(ratio - 1) <= 0.15))}")  # fmt: skip
    print(f"curve inside its interval: {100 * np.mean([line['true_inside'] for line in covered_ones]):.0f} % of speeds")


if __name__ == "__main__":
    typer.run(main)
