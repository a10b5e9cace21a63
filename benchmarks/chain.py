"""Tests the whole chain on simulated flights: fakes, daemon, log, analysis; gives the curve's error and coverage.

Each flight is flown and recorded by `sim fly` and analyzed by `analyze`, as a user would: with all runs, and with an
edited runs.toml that has only the longest acceleration or the longest deceleration. The curve in results.json is
compared with the simulator's truth at the speeds of benchmarks/estimators.py. The table also has the curve that
benchmarks/estimators.py gets from the same flights without buses, quantization and log ("direct"), and the difference
between the two. `python benchmarks/study.py chain` repeats it.
"""

import csv
import json
import subprocess
import sys
import tempfile
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import estimators
import msgspec
import numpy as np
from flights import Rows, Setup, tunnel_probe

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.flight.aircraft import load_aircraft

ALONE = {"one acceleration": "acceleration", "one deceleration": "deceleration"}
NOT_TRUSTED, REFUSED = 1, 2  # exit codes for a result that is not to be trusted, and for refused input


def run(*command: object, may_refuse: bool = False) -> bool:
    """Return whether the command succeeded; False if it refused its input, where it may."""
    line = [sys.executable, "-m", "flightpower", *(str(part) for part in command)]
    done = subprocess.run(line, capture_output=True, text=True)
    if done.returncode not in (0, NOT_TRUSTED) and not (may_refuse and done.returncode == REFUSED):
        raise RuntimeError(f"{command}: {done.stderr}")
    return done.returncode != REFUSED


def one_flight(setup: Setup, *, hardware: bool = True) -> Rows:
    """Return rows by the runs that were kept; NaN if not flown or refused. hardware: through fakes and daemon"""
    V = estimators.speeds(load_aircraft(setup.aircraft))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fly(setup, folder, *([] if hardware else ["--no-hardware"]))
        log, report = folder / "log.mcap", folder / "log.report"
        run("analyze", log, "--quiet")
        truth = read_truth(folder)
        curves = {"all runs": compared(read_results(report), truth, V)}
        runs = tomllib.loads((report / "runs.toml").read_text("utf-8"))["run"]
        for title, kind in ALONE.items():
            edited = folder / f"{kind}.toml"
            edited.write_text(alone(runs, kind), "utf-8")
            answered = run("analyze", log, "--quiet", "--runs", edited, "-o", folder / kind, may_refuse=True)
            curves[title] = (
                compared(read_results(folder / kind), truth, V) if answered else np.full((2, len(V)), np.nan)
            )
    direct = dict(estimators.one_flight(setup))
    rows = []
    for title, figures in curves.items():
        apart = np.stack([figures[0] - direct[title][0], np.full(len(V), np.nan)])
        rows += [(title, figures), (f"{title}, direct", direct[title]), (f"{title}, chain less direct", apart)]
    return rows


def fly(setup: Setup, folder: Path, *options: str, aircraft: Path | None = None) -> None:
    """Fly and record into a folder. aircraft: a file in place of the shipped one"""
    (folder / "plan.toml").write_text(plan_text(setup.plan, setup.turbulence_kt), "utf-8")
    (folder / "probe.json").write_bytes(msgspec.json.encode(tunnel_probe()))
    run("sim", "fly", "--replace", "--aircraft", aircraft or setup.aircraft, "--plan", folder / "plan.toml", "--errors",
        setup.world, "--seed", setup.seed, "--probe", folder / "probe.json", "-o", folder, *options)  # fmt: skip


def alone(runs: list[dict], kind: str) -> str:
    """Return the text of a runs.toml with only the longest run of a kind."""

    def duration_s(run: dict) -> float:
        start, end = (float(run[name].removesuffix(" s")) for name in ("start", "end"))
        return end - start

    run = max((run for run in runs if run["kind"] == kind and run["keep"]), key=duration_s)
    return f'[[run]]\nkind = "{kind}"\nstart = "{run["start"]}"\nend = "{run["end"]}"\nkeep = true\n'


def read_results(report: Path) -> dict[str, Any]:
    """Return the content of results.json."""
    return json.loads((report / "results.json").read_text("utf-8"))


def read_truth(folder: Path) -> np.ndarray:
    """Return the simulator's curve: speed [m/s] and power [W], (n, 2)."""
    with (folder / "truth_power_required.csv").open() as file:
        return np.array([(float(row["speed_mps"]), float(row["power_W"])) for row in csv.DictReader(file)])


def plan_text(plan: str, turbulence_kt: float) -> str:
    """Return the text of a shipped plan with turbulence of this W20."""
    text = (resources.files("flightpower.sim") / "plans" / f"{plan}.toml").read_text("utf-8")
    return text.replace("[air]\n", f'[air]\nturbulence = "{turbulence_kt} kt"\n')


def compared(results: dict[str, Any], truth: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Return error and half the interval, % of the truth (2, speeds). truth: from `read_truth`"""
    flown, power, high = (
        np.array([point[name] for point in results["curves"]["power_required"]["points"]])
        for name in ("speed_mps", "power_W", "power_hi_W")
    )
    # Use the curve itself: it is not straight between its points, nor level beyond the last one.
    condition = Condition(*results["test"].values(), results["aircraft"]["wing_area_m2"])
    A = np.array([results["drag_polar"][name] for name in ("A0", "A1", "A2")])
    power_W, _ = power_required(V, Polar(A, np.zeros((3, 3))), condition)
    true = np.interp(V, *truth.T)
    figures = np.stack([power_W / true - 1, np.interp(V, flown, high / power - 1) * power_W / true])
    return np.where((V > flown[0] - 0.2) & (V < flown[-1] + 0.2), 100 * figures, np.nan)
