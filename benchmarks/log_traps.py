"""Errors of the electrical power of level flight with each trap of real logs, as PX4 and as ArduPilot log a flight.

`python benchmarks/log_traps.py [--seed N]`: errors and half widths of the intervals [%] at four speeds, or the refusal.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from electrical import true_power
from flights import drawn

from analysis.autopilot_logs.ardupilot import read_ardupilot
from analysis.autopilot_logs.px4 import read_px4
from analysis.electrical.estimate import estimate
from analysis.electrical.flight_table import flight_table
from analysis.estimation.noise import NORMAL_95
from flight.complete_aircraft import load_complete_aircraft
from flight.errors import InputError
from sim.ardupilot_log import write_ardupilot_log
from sim.fly import fly
from sim.log_faults import FAULTS
from sim.plan import load_plan
from sim.px4_log import write_px4_log
from sim.sensors import FlightSensorTruth, load_budget


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1000)
    seed = parser.parse_args().seed
    aircraft = load_complete_aircraft("nexstar")
    weight_N, geometry, errors = aircraft.mass.weight_N, aircraft.geometry, drawn(load_budget("study"), seed)
    flight = fly(aircraft, load_plan("ordinary-flight"), seed=seed, deviations=errors.deviations)
    sensors = FlightSensorTruth(flight, errors)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        for name, write, read in (
            ("px4", write_px4_log, read_px4),
            ("ardupilot", write_ardupilot_log, read_ardupilot),
        ):
            for faults in ([], *([fault] for fault in FAULTS)):
                write(path, flight, sensors, errors, faults)
                try:
                    table = flight_table(read(path), weight_N, geometry.wing_area_m2)
                    found = estimate(table, weight_N, geometry.wing_area_m2, geometry.span_m)
                except InputError as refused:
                    print(f"{name:10}{' '.join(faults):22}refused: {refused}")
                    continue
                truth = true_power(aircraft, flight, errors, found.V_mps[::20], found.conditions.rho)
                error = 100 * (found.power_W[::20] / truth - 1)
                half = 100 * NORMAL_95 * found.standard_error_W[::20] / truth
                told = "  ".join(f"{e:+.1f} ± {h:.1f}" for e, h in zip(error, half, strict=True))
                print(f"{name:10}{' '.join(faults):22}{told}{'' if np.all(np.abs(error) < half) else '  OUTSIDE'}")


if __name__ == "__main__":
    main()
