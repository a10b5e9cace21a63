"""Analyzes logs of simulated flights with the habits of real firmware: do the intervals contain the truth?

    python benchmarks/constructed_logs.py --seed 5200

Each log has its own flight. Power at seven speeds, the airspeed ratio and the speeds to enter are compared with the
truth; logs that lack what the method needs must be refused.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from electrical import AUTOPILOTS, CLOSED_LOOP, true_power
from flights import Setup, flown

from flightpower.analysis.curve import Cost
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.performance.autopilot_parameters import flight_values
from flightpower.analysis.records.flight import Interval
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError

BIN, TEXT, TELEMETRY = "log.BIN", "log.log", "log.tlog"
RIGHT = [
    *(("ardupilot", BIN, faults) for faults in (
        "no-thermometer", "second-airspeed", "old-firmware", "hover", "two-packs", "esc-power", "dropouts",
        "clock-jump", "airborne-start", "truncated", "landed wrong-battery-first appended",
        "no-thermometer second-airspeed hover")),
    ("ardupilot", TEXT, "no-thermometer"),
    ("ardupilot", TELEMETRY, "wrong-battery-first"),
    *(("px4", "log.ulg", faults) for faults in (
        "no-thermometer", "second-airspeed", "old-firmware", "hover", "two-packs", "esc-power", "pressure-offset",
        "dropouts", "clock-jump truncated", "landed wrong-battery-first")),
]  # fmt: skip
WRONG = [(autopilot, file, faults) for autopilot, file in (("ardupilot", BIN), ("px4", "log.ulg"))
         for faults in ("no-airspeed no-gps", "dead-meter")]  # fmt: skip


class Checked(NamedTuple):
    """Result of one log. power : speeds with the true power inside, half width [%]; flags : what else is inside"""

    title: str
    refusal: str = ""
    power: str = ""
    inside: bool = False
    middle: bool = False
    ratio: bool = False
    speeds: bool = False


def outcome_of(job: tuple[int, tuple[str, str, str]]) -> Checked:
    seed, (autopilot, file, faults) = job
    title = f"{autopilot} {file.removeprefix('log')} {faults}"
    setup = Setup("nexstar", "study", (CLOSED_LOOP, "ordinary-flight")[seed % 2], (0.0, 3.0, 8.0)[seed % 3], seed)
    aircraft, errors = load_complete_aircraft(setup.aircraft), setup.drawn_errors
    flight, sensors, _ = flown(aircraft, errors, setup.plan, seed, setup.turbulence_kt)
    write, read = AUTOPILOTS[autopilot]
    weight, geometry = aircraft.mass.weight_N, aircraft.geometry
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / file
        write(log, flight, sensors, errors, faults.split())
        try:
            recording = read(log)
            table = flight_table(recording, weight, geometry.wing_area_m2)
        except InputError as refused:
            return Checked(title, str(refused).removeprefix(f"{log}: "))
    electrical = estimate(table, weight, geometry.wing_area_m2, geometry.span_m)
    indices = np.linspace(0, len(electrical.V_mps) - 1, 7).round().astype(int)
    truth = true_power(aircraft, flight, errors, electrical.V_mps[indices], electrical.conditions.rho)
    error, half = electrical.power_W[indices] - truth, NORMAL_95 * electrical.standard_error_W[indices]
    defined = np.isfinite(truth)
    inside = np.abs(error) < half
    power = (
        f"{np.sum(inside & defined)} of {defined.sum()}, ± {100 * np.median(half / electrical.power_W[indices]):.1f} %"
    )
    every = true_power(aircraft, flight, errors, electrical.V_mps, electrical.conditions.rho)
    cruise_mps = float(electrical.V_mps[int(np.nanargmin(every / electrical.V_mps))])
    best_range = electrical.curve.best(Cost.ENERGY_PER_METER)
    values = flight_values(electrical, best_range, recording.parameters)
    assert values.airspeed_factor is not None
    factor = 1 / (1 + errors.values.V_scale)
    moved = factor * (1 + electrical.airspeed.scale)  # true over estimated airspeed
    to_equivalent = float(np.sqrt(electrical.conditions.rho / SEA_LEVEL_DENSITY))
    speeds = [(speed, moved * speed.value) for speed in (values.slowest, values.fastest)]
    speeds.append((values.cruise, to_equivalent * cruise_mps))
    return Checked(
        title, "", power, bool(inside[defined].all()), bool(inside[3]), _inside(values.airspeed_factor, factor),
        all(_inside(*speed) for speed in speeds),
    )  # fmt: skip


def _inside(interval: Interval, value: float) -> bool:
    lo, hi = interval.lo, interval.hi
    return (lo is None or lo <= value * (1 + 1e-9)) and (hi is None or value <= hi * (1 + 1e-9))


def main(seed: Annotated[int, typer.Option(help="The first; development uses those below 1000.")] = 5200) -> None:
    jobs = list(enumerate([*RIGHT, *WRONG], seed))
    with ProcessPoolExecutor(2) as pool:
        outcomes = []
        for log in pool.map(outcome_of, jobs):
            outcomes.append(log)
            verdict = f"refused: {log.refusal}" if log.refusal else f"power inside at {log.power}"
            missed = [name for name, good in (("ratio", log.ratio), ("speeds", log.speeds)) if not good]
            print(f"{log.title:60} {verdict}{'; outside: ' + ', '.join(missed) if missed and not log.refusal else ''}",
                  flush=True)  # fmt: skip
    right, wrong = outcomes[: len(RIGHT)], outcomes[len(RIGHT) :]
    print(f"{len(right)} right logs: power inside at the middle speed in {sum(log.middle for log in right)}, "
          f"at all in {sum(log.inside for log in right)}; ratio in "
          f"{sum(log.ratio for log in right)}, speeds in {sum(log.speeds for log in right)}; "
          f"{sum(bool(log.refusal) for log in wrong)} of {len(wrong)} wrong ones refused")  # fmt: skip


if __name__ == "__main__":
    typer.run(main)
