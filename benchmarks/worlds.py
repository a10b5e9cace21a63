"""Coverage of the power curve's interval in worlds that the analysis does not assume (`sim worlds`).

    python benchmarks/worlds.py --jobs 4
    python benchmarks/worlds.py --worlds weight --weather 0 --plans two-pairs --flights 4 --seed 0
    python benchmarks/worlds.py --worlds study --weather 15 --plans full-test-flight --calibrated
    python benchmarks/worlds.py --defects --weather 0 --plans two-pairs --flights 2 --seed 0

With --calibrated, `calibrate transducers` comes first: the transducers of each flight are held at the pressures of the
plan `transducer-column`, by a water column whose scale and readings have errors, and the flight is analyzed with the
result.

Every cell of world, weather and plan is flown with a number of seeds, recorded by `sim fly --no-hardware`, analyzed,
and compared with the true curve of the aircraft flown. Each flight is a line of the file of flights as soon as it is
done. A flight that has a line by this version of the code is not flown again, so that an interrupted study continues.
Seeds below 1000 are for development; figures of the documentation come from others.
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

from analysis.airdata.transducers import TransducerCalibration, calibrate, plateaus, readings
from analysis.drag import cross_check
from analysis.log_contents import Replacements
from analysis.pipeline import Analysis, analyze
from analysis.polar import Condition
from analysis.results.files import to_json
from analysis.schema import Trust
from flight.aircraft import load_aircraft
from flight.errors import InputError
from flight.log_reader import read_log
from sim.__main__ import fly
from sim.world import load_world, worlds, worlds_with_defects

ROOT = Path(__file__).parents[1]
WEATHER_KT, PLANS = (0.0, 3.0, 15.0), ("full-test-flight", "two-pairs")
STUDY, STUDY_FLIGHTS, FLIGHTS = "study", 60, 24
WITHOUT_ERRORS = "none"
# Error and half the 95 % interval of one flight at each of OVER_STALL, % of the true power; NaN where it did not fly.
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
    probe: str  # text of the probe calibration
    calibrated: bool  # transducers, before the flight


def version() -> str:
    """Hash of what a result depends on: code and data of simulator, daemon and analysis, and how errors are counted."""
    digest = hashlib.sha256()
    for folder in ("analysis", "flight", "sim", "hw_fakes", "daq"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".toml", ".csv", ".json") and path.parent.name != "worlds":
                digest.update(path.read_bytes())
    for name in ("worlds", "chain", "estimators"):
        digest.update((ROOT / "benchmarks" / name).with_suffix(".py").read_bytes())
    return digest.hexdigest()[:12]


def world_version(version: str, world: str) -> str:
    """The version with that world's file: another world may change without a new flight of this one."""
    return hashlib.sha256(f"{version} {load_world(world)}".encode()).hexdigest()[:12]


def one_flight(job: Job) -> dict[str, Any]:
    """The line of one flight: error and half the 95 % interval at each speed, % of the truth; warnings and alarms."""
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
            given = Replacements(transducers=transducers(folder, cell.world, seed) if calibrated else None)
            analysis = analyze(read_log(output / "log.mcap"), given)
        except (InputError, np.linalg.LinAlgError) as error:
            return {**line, "refused": str(error).replace(name, "")}
        V, results = speeds(load_aircraft("nexstar")), json.loads(to_json(analysis.results))
        error, half = (
            [float(x) if np.isfinite(x) else None for x in row] for row in compared(results, read_truth(output), V)
        )
    return {
        **line, "error": error, "half": half, "warnings": analysis.results.warnings,
        "alarm": alarm(analysis), "trust": analysis.results.trust,
        "evidence": [one.kind for one in analysis.results.evidence], "disagreements": len(results["disagreements"]),
    }  # fmt: skip


def transducers(folder: Path, world: str, seed: int) -> TransducerCalibration:
    """The calibration of the transducers of one flight. Raises InputError if its data do not support it."""
    output = folder / "column"
    fly(output, plan=COLUMN, world=world, seed=seed, probe=folder / "probe.json", no_hardware=True)
    found = plateaus(readings(read_log(output / "log.mcap")), COLUMN)
    calibration, unsupported = calibrate(found, as_read(column_pressures(), seed), COLUMN_SCALE, COLUMN)
    if unsupported:
        raise InputError(unsupported)
    return calibration


def alarm(analysis: Analysis) -> bool:
    """Whether the cross-check contradicts the curve."""
    test, drag = analysis.results.test, analysis.drag
    condition = Condition(test.weight_N, test.air_density_kgpm3, analysis.results.aircraft.wing_area_m2)
    check = drag.cross_check
    return bool(check and cross_check.disagreement(drag.main.polar, check, condition, drag.flown_CL).differs)


def key(line: dict[str, Any]) -> tuple[Any, ...]:
    known = (line[name] for name in ("world", "weather_kt", "plan", "seed", "version"))
    return (*known, line.get("calibrated", False))


def cells(names: list[str], weather_kt: list[float], plans: list[str]) -> Iterator[Cell]:
    """All cells; calm air is left out where a world differs by its gusts alone."""
    for world, weather, plan in itertools.product(names, weather_kt, plans):
        by_gusts = any(name.startswith("gust") for name in load_world(world).air)
        if weather or not by_gusts:
            yield Cell(world, weather, plan)


def tables(lines: list[dict[str, Any]]) -> str:
    """Markdown: one row a cell."""
    speed_names = " / ".join(f"{x:g}" for x in OVER_STALL)
    out = [
        f"Speeds: {speed_names} times the stalling speed. Coverage of the 95 % interval over all speeds, and at each;"
        " 95 % of errors below; median half width; % of the truth. Warnings a flight; share with a cross-check alarm;"
        " flights that are trusted, doubtful, and not to be trusted, and the evidence.",
        "",
        "| world | W20, kt | plan | flights | coverage, % | at each speed | error | half width | warnings"
        " | alarms, % | verdicts | evidence |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    by_cell: dict[Cell, list[dict[str, Any]]] = {}
    for line in lines:
        by_cell.setdefault(Cell(line["world"], line["weather_kt"], line["plan"]), []).append(line)
    for cell, members in by_cell.items():
        done = [line for line in members if "error" in line]
        refused = f" ({len(members) - len(done)} refused)" if len(done) < len(members) else ""
        head = f"| {cell.world} | {cell.weather_kt:g} | {cell.plan} | {len(done)}{refused} |"
        if not done:
            out.append(f"{head} - | - | - | - | - | - | - | - |")
            continue
        error, half = (np.array([line[name] for line in done], dtype=float) for name in ("error", "half"))
        rows = {name: row for name, row, _ in error_rows(error, half)}

        def listed(name: str, form: str, rows: dict[str, np.ndarray] = rows) -> str:
            return " / ".join(form.format(x) if np.isfinite(x) else "-" for x in rows[name])

        warnings = np.mean([len(line["warnings"]) for line in done])
        alarms = 100 * np.mean([line["alarm"] for line in done])
        verdicts = " / ".join(str(sum(line["trust"] == level for line in done)) for level in Trust)
        evidence = ", ".join(dict.fromkeys(kind for line in done for kind in line["evidence"])) or "-"
        out.append(
            f"{head} {coverage(error, half):.0f} | {listed('coverage, %', '{:.0f}')}"
            f" | {listed('95 % of errors below', '{:.1f}')} | {listed('half width of intervals', '{:.1f}')}"
            f" | {warnings:.1f} | {alarms:.0f} | {verdicts} | {evidence} |"
        )
    for plan in dict.fromkeys(cell.plan for cell in by_cell):
        flights: dict[str, dict[float, list[Points]]] = {}
        for cell, members in by_cell.items():
            done = [(line["error"], line["half"]) for line in members if "error" in line]
            if cell.plan == plan and done:
                flights.setdefault(cell.world, {})[cell.weather_kt] = done
        out += ["", f"Plan {plan}.", *world_table(flights)]
    return "\n".join(out)


def world_table(flights: Mapping[str, Mapping[float, Sequence[Points]]]) -> list[str]:
    """Markdown lines, one a world. flights: of each world, by W20 [kt]."""
    weathers = sorted({weather for by_weather in flights.values() for weather in by_weather})
    speed_names = " / ".join(f"{x:g}" for x in OVER_STALL)
    names = " / ".join(f"{weather:g}" for weather in weathers)
    out = [
        f"All weathers together. Speeds: {speed_names} times the stalling speed. 95 % of errors below; median half"
        " width; % of the true power.",
        "",
        f"| world | flights | coverage, % | at {names} kt | at each speed | error | half width |",
        "|---|---|---|---|---|---|---|",
    ]
    for world, by_weather in flights.items():
        error, half = (
            np.array([points[i] for of_weather in by_weather.values() for points in of_weather], dtype=float)
            for i in (0, 1)
        )
        rows = {name: values for name, values, _ in error_rows(error, half)}
        of_weather = " / ".join(_covered(by_weather.get(weather, ())) for weather in weathers)
        listed = " | ".join(
            " / ".join("-" if np.isnan(x) else f"{x:.{digits}f}" for x in rows[name])
            for name, digits in (("coverage, %", 0), ("95 % of errors below", 1), ("half width of intervals", 1))
        )
        out.append(f"| {world} | {len(error)} | {coverage(error, half):.0f} | {of_weather} | {listed} |")
    return out


def coverage(error: NDArray[np.float64], half: NDArray[np.float64]) -> float:
    """Share [%] of the flights' known errors that their intervals cover."""
    known = np.isfinite(error)
    return float(100 * np.mean(np.abs(error[known]) < half[known]))


def _covered(flights: Sequence[Points]) -> str:
    if not flights:
        return "-"
    error, half = (np.array([points[i] for points in flights], dtype=float) for i in (0, 1))
    return f"{coverage(error, half):.0f}"


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
        bool, typer.Option("--defects", help="The worlds of one defect each, docs/understand/trust.md.")
    ] = False,
    calibrated: Annotated[bool, typer.Option("--calibrated", help="Calibrate the transducers first.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    file: Annotated[Path, typer.Option(help="Where flights are kept, one a line.")] = Path("out/study.jsonl"),
) -> None:
    """Fly what is missing and print the table."""
    code, probe = version(), msgspec.json.encode(tunnel_probe()).decode()
    of_defects = worlds_with_defects()
    chosen = names or [name for name in worlds() if name != WITHOUT_ERRORS and (name in of_defects) == defects]
    todo = []
    # Seed by seed over all cells: an interrupted study has a few flights of everything.
    of_cell = {cell: flights or (STUDY_FLIGHTS if cell.world == STUDY else FLIGHTS)
               for cell in cells(chosen, weather_kt or list(WEATHER_KT), plans or list(PLANS))}  # fmt: skip
    versions = {name: world_version(code, name) for name in chosen}
    for i in range(max(of_cell.values())):
        todo += [Job(c, first_seed + i, versions[c.world], probe, calibrated) for c, n in of_cell.items() if i < n]
    wanted = {(*job.cell, job.seed, job.version, job.calibrated): job for job in todo}
    done = fly_missing(file, wanted, one_flight, key, jobs=jobs, told=summary)
    print(tables([done[identity] for identity in wanted]))


def summary(line: dict[str, Any]) -> str:
    """One flight in one line."""
    head = f"{line['world']}, {line['weather_kt']:g} kt, {line['plan']}, seed {line['seed']}"
    if "error" not in line:
        return f"{head}: refused, {line['refused']}"
    points = zip(line["error"], line["half"], strict=True)
    return f"{head}: {', '.join(f'{e:+.1f}±{h:.1f}' for e, h in points if e is not None)} %"


if __name__ == "__main__":
    typer.run(main)
