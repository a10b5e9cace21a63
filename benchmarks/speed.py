"""Processor time and memory of an analysis, from a new process to the results, without the HTML page.

    python benchmarks/speed.py                      a whole test flight of 21 minutes
    python benchmarks/speed.py --before HEAD~5      the ratio to an earlier version, by turns in one run
    python benchmarks/speed.py --hours 2            the same plan with more runs, until it lasts so long

Processor seconds of one process with one thread; the least of the rounds, since other load only adds. docs/speed.md
quotes the output.
"""

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[1]
SEED = 1001
MINUTES, RUN_PAIRS, PAIR_S = 21, 5, 81.0  # of full-test-flight; a pair is an acceleration, a deceleration and a turn
# In a process of its own: time and memory at the end of each step.
MEASURED = """
import json, resource, sys, time
steps, last = {}, 0.0
def step(name):
    global last
    now = time.process_time()
    steps[name] = steps.get(name, 0.0) + now - last
    last = now
import analysis.cli.analyze
step("import of the command")
from flight.log_reader import read_log
log = read_log(sys.argv[1])
step("reading the log")
from analysis.pipeline import analyze
step("import of the libraries")
doing = ["units of the aircraft file"]
def progress(name):
    step(doing[0])
    doing[0] = name.partition(" from ")[0]
analysis = analyze(log, progress=progress)
step(doing[0])
from analysis.results.files import to_csv, to_json
from analysis.report.trajectory_csv import trajectory_csv
to_json(analysis.results), to_csv(analysis.results), trajectory_csv(analysis.trajectory)
step("JSON and CSV")
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"steps": steps, "MB": peak, "duration_s": float(analysis.table.index[-1])}))
"""


def measured(code: Path, log: Path) -> dict:
    """Seconds of each step and peak memory [MB] of the version in a folder."""
    environment = os.environ | {"PYTHONPATH": str(code), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    ran = subprocess.run(
        [sys.executable, "-c", MEASURED, log], cwd=code, env=environment, capture_output=True, text=True, check=True
    )
    return json.loads(ran.stdout)


def flown(folder: Path, hours: float) -> Path:
    """The log of a simulated flight."""
    plan = (resources.files("sim") / "plans" / "full-test-flight.toml").read_text("utf-8")
    more = round(max(0.0, hours * 3600 - MINUTES * 60) / PAIR_S)
    plan = plan.replace(f"times = {RUN_PAIRS}", f"times = {RUN_PAIRS + more}")
    (folder / "plan.toml").write_text(plan, "utf-8")
    command = ["sim", "fly", "--plan", folder / "plan.toml", "--no-hardware", "--seed", SEED, "-o", folder / "out"]
    subprocess.run([sys.executable, "-m", *map(str, command)], cwd=ROOT, check=True, capture_output=True)
    return folder / "out" / "log.mcap"


def checked_out(revision: str, folder: Path) -> Path:
    """The files of a revision in a folder."""
    data = subprocess.run(["git", "archive", revision], cwd=ROOT, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def main(
    log: Annotated[Path | None, typer.Argument(help="A log; default: a simulated one.")] = None,
    before: Annotated[str, typer.Option(help="Revision to compare with.")] = "",
    hours: Annotated[float, typer.Option(help="Length of the simulated flight; 0: 21 minutes.")] = 0.0,
    rounds: Annotated[int, typer.Option(help="Measurements of each version.")] = 3,
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = (log or flown(folder, hours)).resolve()
        versions = {"now": ROOT}
        if before:
            versions = {f"at {before}": checked_out(before, folder / "before"), **versions}
        found: dict[str, list[dict]] = {version: [] for version in versions}
        for _ in range(rounds):
            for version, code in versions.items():
                found[version].append(measured(code, log))
    print_table(found)


def print_table(found: dict[str, list[dict]]) -> None:
    best = {version: min(ran, key=lambda one: sum(one["steps"].values())) for version, ran in found.items()}
    *_, now = best.values()
    first = next(iter(best.values()))
    title = f"{now['duration_s'] / 60:.0f} minutes of log; processor seconds"
    table = Table("step", *best, *(["ratio"] if len(best) > 1 else []), box=None, title=title, title_justify="left")
    rows = {step: [one["steps"].get(step, 0.0) for one in best.values()] for step in first["steps"]}
    rows["all"] = [sum(one["steps"].values()) for one in best.values()]
    rows["peak memory, MB"] = [one["MB"] for one in best.values()]
    for step, values in rows.items():
        form = "{:.0f}" if "MB" in step else "{:.2f}"
        ratio = [f"{values[0] / values[-1]:.1f}"] if len(values) > 1 and values[-1] else []
        table.add_row(step, *(form.format(value) for value in values), *ratio)
    Console(width=110).print(table)


if __name__ == "__main__":
    typer.run(main)
