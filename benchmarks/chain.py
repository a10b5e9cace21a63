"""The whole chain over simulated flights: fakes, daemon, log, analysis; error and coverage of the curve in the results.

    python benchmarks/chain.py --turbulence-kt 3 --flights 8 --seed 0

Each flight is flown and recorded by `sim fly` and analyzed by `analyze`, as a user would: all runs, and by an edited
runs.toml the longest acceleration and the longest deceleration alone. Compared is the curve of results.json with the
simulator's truth at the speeds of benchmarks/estimators.py that were flown; beside it stands what the same flights give
without sensors' buses, counts and log ("direct"), as benchmarks/estimators.py has them, and by how much the two differ.
"""

import csv
import json
import subprocess
import sysconfig
import tempfile
import tomllib
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import estimators
import numpy as np
import typer
from flights import tunnel_probe
from rich.console import Console

from analysis.polar import Condition, Polar, power_required
from flight.aircraft import load_aircraft

SCRIPTS = Path(sysconfig.get_path("scripts"))
ALONE = {"one acceleration": "acceleration", "one deceleration": "deceleration"}
NOT_TRUSTED, REFUSED = 1, 2  # exit codes: a result with a warning; input that is refused


def run(*command: object, may_refuse: bool = False) -> bool:
    """Whether the command did it, or refused its input where it may."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode not in (0, NOT_TRUSTED) and not (may_refuse and done.returncode == REFUSED):
        raise RuntimeError(f"{command}: {done.stderr}")
    return done.returncode != REFUSED


def one_flight(
    folder: Path, plan: Path, errors: str, seed: int, hardware: bool, V: np.ndarray
) -> dict[str, np.ndarray]:
    """By what was kept: error and half the interval, % of the truth (2, speeds); NaN where not flown or refused."""
    flags = [] if hardware else ["--no-hardware"]
    log, report = folder / "log.mcap", folder / "log.report"
    run(SCRIPTS / "sim", "fly", "--plan", plan, "--errors", errors, "--seed", seed,
        "--probe", folder.parent / "probe.json", "-o", folder, *flags)  # fmt: skip
    run(SCRIPTS / "analyze", log, "--quiet")
    truth = read_truth(folder)
    found = {"all runs": compared(read_results(report), truth, V)}
    runs = tomllib.loads((report / "runs.toml").read_text("utf-8"))["run"]
    for name, kind in ALONE.items():
        edited = folder / f"{kind}.toml"
        edited.write_text(alone(runs, kind), "utf-8")
        answered = run(SCRIPTS / "analyze", log, "--quiet", "--runs", edited, "-o", folder / kind, may_refuse=True)
        found[name] = compared(read_results(folder / kind), truth, V) if answered else np.full((2, len(V)), np.nan)
    log.unlink()
    return found


def alone(runs: list[dict], kind: str) -> str:
    """The text of a runs.toml with the longest run of a kind and no other."""

    def duration_s(run: dict) -> float:
        start, end = (float(run[name].removesuffix(" s")) for name in ("start", "end"))
        return end - start

    one = max((run for run in runs if run["kind"] == kind and run["keep"]), key=duration_s)
    return f'[[run]]\nkind = "{kind}"\nstart = "{one["start"]}"\nend = "{one["end"]}"\nkeep = true\n'


def read_results(report: Path) -> dict[str, Any]:
    """The content of results.json."""
    return json.loads((report / "results.json").read_text("utf-8"))


def read_truth(folder: Path) -> np.ndarray:
    """The simulator's curve: speed [m/s] and power [W], (n, 2)."""
    with (folder / "truth_power_required.csv").open() as file:
        return np.array([(float(row["speed_mps"]), float(row["power_W"])) for row in csv.DictReader(file)])


def plan_text(plan: str, turbulence_kt: float) -> str:
    """A shipped plan with turbulence of this W20."""
    text = (resources.files("sim") / "plans" / f"{plan}.toml").read_text("utf-8")
    return text.replace("[air]\n", f'[air]\nturbulence = "{turbulence_kt} kt"\n')


def compared(results: dict[str, Any], truth: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Error and half the interval, % of the truth (2, speeds). truth: as of `read_truth`."""
    flown, power, high = (
        np.array([point[name] for point in results["power_required"]])
        for name in ("speed_mps", "power_W", "power_hi_W")
    )
    # The curve itself: between its points it is no straight line, nor level beyond the last.
    at = Condition(*results["test"].values(), results["aircraft"]["wing_area_m2"])
    A = np.array([results["drag_polar"][name] for name in ("A0", "A1", "A2")])
    found, _ = power_required(V, Polar(A, np.zeros((3, 3))), at)
    true = np.interp(V, *truth.T)
    figures = np.stack([found / true - 1, np.interp(V, flown, high / power - 1) * found / true])
    return np.where((V > flown[0] - 0.2) & (V < flown[-1] + 0.2), 100 * figures, np.nan)


def main(
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "full-test-flight",
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    turbulence_kt: Annotated[float, typer.Option(help="W20 of the Dryden turbulence [kt].")] = 0.0,
    flights: Annotated[int, typer.Option(help="How many; one seed each.")] = 8,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    hardware: Annotated[bool, typer.Option(help="Through fakes and daemon; or straight to the same log.")] = True,
    jobs: Annotated[int, typer.Option(help="Flights at a time.")] = 2,
) -> None:
    aircraft = load_aircraft("nexstar")
    V = estimators.speeds(aircraft)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "plan.toml").write_text(plan_text(plan, turbulence_kt), "utf-8")
        run(SCRIPTS / "sim", "tunnel", "-o", folder / "tunnel.csv")
        run(SCRIPTS / "calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
        with ThreadPoolExecutor(jobs) as pool:
            figures = list(
                pool.map(
                    lambda seed: one_flight(folder / str(seed), folder / "plan.toml", errors, seed, hardware, V),
                    range(first_seed, first_seed + flights),
                )
            )
        todo = [
            estimators.Job(aircraft, tunnel_probe(), errors, plan, turbulence_kt, seed, False)
            for seed in range(first_seed, first_seed + flights)
        ]
        with ProcessPoolExecutor(jobs) as processes:
            direct = list(processes.map(estimators.one_flight, todo))
    console = Console(width=120)
    console.print(f"{errors}, {plan}, W20 = {turbulence_kt:g} kt, {flights} flights, the whole chain")
    rows = {}
    for name in figures[0]:
        rows[name] = [one[name] for one in figures]
        rows[f"{name}, direct"] = [one[name] for one in direct]
    estimators.print_power(console, rows, V)
    for name in figures[0]:
        apart = np.array([one[name][0] - other[name][0] for one, other in zip(figures, direct, strict=True)])
        flown = np.isfinite(apart).any(axis=0)
        rms = " / ".join(f"{value:.2f}" for value in np.sqrt(np.nanmean(apart[:, flown] ** 2, axis=0)))
        refused = sum(np.isnan(one[name]).all() for one in figures)
        console.print(f"{name}, chain less direct, rms: {rms} %; refused: {refused}")


if __name__ == "__main__":
    typer.run(main)
