"""Measures the simulator's speed, as flown time over processor time: `python benchmarks/bench.py simulator`.

It simulates aircraft, pilot and every sensor at 50 Hz. `--with log` adds the whole test flight into a log, both ways.
The figure is the best of three, because other programs share the machine.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # matrix operations also use only one core

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np
from records import Record, rounded

from flightpower.flight.aircraft import load_aircraft
from flightpower.sim.fly import fly
from flightpower.sim.plan import DT_S, load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

PLAN = "full-test-flight"
PRESSURES = {"absolute_pressure_Pa": ("baro", "static"), "differential_pressure_Pa": ("alpha", "beta", "airspeed")}
REST = (
    "imu",
    "imu_temperature_K",
    "magnetic_field_T",
    "gps",
    "motor_speed_revps",
    "servo_pulses_us",
    "autopilot_attitude_rad",
    "battery",
)


def once() -> tuple[float, float, float]:
    """Return the flight's duration, and the processor times of flying it and of simulating every sensor, all [s]."""
    aircraft, plan, errors = load_aircraft("nexstar"), load_plan(PLAN), draw(load_budget("bench"), 0)
    begun = time.process_time()
    flight = fly(aircraft, plan, deviations=errors.deviations)
    flown = time.process_time()
    sensor_truth = FlightSensorTruth(flight, errors)
    t_s = np.arange(0.0, flight.duration_s, DT_S)
    for name in REST:
        getattr(sensor_truth, name)(t_s)
    for name, transducers in PRESSURES.items():
        for which in transducers:
            getattr(sensor_truth, name)(which, t_s)
            sensor_truth.transducer_temperature_K(which, t_s)
    return flight.duration_s, flown - begun, time.process_time() - flown


def logged(*options: str) -> tuple[float, float]:
    """Return elapsed and processor time [s] of `sim fly` with the whole test flight."""
    before = getrusage(RUSAGE_CHILDREN)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "flightpower",
            "sim",
            "fly",
            "--plan",
            PLAN,
            "-o",
            str(Path(folder) / "out"),
            *options,
        ]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    after = getrusage(RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - begun, used


def records(*, log: bool = False) -> list[Record]:
    """Return processor and elapsed time of the flight, also with a log if `log` is true."""
    fly(load_aircraft("nexstar"), load_plan("case-1"))  # a first flight loads modules and files
    runs = [once() for _ in range(3)]
    duration_s = runs[0][0]
    flying_s, both_s = min(run[1] for run in runs), min(run[1] + run[2] for run in runs)
    used = {"aircraft and pilot": (flying_s, None), "aircraft, pilot and all sensors": (both_s, None)}
    if log:
        for name, options in (("log, through fakes and daemon", ()), ("log, straight", ("--no-hardware",))):
            wall_s, used_s = logged(*options)
            used[name] = used_s, wall_s
    return [
        {"what": name, "processor, s": rounded(s, 1), "elapsed, s": rounded(wall, 1) if wall else None,
         "times real time": rounded(duration_s / s)}
        for name, (s, wall) in used.items()
    ]  # fmt: skip
