"""Results of commands for simulated flights; they are identical in every run."""

import contextlib
import importlib
import io
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import typer

from flightpower.analysis.flights.pool import pool_results
from flightpower.analysis.pages import write
from tests.corpus import from_corpus
from tests.documented_commands import MODULES
from tests.unchanged.stored_values import numbers_printed, of_files

Contents = dict[str, object]


def run(*words: object) -> Contents:
    """Exit code of one of our commands, which runs in this process."""
    return {"exit code": _run(*words)[0]}


def printed_by(*words: object) -> Contents:
    """Exit code and printed numbers of a command that does not write them to a file."""
    code, lines = _run(*words)
    return {"exit code": code, "printed": numbers_printed(lines)}


def _run(*words: object) -> tuple[int, list[str]]:
    line, out = [str(word) for word in words], io.StringIO()
    main, code = importlib.import_module(MODULES[line[0]]).main, 0
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(io.StringIO()),
        mock.patch.object(sys, "argv", line),
        mock.patch.dict(os.environ, {"COLUMNS": "100"}),
    ):
        try:
            main()
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, out.getvalue().splitlines()


@contextlib.contextmanager
def new_folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield Path(folder)


def flight(plan: str, *options: str) -> bytes:
    """The log of a simulated flight, by the plan's name or its text."""
    return _flight(plan, options)


@cache
@from_corpus
def _flight(plan: str, options: tuple[str, ...]) -> bytes:
    with new_folder() as folder:
        if "\n" in plan:
            Path("plan.toml").write_text(plan, "utf-8")
        directly = [] if "--as" in options else ["--no-hardware"]
        named = "plan.toml" if "\n" in plan else plan
        done = run("sim", "fly", *directly, "--plan", named, "-o", folder / "flight", *options)
        assert done["exit code"] == 0, done
        (log,) = (path for path in (folder / "flight").iterdir() if path.suffix in (".mcap", ".ulg", ".BIN"))
        return log.read_bytes()


@cache
def analysis_of(log: bytes, *options: str) -> tuple[Contents, dict[str, bytes]]:
    """Exit code of `analyze`, and the files that it writes."""
    with new_folder() as folder:
        Path("log.mcap").write_bytes(log)
        ended = run("analyze", "log.mcap", "-o", "out", *options)
        return ended, {path.name: path.read_bytes() for path in (folder / "out").iterdir()}


def analyzed(log: bytes, *options: str) -> Contents:
    ended, files = analysis_of(log, *options)
    with new_folder() as folder:
        for name, content in files.items():
            (folder / name).write_bytes(content)
        return {"": ended, **of_files(folder)}


def without_figures(contents: Contents) -> Contents:
    """Files without figures, since the same code draws the figures of another case."""
    for page in contents.values():
        if isinstance(page, dict):
            page.pop("figures", None)
    return contents


def demo_log() -> bytes:
    return flight("demo")


def steady_log() -> bytes:
    return flight("steady-points", "--seed", "3", "--errors", "study")


def maneuvers_log() -> bytes:
    return flight(PLAN, "--seed", "6", "--errors", "harsh")


def demonstration() -> Contents:
    return analyzed(demo_log())


def steady_points() -> Contents:
    return without_figures(analyzed(steady_log(), *STEADY_OPTIONS))


def maneuvers() -> Contents:
    """Loads and elevator inputs, and a run at full throttle, in gusts."""
    return without_figures(analyzed(maneuvers_log()))


def larger_errors() -> Contents:
    """Sensors twice as bad as stated, which the analysis notices."""
    return without_figures(analyzed(flight("demo", "--world", "twice", "--seed", "4")))


def pool() -> Contents:
    """Three flights of one aircraft pooled, and one flight compared with the other two."""
    with new_folder() as folder:
        for name, log, options in (
            ("a/demo", demo_log(), ()),
            ("a/maneuvers", maneuvers_log(), ()),
            ("b/demo-1", flight("demo", "--seed", "1"), ()),
        ):
            (folder / name).mkdir(parents=True)
            (folder / name / "results.json").write_bytes(analysis_of(log, *options)[1]["results.json"])
        result: dict[str, object] = {"compare": run("analyze", "compare", "a", "b", "-o", "compared")}
        pooled = pool_results(sorted(folder.glob("[ab]/*/results.json"))).results(["c: torn"])
        write.write_pooled(pooled, folder / "pooled")
        for name in ("compared", "pooled"):
            result |= {f"{name} {file}": inside for file, inside in of_files(folder / name).items()}
    return result


def plans() -> Contents:
    contents: dict[str, object] = {}
    with new_folder() as folder:
        (folder / "results.json").write_bytes(analysis_of(demo_log())[1]["results.json"])
        for name, options in PLANS.items():
            contents[name] = printed_by("flightpower", "plan", *options, "-o", name)
            contents |= {f"{name} {file}": inside for file, inside in of_files(folder / name).items()}
    return contents


def autopilot_logs() -> Contents:
    outcomes: dict[str, object] = {}
    log = flight("ordinary-flight", "--as", "ardupilot", "--seed", "3", "--errors", "study")
    px4_log = flight("ordinary-flight", "--as", "px4", "--log-faults", "pressure-offset,dropouts", "--errors", "study")
    aircraft = ("--aircraft", "nexstar.toml", "--propeller", "apc-12x8e")
    with new_folder() as folder:
        run("flightpower", "new", "aircraft", "--like", "nexstar", "-o", "nexstar.toml")
        for name, content, options in (
            ("ardupilot.BIN", log, (*OPTIONS, "--battery-Wh", "74")),
            ("px4.ulg", px4_log, aircraft),
        ):
            (folder / name).write_bytes(content)
            outcomes[name] = run("analyze", name, "-o", f"of {name}", *options)
            outcomes |= {f"{name} {file}": inside for file, inside in of_files(folder / f"of {name}").items()}
        outcomes["airspeed"] = printed_by("calibrate", "airspeed", "ardupilot.BIN")
    return outcomes


def exports() -> Contents:
    with new_folder() as folder:
        (folder / "log.mcap").write_bytes(flight("demo"))
        run("flightpower", "export", "log.mcap", "--to", "csv", "-o", "tables", "-q")
        return {**of_files(folder / "tables"), "info": printed_by("daq", "info", "log.mcap")}


@cache
def calibrated() -> tuple[Contents, dict[str, bytes]]:
    """Exit code of each calibration, numbers of those that only print, and all files."""
    result: dict[str, object] = {}
    with new_folder() as folder:
        for plan in ("tubing-bursts", "magnetometer-turn", "surface-deflections", "transducer-column"):
            (folder / f"{plan}.mcap").write_bytes(flight(plan))
        (folder / "steady.mcap").write_bytes(steady_log())
        (folder / "stand.csv").write_text(STAND, "utf-8")
        run("sim", "tunnel", "-o", "tunnel.csv")
        run("flightpower", "new", "aircraft", "--like", "nexstar", "-o", "nexstar.toml")
        for i, words in enumerate(CALIBRATIONS):
            result[f"{i} {words[0]}"] = (run if "-o" in words else printed_by)("calibrate", *words)
        files = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".mcap"}
    return result, files


def calibrations() -> Contents:
    result, files = calibrated()
    with new_folder() as folder:
        for name, content in files.items():
            (folder / name).write_bytes(content)
        return result | of_files(folder)


def own_aircraft() -> Contents:
    """An aircraft file with few keys, and all calibrations; then one with long lines that have to be corrected."""
    outcomes: dict[str, object] = {}
    with new_folder() as folder:
        for name, content in calibrated()[1].items():
            (folder / name).write_bytes(content)
        (folder / "log.mcap").write_bytes(demo_log())
        (folder / "my.toml").write_text(MY_AIRCRAFT, "utf-8")
        nexstar_text = (folder / "nexstar.toml").read_text("utf-8")
        (folder / "long.toml").write_text(
            nexstar_text.replace('"0.6 m"', '"1.2 m"').replace('"1.59 mm"', '"1.1 mm"'), "utf-8"
        )
        files = ("--magnetometer", "magnetometer.json", "--transducers", "transducers.json")
        for name, options in (
            ("calibrated", ("--aircraft", "my.toml", *files, "--thrust-stand", "stand.json", "--battery-Wh", "74")),
            ("long lines", ("--aircraft", "long.toml", "--weight", "4.0 kg")),
        ):
            outcomes[name] = run("analyze", "log.mcap", "-o", name, *options)
            outcomes[f"{name}, results"] = of_files(folder / name)["results.json"]
    return outcomes


PLAN = """
title = "Loads, elevator, full throttle"
heading = "200 deg"
[air]
wind = "3 m/s"
turbulence = "5 kt"
[[segment]]
kind = "stand"
duration = "20 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "climb"
height = "80 m"
climb = "3 m/s"
climb_over_stall = 0.3
speed_over_stall = 1.6
[[segment]]
kind = "roller-coaster"
[[segment]]
kind = "hold"
duration = "8 s"
speed_of_max = 0.65
[[segment]]
kind = "wind-up-turn"
[[segment]]
kind = "hold"
duration = "8 s"
speed_over_stall = 1.2
[[segment]]
kind = "run"
throttle = 1.0
[[segment]]
kind = "3-2-1-1"
[[segment]]
kind = "climb"
height = "20 m"
climb = "3 m/s"
climb_over_stall = 0.3
speed_over_stall = 1.6
[[segment]]
kind = "land"
[[segment]]
kind = "stand"
duration = "10 s"
"""


def option_defaults() -> Contents:
    """What every command does by default."""
    option_defaults: dict[str, object] = {}

    def collect(program: Any, path: str) -> None:
        for name, inner in getattr(program, "commands", {}).items():
            collect(inner, f"{path} {name}")
        for option in program.params:
            if isinstance(option.default, int | float) and not isinstance(option.default, bool):
                option_defaults[f"{path} {option.name}"] = option.default

    for name, module in {
        **MODULES,
        "plan": "flightpower.analysis.cli.plan",
        "export": "flightpower.analysis.cli.export",
    }.items():
        if name != "sim":
            collect(typer.main.get_command(importlib.import_module(module).app), name)
    return option_defaults


MY_AIRCRAFT = """name = "mine"
[geometry]
span = "5.73 ft"
wing_area = "4.99 ft^2"
[mass]
weight = "8.47 lb"
[propulsion]
propeller = "apc-12x8e"
[uncertainty]
hysteresis = "0.5 %"
"""
PLANS = {
    "curve": ("nexstar", "--minutes", "8", "--wind-kt", "8", "--after", "results.json", "--side", "90 m"),
    "range": ("survey-6kg", "--minutes", "8", "--question", "range", "--pilot", "autopilot", "--home", "48.1,11.5",
              "--heading", "250", "--height", "100 m", "--load-factor", "1.7"),
}  # fmt: skip
STEADY_OPTIONS = ("--likelihood", "--battery-Wh", "5000 mAh, 14.8 V", "--usable", "70%", "--weights", "3.8 kg, 9 lbf",
                  "--density-altitudes", "0 m, 5000 ft", "--propeller", "apc-12x8e-windmilling")  # fmt: skip
OPTIONS = ("--mass", "3.84 kg", "--wing-area", "0.4636 m^2", "--span", "1.7465 m")
STAND = """motor_speed_rpm,thrust_N
3000,3.31
4000,5.87
5000,9.26
6000,13.3
7000,18.2
6500,15.6
5500,11.2
4500,7.49
3500,4.52
"""
CALIBRATIONS = (
    ("probe", "tunnel.csv", "-o", "probe.json"),
    ("tubing", "tubing-bursts.mcap", "-o", "lines.toml"),
    ("magnetometer", "magnetometer-turn.mcap", "-o", "magnetometer.json"),
    ("surfaces", "surface-deflections.mcap"),
    ("surfaces", "surface-deflections.mcap", "--surface", "elevator", "--angles", "0 -20 -10 10 20 0", "-o",
     "surfaces.toml"),
    ("transducers", "transducer-column.mcap"),
    ("transducers", "transducer-column.mcap", "--pressures", "105.6 207.1 308.3 409.9 358.2 258.1 156.5 55 Pa", "-o",
     "transducers.json"),
    ("airspeed", "steady.mcap"),
    ("thrust", "stand.csv", "--aircraft", "nexstar.toml", "--pressure", "1002 hPa",
     "--temperature", "18 degC"),
    ("weight-and-balance", "--scale", "0.12 m: 1.25 1.26 kg", "--scale", "0.13 m: 1.29 1.30 kg", "--scale",
     "0.95 m: 0.92 0.93 kg"),
)  # fmt: skip
CASES: dict[str, Callable[[], Contents]] = {
    "demonstration": demonstration,
    "steady-points": steady_points,
    "maneuvers": maneuvers,
    "larger-errors": larger_errors,
    "pool": pool,
    "plans": plans,
    "autopilot-logs": autopilot_logs,
    "exports": exports,
    "calibrations": calibrations,
    "own-aircraft": own_aircraft,
    "option-defaults": option_defaults,
}
