"""Compares errors and intervals of the curve with an aircraft file of four keys and with one that has all keys.

The simulated flights (without buses) are of Nexstars that differ in values that the short file lacks: upwash at the
probe and positions of probe and IMU, each drawn uniformly. The same log is analyzed with the aircraft file that it
carries, and with one that has only name, span, wing area and weight. `python benchmarks/study.py own-aircraft` repeats
it.
"""

import tempfile
from pathlib import Path

import estimators
import numpy as np
from chain import compared, fly, read_results, read_truth, run
from flights import Rows, Setup

from flightpower.flight.aircraft import load_aircraft

FOUR_KEYS = """name = "mine"
[geometry]
span = "5.73 ft"
wing_area = "4.99 ft^2"
[mass]
weight = "8.47 lbf"
"""
UPWASH_DEG, PROBE_M, IMU_M = (0.0, 2.0), (0.1, 0.6), (-0.1, 0.1)


def drawn_aircraft(seed: int) -> str:
    """Return the text of the Nexstar's file with another installation of probe and IMU."""
    rng = np.random.default_rng(seed)
    upwash, ahead = rng.uniform(*UPWASH_DEG), rng.uniform(*PROBE_M)
    imu = ", ".join(f'"{place:.3f} m"' for place in rng.uniform(*IMU_M, 3))
    text = load_aircraft("nexstar").text
    for old, new in (
        ('upwash_per_CL = "1.0 deg"', f'upwash_per_CL = "{upwash:.3f} deg"'),
        ('position = ["0.45 m",', f'position = ["{ahead:.3f} m",'),
        ('imu_position = ["0.05 m", "0.0 m", "0.02 m"]', f"imu_position = [{imu}]"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def one_flight(setup: Setup) -> Rows:
    """Return results with all keys and with four, and how much wider the intervals with four keys are [%]."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "nexstar.toml").write_text(drawn_aircraft(setup.seed), "utf-8")
        (folder / "four.toml").write_text(FOUR_KEYS, "utf-8")
        fly(setup, folder, "--no-hardware", aircraft=folder / "nexstar.toml")
        log, V = folder / "log.mcap", estimators.speeds(load_aircraft("nexstar"))
        run("analyze", log, "--quiet", "-o", folder / "all")
        run("analyze", log, "--quiet", "-o", folder / "four", "--aircraft", folder / "four.toml")
        complete, four = (compared(read_results(folder / report), read_truth(folder), V) for report in ("all", "four"))
    wider = np.stack([100 * (four[1] / complete[1] - 1), np.full(len(V), np.nan)])
    return [("all keys", complete), ("four keys", four), ("wider by four keys", wider)]
