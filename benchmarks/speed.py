"""Processor time and memory of an analysis, from a new process to the report: `python benchmarks/bench.py analysis`.

It uses a whole test flight of 21 minutes. `--with before=HEAD~5` gives the ratio to an earlier version, by turns in one
run; `--with hours=2` flies more runs of the plan until the flight is that long; `--with log=FILE` uses this log. Times
are processor seconds of one process with one thread, the least of the rounds, since other load only adds time. The last
row is the command's elapsed time with its default number of processes. A first run is not measured, because it compiles
the modules for later runs. Modules move between versions, so each version is measured by the steps that its own copy of
this file names.
"""

import ast
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from records import Record, rounded

ROOT = Path(__file__).parents[1]
SEED = 1001
MINUTES, RUN_PAIRS, PAIR_S = 21, 5, 81.0  # of full-test-flight; a pair has an acceleration, a deceleration and a turn
# Runs in its own process, and prints time and memory at the end of each step.
MEASURED = """
import json, resource, sys, time
from pathlib import Path
steps, last = {}, 0.0
def step(name):
    global last
    now = time.process_time()
    steps[name] = steps.get(name, 0.0) + now - last
    last = now
import flightpower.analysis.cli.analyze
step("import of the command")
from flightpower.flight.log_reader import read_log
log = read_log(sys.argv[1])
step("reading the log")
from flightpower.analysis.pages.lean_imports import import_lean
import_lean()
from flightpower.analysis.pipeline.runs import analyze_runs
from flightpower.analysis.pages.write import write_report
step("import of the libraries")
doing = ["units of the aircraft file"]
def progress(name):
    step(doing[0])
    doing[0] = name.partition(" from ")[0]
analysis = analyze_runs(log, progress=progress)
step(doing[0])
write_report(analysis, Path(sys.argv[2]))
step("writing the report")
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"steps": steps, "MB": peak, "duration_s": float(analysis.table.index[-1])}))
"""


def measured_steps(code: Path) -> str:
    """Return the program MEASURED of the version in `code`, which knows where that version's modules are.

    Raises SystemExit if that version has none.
    """
    file = code / "benchmarks" / "speed.py"
    tree = ast.parse(file.read_text("utf-8") if file.exists() else "")
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id="MEASURED")], value=ast.Constant(value=str(program))):
                return program
    raise SystemExit(f"{code.name}: benchmarks/speed.py has no MEASURED there; name a later revision")


def measured(code: Path, log: Path, report: Path, modules: Path) -> dict:
    """Return seconds for each step and peak memory [MB] of the version in `code`. modules: its compiled modules"""
    program = [sys.executable, "-c", measured_steps(code), str(log), str(report)]
    environment = environment_of(code, modules)
    ran = subprocess.run(program, cwd=code, env=environment, capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


def clocked_s(code: Path, log: Path, report: Path, modules: Path) -> float:
    """Return the elapsed seconds of the command `analyze`."""
    command = [sys.executable, "-m", "flightpower", "analyze", str(log), "-o", str(report)]
    begin = time.monotonic()
    subprocess.run(command, cwd=code, env=environment_of(code, modules), capture_output=True, check=True)
    return time.monotonic() - begin


def environment_of(code: Path, modules: Path) -> dict[str, str]:
    environment = os.environ | {"PYTHONPATH": str(code), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return environment | {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(modules)}


def flown(folder: Path, hours: float) -> Path:
    """Return the log of a simulated flight."""
    plan = (resources.files("flightpower.sim") / "plans" / "full-test-flight.toml").read_text("utf-8")
    more = round(max(0.0, hours * 3600 - MINUTES * 60) / PAIR_S)
    plan = plan.replace(f"times = {RUN_PAIRS}", f"times = {RUN_PAIRS + more}")
    (folder / "plan.toml").write_text(plan, "utf-8")
    options = ["--plan", folder / "plan.toml", "--no-hardware", "--seed", str(SEED), "-o", folder / "out"]
    command = [sys.executable, "-m", "flightpower", "sim", "fly", *options]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return folder / "out" / "log.mcap"


def checked_out(revision: str, folder: Path) -> Path:
    """Put the files of a revision into a folder, and return their folder."""
    packed = subprocess.run(["git", "archive", revision], cwd=ROOT, check=True, capture_output=True).stdout
    folder.mkdir(parents=True)
    subprocess.run(["tar", "-x", "-C", folder], input=packed, check=True)
    return folder


def records(
    log: Path | None, before: Sequence[str], hours: float, rounds: int, modules: Path | None = None
) -> list[Record]:
    """Return seconds for each step by version, and peak memory, from the round with the least time.

    modules: a folder for compiled modules; if an earlier call has filled it, there is no unmeasured first run.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = (log or flown(folder, hours)).resolve()
        versions = {f"at {revision}": checked_out(revision, folder / revision) for revision in before}
        versions["now"] = ROOT
        timings: dict[str, list[dict]] = {version: [] for version in versions}
        modules = modules or folder / "modules"
        not_measured = 0 if modules.exists() and any(modules.iterdir()) else 1
        for number in range(not_measured + rounds):
            for version, code in versions.items():
                timing = measured(code, log, folder / "report", modules)
                timing["clock_s"] = clocked_s(code, log, folder / "report", modules)
                if number >= not_measured:
                    timings[version].append(timing)
    best = {version: min(ran, key=lambda timing: sum(timing["steps"].values())) for version, ran in timings.items()}
    *_, now = best.values()
    rows = {step: [timing["steps"].get(step, 0.0) for timing in best.values()] for step in now["steps"]}
    rows["all"] = [sum(timing["steps"].values()) for timing in best.values()]
    rows["peak memory, MB"] = [timing["MB"] for timing in best.values()]
    rows["the command, by the clock"] = [min(timing["clock_s"] for timing in ran) for ran in timings.values()]
    table: list[Record] = [{"step": "minutes of log", "now": rounded(now["duration_s"] / 60)}]
    for step, values in rows.items():
        cells = [rounded(value, 0 if "MB" in step else 2) for value in values]
        ratio = {"ratio": rounded(values[0] / values[-1], 2)} if len(values) > 1 and values[-1] else {}
        table.append({"step": step, **dict(zip(best, cells, strict=True)), **ratio})
    return table
