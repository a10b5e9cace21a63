"""Every command of README, docs and systemd/README.md is run by a test, or listed here with the reason why it is not.

Commands that need a log run here, on the tutorial's log. Commands of the tutorial and commands without a log are in
test_documented_commands.py; the daemon's are in test_documented_daemon_commands.py.
"""

import json
import re
import runpy
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from test_documented_commands import quick_commands

from flightpower.analysis.missions import search
from flightpower.analysis.pipeline import runs as pipeline
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.plan import load_plan
from tests.documented_commands import PAGES, ROOT, TUTORIAL, Walk, do, every_command_in, run, steps_in

pytestmark = pytest.mark.xdist_group("chain")

MY_TOML = next(step for step in steps_in(TUTORIAL) if step.file == "my.toml")
UIUC = "J CT CP eta\n" + "".join(f"{J} {0.1 - 0.1 * J:.4f} {0.04 - 0.02 * J:.4f} 0.5\n" for J in (0.2, 0.4, 0.6, 0.8))
LIFTS = [0.25 + 0.09 * alpha for alpha in range(9)]
PREDICTED = "CL CD\n" + "".join(f"{CL:.2f} {0.025 + 0.06 * CL**2:.4f}\n" for CL in LIFTS)
WAYPOINT = {"type": "SimpleItem", "command": 16, "frame": 3}
SURVEY = json.dumps(
    {
        "fileType": "Plan",
        "mission": {
            "items": [WAYPOINT | {"params": [0, 0, 0, 0, 48.1 + north, 11.5, 80]} for north in (0.01, 0.02)],
            "plannedHomePosition": [48.1, 11.5, 500.0],
        },
    }
)

# Commands that run with the tutorial's log as log.mcap, and the file that each writes.
OF_A_FLIGHT = {
    "flightpower export out/demo/log.mcap --to parquet -o tables": "tables/runs.parquet",
    "flightpower export log.mcap --to mcap -o derived.mcap": "derived.mcap",
    'analyze log.mcap --weights "3.8 kg, 9 lbf" --density-altitudes "0 m, 5000 ft"': "log.report/report.html",
    "analyze log.mcap --polar T1-VLM2.txt": "log.report/report.html",
    'analyze log.ulg --mass "3.84 kg" --wing-area "0.464 m^2" --span "1.75 m"': "log.report/report.html",
}
WIND = '--wind "5 m/s from 270 deg"'
DROPPED = "3 km 045, 2 km 135 +50 m at 17 m/s, drop 0.5 kg, 3 km 250"
OF_RESULTS = {
    f"flightpower route survey.plan --results log.report/results.json {WIND}": "",
    f'flightpower route --legs "{DROPPED}" --results results.json --wind 0': "",
    f"flightpower route survey.plan --results log.report/results.json {WIND} --map map.svg": "map.svg",
    'flightpower parameters log.report/results.json --for px4 --stall "10 m/s" -o my.params': "my.params",
}
PX4_LOG = "sim fly --plan ordinary-flight --as px4 -o out/px4"
PLAN = "flightpower plan my.toml --propeller apc-12x8e --wind-kt 8"
OF_A_COLUMN = {
    "calibrate transducers log.mcap": "",
    'calibrate transducers log.mcap --pressures "10 20 30 40 35 25 15 5 mm" -o transducers.json': "transducers.json",
}
OF_A_RUN_UP = {
    "calibrate run-up log.mcap": "",
    'calibrate run-up log.mcap --thrust "4.9 9.1 16 23 16 9 4.8 N"': "",
}
OF_A_BOOM = {
    "calibrate boom log.mcap": "",
    'calibrate boom log.mcap --weights "0 100 200 300 200 100 0 g" --angles "0 -2.1 -4.2 -6.3 -4.2 -2.1 0 deg"'
    ' --carried "50 g"': "",
}
OF_SIX_SIDES = {"calibrate imu log.mcap": ""}
ON_THE_GROUND = {
    "transducer-column": OF_A_COLUMN, "run-up": OF_A_RUN_UP, "six-sides": OF_SIX_SIDES, "boom-weights": OF_A_BOOM
}  # fmt: skip
MAKE_TABLE = "python -m flightpower.flight.propeller_files apce_10x5_kt0821_5000.txt > mine.csv"
RUN_HERE = {PX4_LOG, *OF_A_FLIGHT, *OF_RESULTS, *OF_A_COLUMN, *OF_A_RUN_UP, *OF_SIX_SIDES, *OF_A_BOOM, PLAN, MAKE_TABLE}
# Patterns of commands that a test runs with other file names, shorter input or one option less; and that test.
RUN_ELSEWHERE = {
    "flightpower open.*": "analysis/pages/open/test_open_command.py",
    "daq run --config tray.toml( .*)?": "chain/test_documented_daemon_commands.py",
    "daq (check|zero) --config .*": "chain/test_documented_daemon_commands.py",
    "daq list": "daq/test_daemon.py",
    "daq info .*": "chain/test_documented_commands.py",
    "sim fly --no-hardware --probe probe.json -o out": "chain/test_without_posix.py",
    "flightpower analyze log.mcap --aircraft my.toml": "chain/test_without_posix.py",
    "analyze log.mcap --battery-Wh 74 --usable 0.7": "chain/test_without_posix.py",
    r"analyze (out.)?log.mcap": "chain/test_documented_commands.py",
    "analyze log.mcap --propeller PER3_12x8E.dat": "chain/test_runs_file.py",
    'analyze log-0001.mcap --weight "3.9 kg"': "chain/test_own_aircraft.py",
    "sim fly --aircraft my.toml --like nexstar .*": "chain/test_rehearsed_campaign.py",
    "analyze (gear/ -o out/gear|clean/ -o out/clean) --quiet": "chain/test_rehearsed_campaign.py",
    "analyze compare out/clean out/gear -o out/difference": "chain/test_rehearsed_campaign.py",
    "analyze 00000042.BIN .*": "analysis/methods/whole_flight/test_formats.py",
    "(flightpower new columns|analyze) table.csv .*": "analysis/sources/test_tables.py",
    r"analyze flights/\*(/log)?.mcap -o out( --scheduler .*)?": "analysis/flights/campaign/test_campaign.py",
    "analyze (flights/|s3://.*) -o out( --scheduler .*)?": "analysis/flights/campaign/test_addresses.py",
    "analyze compare old/ new/ -o difference": "analysis/flights/test_pooled_comparison.py",
    "flightpower fleet (add|show) .*": "analysis/flights/test_fleet_command.py",
    "calibrate thrust stand.csv .*": "analysis/calibrations/test_thrust_stand.py",
    "analyze log.mcap --thrust-stand stand.json": "analysis/calibrations/test_thrust_stand.py",
    "flightpower propellers .*": "flightpower/test_propellers.py",
    "flightpower plan nexstar .*": "analysis/missions/test_planning.py",
    "make -C firmware/esc_counter": "firmware/test_esc_counter.py",
}
NOT_RUN = {
    "(sim fly --plan full-test-flight -o|analyze) out/full.*": "15 s: as the tutorial's demonstration, but longer",
    "make (demo|test|test-all)( #.*)?": "run by .ci/run; `make test` is the run that this test belongs to",
    "(python3|py) -m venv (.venv|/opt/flightpower)(; .*)?": "installs",
    "analyze sharpe/data/flight3.ulg .*": "somebody else's log; test_formats.py analyzes logs of PX4",
    "(pip|uv tool) install .*": "installs, from the network; test_packaging.py checks what is declared and contained",
    "(python3 -m )?pip wheel .*": "installs, from the network; test_packaging.py checks what is declared and contained",
    "apt-get (install|remove) .*": "installs, as root",
    "make deb .*": "minutes, from the network; `make vm` installs it",
    "(un)?install.sh.*": "installs, as root",
    "(systemctl|journalctl) .*": "needs the service on the Raspberry Pi",
    "(i2cdetect|rsync) .*": "needs the Raspberry Pi",
    "make -C firmware/esc_counter flash .*": "needs the microcontroller",
    "dask .*": "does not end",
    "sim fly --real-time .*": "takes as long as the flight",
    "daq status .*--file .*": "does not end",
}


def shown() -> list[str]:
    """Each command of all pages, once."""
    pages = (*PAGES, ROOT / "systemd" / "README.md")
    return list(dict.fromkeys(command for page in pages for command in every_command_in(page)))


def test_every_command_is_run_or_listed() -> None:
    as_it_stands = {*quick_commands(), *(step.command for step in steps_in(TUTORIAL)), *RUN_HERE}
    patterns = (*RUN_ELSEWHERE, *NOT_RUN)
    unlisted = [
        command
        for command in shown()
        if command not in as_it_stands and not any(re.fullmatch(pattern, command) for pattern in patterns)
    ]
    assert not unlisted, "run these in a test, or say in this file why not"


def test_the_lists_have_nothing_that_no_page_shows() -> None:
    commands = shown()
    assert set(commands) >= RUN_HERE
    for pattern in (*RUN_ELSEWHERE, *NOT_RUN):
        assert any(re.fullmatch(pattern, command) for command in commands), pattern
    for place in RUN_ELSEWHERE.values():
        assert (ROOT / "tests" / place).exists(), place


def succeeds(command: str, written: str) -> None:
    Path(written).unlink(missing_ok=True) if written else None
    code, output = run(command)
    assert code == 0, (command, output)
    assert not written or Path(written).stat().st_size > 100, command


@pytest.mark.thorough
def test_commands_of_a_flight(walk: Walk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The exports share one analysis, since their logs and options are the same."""
    monkeypatch.chdir(tmp_path)
    Path("out/demo").mkdir(parents=True)
    for name in ("log.mcap", "out/demo/log.mcap"):
        shutil.copy(walk.folder / "out" / "demo" / "log.mcap", name)
    succeeds(PX4_LOG, "out/px4/log.ulg")
    shutil.copy("out/px4/log.ulg", "log.ulg")
    Path("T1-VLM2.txt").write_text(PREDICTED, "utf-8")
    made: dict[tuple[str, ...], Any] = {}
    analyze = pipeline.analyze_runs

    def once(*arguments: Any, **options: Any) -> Any:
        if tuple(options) not in made:
            made[tuple(options)] = analyze(*arguments, **options)
        return made[tuple(options)]

    monkeypatch.setattr(pipeline, "analyze_runs", once)
    for command, written in OF_A_FLIGHT.items():
        succeeds(command, written)
    succeeds("analyze out/demo/log.mcap", "out/demo/log.report/results.json")
    shutil.copy("out/demo/log.report/results.json", "results.json")
    shutil.copy("results.json", "log.report/results.json")
    Path("survey.plan").write_text(SURVEY, "utf-8")
    for command, written in OF_RESULTS.items():
        succeeds(command, written)


@pytest.mark.thorough
def test_a_plan_of_four_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan uses a catalog with one piece of each kind."""
    catalog = search.catalog

    def small(*arguments: Any) -> list[Any]:
        everything = catalog(*arguments)
        return [next(piece for piece in everything if piece.kind == kind) for kind in ("runs", "circuit", "porpoise")]

    monkeypatch.setattr(search, "catalog", small)
    monkeypatch.chdir(tmp_path)
    do(MY_TOML)
    code, output = run(PLAN)
    assert code == 0, output
    assert load_plan(Path("plan-mine/plan.toml")).segments
    (rehearsal,) = (line for line in output if line.startswith("rehearse it: "))
    flown = rehearsal.removeprefix("rehearse it: ").replace("plan-mine/plan.toml", "magnetometer-turn")
    succeeds(flown, "flown/log.mcap")  # a flight of this aircraft, which is scaled from a model


@pytest.mark.thorough
@pytest.mark.parametrize("plan", ON_THE_GROUND)
def test_calibrations_on_the_ground(plan: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    succeeds(f"sim fly --plan {plan} --no-hardware -o out", "")
    shutil.copy("out/log.mcap", "log.mcap")
    for command, written in ON_THE_GROUND[plan].items():
        succeeds(command, written)


def test_a_table_of_uiuc_becomes_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    module, source, _, written = MAKE_TABLE.removeprefix("python -m ").split()
    Path(source).write_text(UIUC, "utf-8")
    monkeypatch.setattr(sys, "argv", [module, source])
    monkeypatch.delitem(sys.modules, module)
    runpy.run_module(module, run_name="__main__")
    Path(written).write_text(capsys.readouterr().out, "utf-8")
    assert load_propeller(written).coefficients(0.4, 5000.0)[0] == pytest.approx(0.06, abs=1e-6)
