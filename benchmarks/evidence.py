"""Produces every figure that README and docs/evidence quote, from one version: runs studies and renders pages.

    python benchmarks/evidence.py                   # parts that this version has not run yet; 90 minutes
    python benchmarks/evidence.py --only worlds     # one of PARTS; may be repeated; says which figures changed
    python benchmarks/evidence.py --quick           # tiny counts, into out/evidence/quick: shows that everything works
    python benchmarks/evidence.py --render          # only the pages, from the files in docs/evidence/data

Each part writes docs/evidence/data/PART.json: its tables, command, commit, date, machine and duration. A part whose
file is from the present commit is not run again; an interrupted part continues from the flights in out/evidence. A part
that fails does not stop the others; it is named at the end, with exit code 1. A page has marks,
`<!-- begin PART.TABLE -->` and `<!-- end -->`, between which a table is written, or for PART alone how it was run.
Seeds begin at SEED; they were not used to choose any setting.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import platform
import re
import subprocess
import sys
import tempfile
import textwrap
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from datetime import date
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple

if find_spec("plotly") is None:
    print("evidence.py needs the development tools: .venv/bin/pip install -e '.[dev]'", file=sys.stderr)
    sys.exit(2)

import calibration
import campaign_figures
import campaigns
import daemon
import dissertation
import numpy as np
import plans
import routes
import speed
import study
import typer
import unnamed
import worlds
from evidence_figures import coverage_by_world, error_by_speed
from flights import Setup
from records import Record, markdown, rounded, text, with_lead

from flightpower.analysis.records.flight import Trust
from flightpower.sim.world import load_world

ROOT = Path(__file__).parents[1]
PAGES, KEPT = ROOT / "docs" / "evidence", ROOT / "out" / "evidence"
SEED = 20000
UNNAMED_SEED = 7000
WEATHER_KT = (0.0, 3.0, 15.0)
WHOLE, SHORT = "full-test-flight", "two-pairs"
AIRCRAFT_OF_OTHER_SIZE = ("light-1kg", "survey-6kg")
# Required range of coverage, %, by world: as assumed, and with errors twice as large as stated; then all other worlds.
ASKED: Mapping[str, tuple[int, int]] = {"study": (93, 97), "twice": (88, 100)}
ASKED_ELSEWHERE = (90, 98)
WIDTH = 118  # characters in a line of text between marks
# Parts of the repository that may change without changing a figure.
NO_FIGURES = ("docs", "paper", "tests", "debian", "README.md", "CHANGELOG.md", "CITATION.cff")
MARK = re.compile(r"(<!-- begin ([\w.-]+) -->)(\n?).*?(<!-- end -->)", re.DOTALL)

Tables = dict[str, list[Record]]


class Run(NamedTuple):
    """How a part is run. n: flights per cell, or other count; folder: for files from which it can continue."""

    n: int
    jobs: int
    folder: Path
    quick: bool

    @property
    def weather_kt(self) -> tuple[float, ...]:
        """W20 of every weather; in a quick run, of one."""
        return WEATHER_KT[:1] if self.quick else WEATHER_KT

    @property
    def whole(self) -> str:
        """The plan of a whole flight; in a quick run, a short plan."""
        return SHORT if self.quick else WHOLE


class Part(NamedTuple):
    """One study. n, quick: numbers of flights or cases in a full and in a quick run; what: the thing counted."""

    tables: Callable[[Run], Tables]
    n: int
    quick: int
    what: str


def judged(record: Record, low: int, high: int) -> Record:
    """Add to a record its required coverage and whether that is met: "open" within two counting errors."""
    covered, counting = record["coverage, %"], record["±"]
    excess = max(low - covered, covered - high)
    outside = "open" if excess < 2 * counting else "too seldom" if covered < low else "too often"
    met = "yes" if excess <= 0 else outside
    return record | {"asked": f"{low} to {high}", "met": met}


def accuracy(run: Run) -> Tables:
    """Study the curve of whole and short flights from their logs, all methods, and aircraft of other sizes."""
    cells = worlds.cell_records(_as_assumed(run, run.n))
    curves = without([judged(cell, *ASKED["study"]) for cell in cells], "world", "refused", "warnings", "alarms, %",
                     "verdicts", "evidence", "asked")  # fmt: skip
    fewer = max(2 * run.n // 3, 1)
    methods, sizes = [], []
    for kt in run.weather_kt[:2]:
        todo = [Setup("nexstar", "study", run.whole, kt, SEED + i) for i in range(fewer)]
        all_curves = study.figures("methods", todo, {}, run.jobs).curves
        methods += with_lead({"W20, kt": f"{kt:g}"}, [_short(curve, "method") for curve in all_curves])
    for aircraft in AIRCRAFT_OF_OTHER_SIZE:
        for kt in run.weather_kt[:2]:
            todo = [Setup(aircraft, "study", run.whole, kt, SEED + i) for i in range(max(run.n // 2, 1))]
            all_curves = [
                curve for curve in study.figures("estimators", todo, {}, run.jobs).curves if curve["of"] == "all runs"
            ]
            sizes += with_lead(
                {"aircraft": aircraft, "W20, kt": f"{kt:g}"},
                without([_short(curve, "runs") for curve in all_curves], "runs"),
            )
    return {"curves": curves, "by_method": _by_weather(methods), "methods": methods, "sizes": sizes}


def _as_assumed(run: Run, n: int) -> list[dict[str, Any]]:
    """Return the lines of `n` whole and `n` short flights in every weather, in the world that the analysis assumes."""
    flights = worlds.Study(["study"], run.weather_kt, tuple({run.whole, SHORT}), n, SEED)
    return worlds.flown(flights, run.folder / "worlds.jsonl", run.jobs)


def _by_weather(methods: Sequence[Record]) -> list[Record]:
    """Return a row per method: coverage, and error and half width at the middle speed, in each weather."""
    weathers = list(dict.fromkeys(record["W20, kt"] for record in methods))
    cells = {(record["method"], record["W20, kt"]): record for record in methods}

    def values_of(method: str, get: Callable[[Record], Any]) -> list[Any]:
        return [get(cells[method, kt]) if (method, kt) in cells else None for kt in weathers]

    return [
        {
            "method": method,
            f"coverage at {' / '.join(weathers)} kt, %": values_of(method, lambda record: record["coverage, %"]),
            "error": values_of(method, lambda record: record["error"][len(record["error"]) // 2]),
            "half width": values_of(
                method, lambda record: record["half width"] and record["half width"][len(record["half width"]) // 2]
            ),
        }
        for method in dict.fromkeys(record["method"] for record in methods)
    ]


def _short(record: Record, title: str) -> Record:
    """Return the columns of a curve that a page shows."""
    renamed = {"error": record["95 % of errors below"], "half width": record["half width"], "mean": record["mean"]}
    return {title: record["of"]} | {name: record[name] for name in ("flights", "coverage, %", "±")} | renamed


def unassumed(run: Run) -> Tables:
    """Study the coverage in every world without a defect."""
    names = worlds.chosen(defects=False)
    tables, judged_ones = {}, {}
    for name, plan, n in (("short", SHORT, 2 * run.n), ("whole", run.whole, run.n)):
        flights = worlds.Study(names[:1] if run.quick else names, run.weather_kt, (plan,), n, SEED)
        lines = worlds.flown(flights, run.folder / "worlds.jsonl", run.jobs)
        judged_ones[name] = judgments(lines)
        world_records = worlds.world_records(worlds.points_by_world(lines, plan))
        tables[name] = [
            judged(world_record, *ASKED.get(world_record["world"], ASKED_ELSEWHERE)) for world_record in world_records
        ]
    what = [{"world": name, "differs from the assumptions by": load_world(name).title} for name in names]
    judgment = [row for name, rows in judged_ones.items() for row in with_lead({"plan": name}, rows)]
    return {"what": what, "coverage": _beside(tables), "judged": judgment, **tables}


def _beside(tables: Mapping[str, Sequence[Record]]) -> list[Record]:
    """Return a row per world: short and whole flights side by side, each at its worst speed."""
    rows: dict[str, Record] = {}
    for name, records in tables.items():
        for record in records:
            row = rows.setdefault(record["world"], {"world": record["world"], "flights": []})
            row["flights"] = [*row["flights"], record["flights"]]
            row[f"{name}: coverage, %"] = f"{record['coverage, %']} ± {record['±']:.0f}"
            row["error" if name == "short" else "error "] = _largest(record["error"])
            row["half width" if name == "short" else "half width "] = _largest(record["half width"])
    return list(rows.values())


def _largest(values: Sequence[float | None]) -> float | None:
    """Return the largest value over the speeds at which the flights have a curve."""
    return max((value for value in values if value is not None), default=None)


def defects(run: Run) -> Tables:
    """Study the verdict in each world with one defect."""
    names = worlds.chosen(defects=True)
    flights = worlds.Study(names[:1] if run.quick else names, run.weather_kt[:2], (SHORT,), run.n, SEED)
    lines = worlds.flown(flights, run.folder / "worlds.jsonl", run.jobs)
    return {"verdicts": worlds.verdict_records(lines), "judged": judgments(lines)}


def without_a_name(run: Run) -> Tables:
    """Study verdicts on defects that no setting covers, and on the flights of `accuracy`, which have no defect."""
    file, label = run.folder / "unnamed.jsonl", worlds.version()
    names = unnamed.named()[:1] if run.quick else unnamed.named()
    wrong = unnamed.flown_lines(names, WEATHER_KT[:2], run.n, UNNAMED_SEED, file, run.jobs, label)
    sound = _as_assumed(run, PARTS["accuracy"].quick if run.quick else PARTS["accuracy"].n)
    judged_ones = [("a defect", unnamed.judged(wrong)), ("none", unnamed.judged(sound))]
    judgment = [row for title, rows in judged_ones for row in with_lead({"flights with": title}, rows)]
    return {"verdicts": unnamed.records(wrong), "judged": judgment}


def judgments(lines: Sequence[Mapping[str, Any]]) -> list[Record]:
    """Count verdicts on correct curves, and on curves that are wrong at some speed by more than half their interval."""
    bounds = {"right": (0.0, 1.0), "wrong by 1.0 to 1.5 half widths": (1.0, 1.5), "by more": (1.5, np.inf)}
    worst = [(line, max(abs(e) / h for e, h in zip(line["error"], line["half"], strict=True) if e is not None))
             for line in lines if "error" in line]  # fmt: skip
    records: list[Record] = []
    for title, (low, high) in bounds.items():
        of_these = [line for line, ratio in worst if low <= ratio < high]
        record: Record = {"curve": title, "flights": len(of_these)}
        record |= unnamed.verdicts(of_these)
        in_worlds = dict.fromkeys(line["world"] for line in of_these if (low < 1.0) == (line["trust"] != Trust.TRUSTED))
        where = f"{'doubted' if low < 1.0 else 'trusted'}: {', '.join(in_worlds)}" if in_worlds else None
        records.append(record | {"where": where})
    return records


def flown_by_others(run: Run) -> Tables:
    """Analyze logs of real flights whose files are available; the dissertation's own are not among them."""
    records = _alone("real_flights", "records", *([["Daredevil, 5 July"]] if run.quick else []))
    return {"flights": records or [{"flight": "not run: the files are not here"}]}


def autopilots(run: Run) -> Tables:
    """Study electrical power from autopilots' logs, and pools of such flights."""
    options = {"data": "electrical" if run.quick else "electrical,blind,torn,rpm"}
    logs, pools = [], []
    for kt in run.weather_kt:
        todo = [Setup("nexstar", "study", "ordinary-flight", kt, SEED + i) for i in range(run.n)]
        figures = study.figures("autopilot-logs", todo, options, run.jobs)
        logs += with_lead({"W20, kt": f"{kt:g}"}, [_short(curve, "log, quantity") for curve in figures.curves])
        refused = sum(count["flights"] for count in figures.counts)
        logs += [{"W20, kt": f"{kt:g}", "log, quantity": "refused", "flights": refused}] if refused else []
    sizes = {"sizes": "1,2", "changed": 1} if run.quick else {"sizes": "1,3,10", "changed": 5}
    for kt in WEATHER_KT[1:2]:
        todo = [Setup("nexstar", "study", "ordinary-flight", kt, SEED + i) for i in range(max(run.n // 5, 1))]
        figures = study.figures("autopilot-pools", todo, sizes, run.jobs)
        pools += with_lead({"W20, kt": f"{kt:g}"}, [_short(curve, "of") for curve in figures.curves])
        pools += [{"W20, kt": f"{kt:g}", "of": count["found"], "flights": count["flights"]} for count in figures.counts]
    return {"logs": logs, "pools": pools}


def pooled(run: Run) -> Tables:
    """Study pools of flights of one installation, differences between configurations, and fleets."""
    most = {"A": 2, "B": 1} if run.quick else {"A": 10, "B": 5}
    flights = campaigns.Study(["study"], [3.0], range(SEED // 100, SEED // 100 + run.n), most)
    lines = campaign_figures.by_campaign(campaigns.flown(flights, run.folder / "campaigns.jsonl", run.jobs))
    pools = [
        pools_record for pools_record in campaign_figures.pools_records(lines) if pools_record["pools"] != "promised"
    ]
    fleets = {
        "change_records": (1 if run.quick else 2 * run.n, SEED, [1.0]),
        "coverage_records": (*((3, 3, 1) if run.quick else (50, 10, 2 * run.n)), SEED),
        "size_records": ([100] if run.quick else [100, 1000, 10000], 10 if run.quick else 50, SEED),
    }
    with ThreadPoolExecutor(run.jobs) as pool:  # each thread waits for its own process
        changes, coverage, sizes = pool.map(lambda name: _alone("fleet", name, *fleets[name]), fleets)
    return {
        "singles": campaign_figures.singles_records(lines),
        "pools": without(pools, "world", "W20, kt"),
        "differences": without(campaign_figures.comparison_records(lines), "world", "W20, kt"),
        "changes": without(changes, "noise"),
        "coverage": coverage,
        "sizes": sizes,
    }


def planned(run: Run) -> Tables:
    """Compare planned flights with the shipped plan of the same length."""
    cells = [(0.0, 8.0)] if run.quick else [(0.0, 8.0), (3.0, 8.0), (3.0, 21.0)]
    flights = plans.Study("nexstar", "curve", cells, range(SEED, SEED + run.n))
    records = plans.records(plans.flown(flights, run.folder / "plans.jsonl", run.jobs))
    return {"plans": without(records, "aircraft, question", "lost")}


def missions(run: Run) -> Tables:
    """Compare missions with predictions from one flight's curve, and a third as many from the curve of five flights."""
    aircraft, curves = (routes.AIRCRAFT[:1], {1: 1}) if run.quick else (routes.AIRCRAFT, {1: 1, 5: 3})
    records: list[Record] = []
    for curve, fewer in curves.items():
        seeds = range(SEED, SEED + max(run.n // (fewer * len(aircraft)), 1))
        records += routes.records(aircraft, "study", seeds, curve, run.jobs)
    return {"missions": records}


def calibrations(run: Run) -> Tables:
    """Study the probe's maps from wind tunnels, and a line's lag from bursts of pressure."""
    seeds = range(SEED, SEED + run.n)
    lags = [(25.0, 8), (25.0, 36)]
    return {
        "probe": calibration.probe_records(seeds, run.jobs),
        "tubing": [calibration.tubing_record(seeds, 0.4, *lag, run.jobs) for lag in lags[: 1 if run.quick else 2]],
    }


def performance(run: Run) -> Tables:
    """Measure time and memory of an analysis, of a long log, and of the simulator. n: rounds"""
    with tempfile.TemporaryDirectory() as modules:
        now = speed.records(None, [], 0.0, run.n, Path(modules))
        if not run.quick:
            longer = {record["step"]: record["now"] for record in speed.records(None, [], 2.0, 1, Path(modules))}
            now = [
                {"step": record["step"], "21 minutes": record["now"], "2 hours": longer.get(record["step"])}
                for record in now
            ]
    return {"analysis": now, "simulator": _alone("simulator", "records", log=not run.quick)}


def reliability(run: Run) -> Tables:
    """Test the daemon in real time, in every scheduled fault, over hours, and after a power cut. n: minutes"""
    rates = [25.0] if run.quick else [25.0, 100.0]
    seconds = 5.0 if run.quick else 60.0 * run.n
    with ProcessPoolExecutor(len(rates)) as pool:  # both run at once, because they mostly wait
        soaks = list(pool.map(_soaked, rates, [seconds] * len(rates))) if os.geteuid() == 0 else []
    faults = [] if run.quick else _alone("daemon", "fault_records")
    lost = {"faults": len(faults), "ticks missed": sum(fault["missed"] for fault in faults),
            "readings lost by other sensors": sum(fault["lost by others"] for fault in faults),
            "longest until back, s": max([fault["back after, s"] for fault in faults], default=None)}  # fmt: skip
    return {
        "soaks": soaks or [{"min": "not run: needs root"}],
        "faults": [lost],
        "day": [_alone("daemon", "day_record", 25.0, 0.2 if run.quick else 2.0, 6.0 if run.quick else 15.0)],
        "mend": [_alone("daemon", "mend_record", 0.1 if run.quick else 1.0)],
    }


def _soaked(rate: float, seconds: float) -> Record:
    return daemon.soaked(seconds, rate, fifo=True)


def source(run: Run) -> Tables:
    """Repeat the dissertation's results with simulated flights; `make dissertation` draws their figures."""
    if run.quick:
        return {name: [] for name in ("cases", "curves", "estimates", "limits", "by_noise")}
    tables = dissertation.tables(*dissertation.analyzed(run.folder / version() / "dissertation", run.jobs))
    middle, largest = "in the middle half of the speeds, W", "largest error, %"
    of_cases = [curve for curve in tables["curves"] if curve["plan"].startswith("case")]
    pairs = [curve for curve in tables["curves"] if curve["plan"] == "two-pairs" and curve["noise"] == 1]
    return {
        "cases": _by_method(of_cases, middle),
        "curves": _by_method(pairs, largest),
        **{name: tables[name] for name in ("estimates", "limits", "by_noise")},
    }


def _by_method(curves: Sequence[Record], value: str) -> list[Record]:
    """Return a row per flight and a column per method: a value, and the share of covered speeds [%]."""
    rows: dict[tuple[str, str], Record] = {}
    for curve in curves:
        row = rows.setdefault(
            (curve["plan"], curve["aircraft"]), {"plan": curve["plan"], "aircraft": curve["aircraft"]}
        )
        row[curve["method"]] = f"{curve[value]} ({curve['speeds covered, %']})" if value in curve else None
    return list(rows.values())


def _alone(module: str, function: str, *arguments: Any, **options: Any) -> Any:
    """Return the result of a benchmark's function from its own process, which shares neither memory nor settings."""
    called = f"{module}.{function}(*json.loads(sys.argv[1]), **json.loads(sys.argv[2]))"
    code = f"import json, sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import {module}; result = {called}"
    ran = subprocess.run(
        [sys.executable, "-c", f"{code}; print(json.dumps(result))", json.dumps(arguments), json.dumps(options)],
        cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    return json.loads(ran.stdout.splitlines()[-1])


PARTS: Mapping[str, Part] = {
    "accuracy": Part(accuracy, 12, 1, "flights a cell"),
    "worlds": Part(unassumed, 1, 1, "whole flight a world and weather, two short ones"),
    "defects": Part(defects, 3, 1, "flights a cell"),
    "unnamed": Part(without_a_name, 1, 1, "flight a defect and weather; those without one are of `accuracy`"),
    "real-flights": Part(flown_by_others, 1, 1, "analysis of each flight"),
    "autopilots": Part(autopilots, 20, 1, "flights a weather"),
    "pools": Part(pooled, 4, 1, "campaigns"),
    "planned": Part(planned, 8, 1, "flights a cell"),
    "routes": Part(missions, 30, 1, "missions by the curve of one flight, and a third as many by the curve of five"),
    "calibrations": Part(calibrations, 40, 2, "tunnels, and logs of a line"),
    "performance": Part(performance, 3, 1, "rounds"),
    "reliability": Part(reliability, 3, 1, "minutes"),
    "dissertation": Part(source, 1, 1, "flight of each kind"),
}


def version() -> str:
    """Return the last commit that changed the source of figures, marked if files differ from it."""
    inside = ("--", ".", *(f":!{name}" for name in NO_FIGURES))

    def git(*words: str) -> str:
        return subprocess.run(["git", *words, *inside], cwd=ROOT, check=True, capture_output=True, text=True).stdout

    changed = "-changed" if git("status", "--porcelain", "--untracked-files=no").strip() else ""
    return git("log", "-1", "--format=%h").strip() + changed


def machine() -> str:
    """Return the number of cores, the Python version and the kind of processor."""
    match = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text()) if sys.platform == "linux" else None
    python = ".".join(platform.python_version_tuple()[:2])
    return f"{os.cpu_count()} cores, Python {python}, {match[1] if match else platform.machine()}"


def run_part(name: str, data: Path, jobs: int, *, quick: bool) -> None:
    """Run a part and write its file, unless the file is from this version."""
    part, path, commit = PARTS[name], data / f"{name}.json", version()
    if not quick and path.exists() and json.loads(path.read_text("utf-8"))["commit"] == commit:
        print(f"{name}: {commit} has run", file=sys.stderr)
        return
    began, used = time.monotonic(), _processor_s()
    n = part.quick if quick else part.n
    tables = part.tables(Run(n, jobs, KEPT / "quick" if quick else KEPT, quick))
    content = {
        "command": f"python benchmarks/evidence.py --only {name}" + (" --quick" if quick else ""),
        "commit": commit,
        "date": date.today().isoformat(),
        "machine": machine(),
        "minutes": rounded((time.monotonic() - began) / 60, 1),
        "processor_minutes": rounded((_processor_s() - used) / 60, 1),
        "count": n,
        "of": part.what,
        "tables": tables,
    }
    data.mkdir(parents=True, exist_ok=True)
    before = json.loads(path.read_text("utf-8")) if path.exists() else {}
    written = json.dumps(content, indent=1, ensure_ascii=False)
    path.write_text(written + "\n", "utf-8")
    print(
        f"{name}: {content['minutes']} min, {content['processor_minutes']} of a processor", file=sys.stderr, flush=True
    )
    if "tables" in before:
        moved = differing(before["tables"], json.loads(written)["tables"])
        places = f"{len(moved)} place{'s' if len(moved) > 1 else ''}"
        difference = f"differ at {places} from those of commit {before['commit']}, first at {moved[0]}" if moved else ""
        print(
            f"{name}: its figures {difference or 'are those of commit ' + before['commit']}",
            file=sys.stderr,
            flush=True,
        )


def differing(before: object, after: object, where: str = "") -> list[str]:
    """Return the places where two JSON contents differ, such as curves.3.error."""
    if isinstance(before, dict) and isinstance(after, dict):
        names = [*before, *(name for name in after if name not in before)]
        pairs = [(str(name), before.get(name), after.get(name)) for name in names]
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        pairs = [(str(i), *pair) for i, pair in enumerate(zip(before, after, strict=True))]
    else:
        return [] if before == after else [where]
    return [place for name, *pair in pairs for place in differing(*pair, f"{where}.{name}".lstrip("."))]


def run_parts(names: Sequence[str], data: Path, jobs: int, *, quick: bool) -> list[str]:
    """Run the parts and return those that failed; a failed part does not stop the others and leaves its file
    unchanged."""
    failed = []
    for name in names:
        try:
            run_part(name, data, jobs, quick=quick)
        except (Exception, SystemExit):  # a study calls exit when it has nothing to count
            traceback.print_exc()
            print(f"{name}: failed", file=sys.stderr, flush=True)
            failed.append(name)
    return failed


def _processor_s() -> float:
    """Return the processor time of this process and its finished children."""
    return sum(os.times()[:4])


def rendered(page: str, data: Path) -> str:
    """Return the text of a page with tables from the data files. Raises KeyError if a file lacks a table."""

    def between(mark: re.Match[str]) -> str:
        name, _, table = mark[2].partition(".")
        path = data / f"{name}.json"
        content = f"Not run yet: `python benchmarks/evidence.py --only {name}`."
        if path.exists():
            stored = json.loads(path.read_text("utf-8"))
            content = _table(stored["tables"], table) if table else _summary_sentence(stored)
        return f"{mark[1]}{mark[3]}{content}{mark[3]}{mark[4]}"

    return MARK.sub(between, page)


def _table(tables: Tables, name: str) -> str:
    """Return a table; for NAME-in-words a sentence on it, for NAME-not-met the cells that miss the required range."""
    if name.endswith("-in-words"):
        records = tables[name.removesuffix("-in-words")]
        return _flights_in_words(records) if "flight" in records[0] else _in_words(records)
    if not name.endswith("-not-met"):
        return markdown([_with_counting_error(table) for table in tables[name]])
    by_met: dict[str, list[str]] = {}
    always = 0
    for table in tables[name.removesuffix("-not-met")]:
        if table["met"] == "open" and table["coverage, %"] == 100:
            always += 1
        else:
            by_met.setdefault(table["met"], []).append(f"`{table['world']}` {text(table['coverage, %'])} %")
    sentence = (
        ("too seldom", "Covered too seldom"),
        ("too often", "Covered too often"),
        ("open", "Open, outside by less than two counting errors"),
    )
    lines = [f"- {title}: {', '.join(by_met[met])}." for met, title in sentence if met in by_met]
    lines += [f"- Every value was covered, but in too few flights to exclude 98 %: {always} worlds."] if always else []
    return "\n".join(lines) or "- All are met."


def _with_counting_error(record: Record) -> Record:
    """Put each counting error behind its value instead of in its own column."""
    joined, before = dict(record), ""
    for name, value in record.items():
        if name == "±":
            del joined[name]
            if value is not None:
                joined[before] = f"{text(record[before])} ± {text(value)}"
        before = name
    return joined


def without(records: Sequence[Record], *names: str) -> list[Record]:
    """Return the records without these columns."""
    return [{name: value for name, value in record.items() if name not in names} for record in records]


def _in_words(curves: Sequence[Record]) -> str:
    """Return the README's sentence on whole simulated flights in light and in strong turbulence."""
    light, strong = (
        next(curve for curve in curves if (curve["plan"], curve["W20, kt"]) == (WHOLE, kt)) for kt in ("3", "15")
    )
    (low, high), (least, most) = ((min(record["error"]), max(record["error"])) for record in (light, strong))
    return textwrap.fill(
        "In flights of 21 minutes, each with errors of sensors, installation and propeller of its own, 95 % of the"
        f" errors of power required were below {low} to {high} %, depending on speed, in light turbulence (3 kt of wind"
        f" at 20 ft), and below {least} to {most} % in strong turbulence (15 kt). The 95 % interval contained the truth"
        f" at {light['coverage, %']} and {strong['coverage, %']} % of the speeds of {light['flights']} flights each",
        WIDTH,
    )


def _flights_in_words(records: Sequence[Record]) -> str:
    """Return the README's sentence on real flights."""
    errors = {record["flight"]: [abs(float(end)) for end in record["error, %"].split(" to ")]
              for record in records if "error, %" in record}  # fmt: skip
    titles = ("its decelerations alone", "Daredevil, 10 July", "Daredevil, 5 July", "Cyclone")
    if not errors.keys() >= set(titles):
        return "not run by this version"
    citation, wing, again, tailsitter = (errors[title] for title in titles)
    inside = next(record["inside"] for record in records if record["flight"] == "Cyclone")
    least, most = min(tailsitter), max(tailsitter)
    return textwrap.fill(
        f"power required of a Cessna Citation II by its decelerations is within {max(citation):.1f} %, thrust given;"
        f" battery power of a small flying wing within {max(wing):.0f} % in one flight and {max(again):.0f} % in"
        f" another; that of a tailsitter is {least:.0f} to {most:.0f} % off, and inside its interval at"
        f" {inside} speeds",
        WIDTH,
    )


def _summary_sentence(content: Mapping[str, Any]) -> str:
    """Return a sentence on how the tables in a file were made."""
    took = f", {content['minutes']} minutes" if content["minutes"] is not None else ""
    what = (
        f"{content['count']} {content['of']}; commit {content['commit']}, {content['date']}{took}, {content['machine']}"
    )
    return f"`{content['command']}`: {what}."


def render(pages: Path, figures: Path) -> None:
    """Write tables and figures from the data files into the pages."""
    data = pages / "data"
    for path in (*sorted(pages.glob("*.md")), *((ROOT / "README.md",) if pages == PAGES else ())):
        path.write_text(rendered(path.read_text("utf-8"), data), "utf-8")
    figure_functions = {
        "worlds": ("coverage-by-world.svg", lambda tables: coverage_by_world(tables["short"], ASKED_ELSEWHERE)),
        "accuracy": ("error-by-speed.svg", lambda tables: error_by_speed(tables["curves"], WHOLE)),
    }
    for part, (name, draw) in figure_functions.items():
        if (data / f"{part}.json").exists():
            tables = json.loads((data / f"{part}.json").read_text("utf-8"))["tables"]
            (figures / name).write_text(draw(tables), "utf-8")


def main(
    only: Annotated[list[str] | None, typer.Option(help=f"One part; may be repeated: {', '.join(PARTS)}.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Tiny counts, into out/evidence/quick.")] = False,
    render_only: Annotated[bool, typer.Option("--render", help="Run nothing.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    """Run what this version has not run (all of it takes 90 minutes; a page says how long a part does), and render the
    pages. Says whether the figures equal the stored ones."""
    pages = PAGES
    if quick:
        pages = KEPT / "quick" / "pages"
        pages.mkdir(parents=True, exist_ok=True)
        for path in PAGES.glob("*.md"):
            (pages / path.name).write_text(path.read_text("utf-8"), "utf-8")
    for name in only or []:
        if name not in PARTS:
            raise typer.BadParameter(f"{name} is not one of {', '.join(PARTS)}")
    failed = run_parts([] if render_only else only or list(PARTS), pages / "data", jobs, quick=quick)
    render(pages, pages if quick else ROOT / "docs" / "figures")
    print(f"{os.path.relpath(pages, ROOT)}: rendered")
    if failed:
        sys.exit(f"failed, with what was measured before on the pages: {', '.join(failed)}")


if __name__ == "__main__":
    typer.run(main)
