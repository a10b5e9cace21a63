"""Measures coverage of the power curve's interval in worlds that the analysis does not assume (`sim worlds`).

    python benchmarks/worlds.py --jobs 4
    python benchmarks/worlds.py --worlds weight --weather 0 --plans two-pairs --flights 4 --seed 0
    python benchmarks/worlds.py --worlds study --weather 15 --plans full-test-flight --calibrated
    python benchmarks/worlds.py --defects --weather 0 --plans two-pairs --flights 2 --seed 0

With --calibrated, `calibrate transducers` comes first: a water column whose scale and readings have errors holds each
flight's transducers at the pressures of the plan `transducer-column`, and the flight is analyzed with the result.

Every cell of world, weather and plan is flown with a number of seeds, recorded by `sim fly --no-hardware`, analyzed,
and compared with the true curve of the aircraft flown. Each flight is a line of the file of flights as soon as it is
done. A flight that has a line by this version of the code is not flown again, so that an interrupted study continues.
Seeds below 1000 are for development; figures in the documentation come from others.
"""

import contextlib
import hashlib
import io
import itertools
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import typer
from chain import compared, plan_text, read_truth
from estimators import OVER_STALL, speeds
from flights import COLUMN, COLUMN_SCALE, as_read, column_pressures, error_rows, fly_missing, tunnel_probe
from numpy.typing import ArrayLike, NDArray
from records import Record, counted, markdown, rounded

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.air.transducers import TransducerCalibration, plateaus, readings
from flightpower.analysis.calibrations.transducers import calibrate
from flightpower.analysis.curve import Condition
from flightpower.analysis.methods import cross_check
from flightpower.analysis.pipeline.runs import Analysis, analyze_runs
from flightpower.analysis.records.flight import Trust
from flightpower.analysis.results.files import to_json
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.sim.world import load_world, worlds, worlds_with_defects
from flightpower.simulate import fly

ROOT = Path(__file__).parents[1]
WEATHER_KT, PLANS = (0.0, 3.0, 15.0), ("full-test-flight", "two-pairs")
STUDY, STUDY_FLIGHTS, FLIGHTS = "study", 60, 24
WITHOUT_ERRORS = "none"
# One flight's error and half the 95 % interval at each of OVER_STALL, % of the true power; NaN at speeds not flown.
Points = tuple[ArrayLike, ArrayLike]


class Cell(NamedTuple):
    """One cell of the study."""

    world: str
    weather_kt: float
    plan: str


class Job(NamedTuple):
    """One flight to fly and to analyze."""

    cell: Cell
    seed: int
    version: str
    probe: str  # the probe calibration as text
    calibrated: bool  # whether the transducers are calibrated before the flight


def version() -> str:
    """Return a hash of what a result depends on: code and data of simulator, daemon and analysis, and statistics."""
    digest = hashlib.sha256()
    for folder in ("analysis", "flight", "sim", "hw_fakes", "daq"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".toml", ".csv", ".json") and path.parent.name != "worlds":
                digest.update(path.read_bytes())
    for name in ("worlds", "chain", "estimators"):
        digest.update((ROOT / "benchmarks" / name).with_suffix(".py").read_bytes())
    return digest.hexdigest()[:12]


def world_version(version: str, world: str) -> str:
    """Return the version with that world's file, so that other worlds may change without new flights in this one."""
    return hashlib.sha256(f"{version} {load_world(world)}".encode()).hexdigest()[:12]


def one_flight(job: Job) -> dict[str, Any]:
    """Return one flight's line: error and half the 95 % interval at each speed, % of the truth; warnings and alarms."""
    cell, seed, version, probe, calibrated = job
    line: dict[str, Any] = {**cell._asdict(), "seed": seed, "version": version, "calibrated": calibrated}
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stderr(io.StringIO()):
        folder = Path(name)
        (folder / "plan.toml").write_text(plan_text(cell.plan, cell.weather_kt), "utf-8")
        (folder / "probe.json").write_text(probe, "utf-8")
        output = folder / "flight"
        try:
            fly(output, plan=str(folder / "plan.toml"), world=cell.world, seed=seed, probe=folder / "probe.json",
                no_hardware=True)  # fmt: skip
            replacements = Replacements(transducers=transducers(folder, cell.world, seed) if calibrated else None)
            analysis = analyze_runs(read_log(output / "log.mcap"), replacements)
        except (InputError, np.linalg.LinAlgError) as error:
            return {**line, "refused": str(error).replace(name, "")}
        V, results = speeds(load_aircraft("nexstar")), json.loads(to_json(analysis.results))
        error, half = (
            [float(x) if np.isfinite(x) else None for x in row] for row in compared(results, read_truth(output), V)
        )
    return {
        **line, "error": error, "half": half, "warnings": analysis.results.warnings,
        "alarm": alarm(analysis), "trust": analysis.results.trust,
        "evidence": [e.kind for e in analysis.results.evidence], "disagreements": len(results["disagreements"]),
    }  # fmt: skip


def transducers(folder: Path, world: str, seed: int) -> TransducerCalibration:
    """Calibrate the transducers of one flight. Raises InputError if the data do not support a calibration."""
    output = folder / "column"
    fly(output, plan=COLUMN, world=world, seed=seed, probe=folder / "probe.json", no_hardware=True)
    levels = plateaus(readings(read_log(output / "log.mcap")), COLUMN)
    calibration, unsupported = calibrate(levels, as_read(column_pressures(), seed), COLUMN_SCALE, COLUMN)
    if unsupported:
        raise InputError(unsupported)
    return calibration


def alarm(analysis: Analysis) -> bool:
    """Return whether the cross-check contradicts the curve."""
    test, drag = analysis.results.test, analysis.drag
    condition = Condition(test.weight_N, test.air_density_kgpm3, analysis.results.aircraft.wing_area_m2)
    check = drag.cross_check
    return bool(check and cross_check.disagreement(drag.main.polar, check, condition, drag.flown_CL).differs)


def key(line: dict[str, Any]) -> tuple[Any, ...]:
    identifiers = (line[name] for name in ("world", "weather_kt", "plan", "seed", "version"))
    return (*identifiers, line.get("calibrated", False))


def cells(names: Sequence[str], weather_kt: Sequence[float], plans: Sequence[str]) -> Iterator[Cell]:
    """Yield all cells; calm air is left out for worlds that differ only in their gusts."""
    for world, weather, plan in itertools.product(names, weather_kt, plans):
        by_gusts = any(name.startswith("gust") for name in load_world(world).air)
        if weather or not by_gusts:
            yield Cell(world, weather, plan)


def by_cell(lines: list[dict[str, Any]]) -> dict[Cell, list[dict[str, Any]]]:
    cells: dict[Cell, list[dict[str, Any]]] = {}
    for line in lines:
        cells.setdefault(Cell(line["world"], line["weather_kt"], line["plan"]), []).append(line)
    return cells


def cell_records(lines: list[dict[str, Any]]) -> list[Record]:
    """Return a row per cell: errors, coverage, warnings, alarms and verdicts."""
    records = []
    for cell, members in by_cell(lines).items():
        done = [line for line in members if "error" in line]
        record: Record = {"world": cell.world, "W20, kt": f"{cell.weather_kt:g}", "plan": cell.plan}
        record |= {"flights": len(done), "refused": len(members) - len(done)}
        if done:
            record |= _figures([(line["error"], line["half"]) for line in done])
            record |= {
                "warnings": rounded(np.mean([len(line["warnings"]) for line in done]), 1),
                "alarms, %": rounded(100 * np.mean([line["alarm"] for line in done])),
                "verdicts": [sum(line["trust"] == level for line in done) for level in Trust],
                "evidence": ", ".join(dict.fromkeys(kind for line in done for kind in line["evidence"])) or "-",
            }
        records.append(record)
    return records


def world_records(flights: Mapping[str, Mapping[float, Sequence[Points]]]) -> list[Record]:
    """Return a row per world, all weathers together. flights: of each world, by W20 [kt]"""
    weathers = sorted({weather for by_weather in flights.values() for weather in by_weather})
    names = " / ".join(f"{weather:g}" for weather in weathers)
    records = []
    for world, by_weather in flights.items():
        points = [point for of_weather in by_weather.values() for point in of_weather]
        figures = _figures(points)
        coverage = [_covered(by_weather.get(weather, ())) for weather in weathers]
        records.append({"world": world, "flights": len(points), "coverage, %": figures.pop("coverage, %"),
                        "±": figures.pop("±"), f"at {names} kt": coverage, **figures})  # fmt: skip
    return records


def verdict_records(lines: list[dict[str, Any]]) -> list[Record]:
    """Return a row per world, with its weathers side by side.

    It has coverage, the largest over speeds of the 95th percentile of errors, the narrowest and widest half widths, and
    how many flights are trusted, doubtful, or not to be trusted.
    """
    weathers = sorted({line["weather_kt"] for line in lines})
    weather_text = " / ".join(f"{weather:g}" for weather in weathers)
    records = []
    for world in dict.fromkeys(line["world"] for line in lines):
        of_world = [line for line in lines if line["world"] == world and "error" in line]
        by_weather = [[line for line in of_world if line["weather_kt"] == weather] for weather in weathers]
        figures = [_figures([(line["error"], line["half"]) for line in some]) if some else {} for some in by_weather]
        errors, halves = ([[x for x in figure.get(name, []) if x is not None] for figure in figures]
                          for name in ("error", "half width"))  # fmt: skip
        record: Record = {"world": world, "flights": len(of_world)}
        record[f"coverage at {weather_text} kt, %"] = [figure.get("coverage, %") for figure in figures]
        record["error"] = [max(some, default=None) for some in errors]
        record["half width"] = [f"{min(some):.1f} to {max(some):.1f}" if some else None for some in halves]
        for weather, some in zip(weathers, by_weather, strict=True):
            record[f"verdicts, {weather:g} kt"] = [sum(line["trust"] == level for line in some) for level in Trust]
        kinds = dict.fromkeys(kind for line in of_world for kind in line["evidence"])
        records.append(record | {"evidence": ", ".join(kinds) or None})
    return records


def points_by_world(lines: list[dict[str, Any]], plan: str) -> dict[str, dict[float, list[Points]]]:
    """Return errors and half widths of a plan's flights, by world and W20 [kt]."""
    by_world: dict[str, dict[float, list[Points]]] = {}
    for line in lines:
        if line["plan"] == plan and "error" in line:
            of_world = by_world.setdefault(line["world"], {})
            of_world.setdefault(line["weather_kt"], []).append((line["error"], line["half"]))
    return by_world


def _figures(points: Sequence[Points]) -> Record:
    error, half = (np.array([of_flight[i] for of_flight in points], dtype=float) for i in (0, 1))
    rows = {name: values for name, values, _ in error_rows(error, half)}
    by_flight = zip(np.abs(error) < half, np.isfinite(error), strict=True)
    _, counting = counted([np.mean(inside[determined]) for inside, determined in by_flight if determined.any()])
    return {
        "coverage, %": rounded(coverage(error, half)),
        "±": rounded(counting, 1),
        "at each speed": rounded(rows["coverage, %"]),
        "error": rounded(rows["95 % of errors below"], 1),
        "half width": rounded(rows["half width of intervals"], 1),
    }


def coverage(error: NDArray[np.float64], half: NDArray[np.float64]) -> float:
    """Return the share [%] of the flights' known errors that their intervals cover."""
    finite = np.isfinite(error)
    return float(100 * np.mean(np.abs(error[finite]) < half[finite]))


def _covered(flights: Sequence[Points]) -> int | None:
    if not flights:
        return None
    error, half = (np.array([points[i] for points in flights], dtype=float) for i in (0, 1))
    return rounded(coverage(error, half))


class Study(NamedTuple):
    """The flights to fly: every world in every weather with every plan."""

    worlds: Sequence[str]
    weather_kt: Sequence[float] = WEATHER_KT
    plans: Sequence[str] = PLANS
    flights: int | None = None  # per cell; None means FLIGHTS, or STUDY_FLIGHTS in the world STUDY
    first_seed: int = 1000
    calibrated: bool = False


def flown(study: Study, file: Path, jobs: int) -> list[dict[str, Any]]:
    """Return the lines of all flights of a study; flights that the file lacks are flown.

    They are flown seed by seed over all cells, so that an interrupted study has a few flights of every cell.
    """
    code, probe = version(), msgspec.json.encode(tunnel_probe()).decode()
    of_cell = {cell: study.flights or (STUDY_FLIGHTS if cell.world == STUDY else FLIGHTS)
               for cell in cells(study.worlds, study.weather_kt, study.plans)}  # fmt: skip
    versions = {name: world_version(code, name) for name in study.worlds}
    todo = [Job(cell, study.first_seed + i, versions[cell.world], probe, study.calibrated)
            for i in range(max(of_cell.values())) for cell, n in of_cell.items() if i < n]  # fmt: skip
    wanted = {(*job.cell, job.seed, job.version, job.calibrated): job for job in todo}
    done = fly_missing(file, wanted, one_flight, key, jobs=jobs, summary=summary)
    return [done[identity] for identity in wanted]


def chosen(*, defects: bool) -> list[str]:
    """Return the worlds with one defect each, or all others except `none`."""
    of_defects = worlds_with_defects()
    return [name for name in worlds() if name != WITHOUT_ERRORS and (name in of_defects) == defects]


def main(
    names: Annotated[list[str] | None, typer.Option("--worlds", help="Worlds; all but `none`.")] = None,
    weather_kt: Annotated[
        list[float] | None, typer.Option("--weather", help="W20 of turbulence [kt]; 0, 3, 15.")
    ] = None,
    plans: Annotated[list[str] | None, typer.Option(help="Plans; a whole test flight, and a short one.")] = None,
    flights: Annotated[
        int | None, typer.Option(help=f"Flights a cell; {FLIGHTS}, and {STUDY_FLIGHTS} in the world `{STUDY}`.")
    ] = None,
    first_seed: Annotated[
        int, typer.Option("--seed", help="The first seed; development uses those below 1000.")
    ] = 1000,
    defects: Annotated[
        bool, typer.Option("--defects", help="The worlds of one defect each, docs/evidence/trust.md.")
    ] = False,
    calibrated: Annotated[bool, typer.Option("--calibrated", help="Calibrate the transducers first.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    file: Annotated[Path, typer.Option(help="Where flights are kept, one a line.")] = Path("out/study.jsonl"),
) -> None:
    """Fly what is missing and print the table."""
    study = Study(names or chosen(defects=defects), weather_kt or WEATHER_KT, plans or PLANS, flights, first_seed,
                  calibrated)  # fmt: skip
    lines = flown(study, file, jobs)
    print(f"Speeds: {', '.join(f'{x:g}' for x in OVER_STALL)} times the stalling speed; % of the true power; error: 95"
          " % are below; half width: median; verdicts: trusted, doubtful, not to be trusted.\n")  # fmt: skip
    print(markdown(verdict_records(lines) if defects else cell_records(lines)))
    for plan in study.plans:
        print(f"\n{plan}, all weathers together.\n\n{markdown(world_records(points_by_world(lines, plan)))}")


def summary(line: dict[str, Any]) -> str:
    """Return a line on one flight."""
    head = f"{line['world']}, {line['weather_kt']:g} kt, {line['plan']}, seed {line['seed']}"
    if "error" not in line:
        return f"{head}: refused, {line['refused']}"
    points = zip(line["error"], line["half"], strict=True)
    return f"{head}: {', '.join(f'{e:+.1f}±{h:.1f}' for e, h in points if e is not None)} %"


if __name__ == "__main__":
    typer.run(main)
