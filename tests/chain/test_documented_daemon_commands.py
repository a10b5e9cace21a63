"""`daq check`, `zero` and `run` as the documentation has them, in the tutorial's folder with its tray file.

The buses are those of the fake tray, on a simulated clock and without threads, so the tests do not wait. For what the
installed daemon does with device files and in real time, see test_hardware_in_the_loop.py.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from flightpower.daq import daemon, dry_run, tray_check
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.log_reader import read_log
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from tests.documented_commands import PAGES, ROOT, Walk, commands_in, run

pytestmark = pytest.mark.xdist_group("chain")

CTRL_C_AFTER_S = 3.0
STAND = 'title = "stand"\n[[segment]]\nkind = "stand"\nduration = "40 s"\n'


@pytest.fixture(autouse=True)
def _standing(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Buses of an aircraft that stands still, whose sensors have the errors of the bench, in place of the
    computer's."""
    errors = draw(load_budget("bench"), 0)
    flight = fly(load_aircraft("nexstar"), parse_plan(STAND, "stand"), seed=0, deviations=errors.deviations)
    clock = SimulatedClock(unix_at_start_ns=1_463_218_140 * 10**9)
    fake = FakeTray(FlightSensorTruth(flight, errors), clock)
    monkeypatch.chdir(walk.folder)
    monkeypatch.setattr("flightpower.daq.linux_bus.LinuxBuses", lambda: fake)
    monkeypatch.setattr("flightpower.daq.clock.SystemClock", lambda: clock)
    monkeypatch.setattr("flightpower.daq.__main__.prepare_process", lambda: None)
    monkeypatch.setattr("flightpower.daq.__main__.raise_priority", lambda: None)
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def unthreaded(function: Any) -> Any:
        return lambda *arguments, **options: function(*arguments, **{**options, "threaded": False})

    def record(*arguments: Any, stop: Any, **options: Any) -> Any:
        def progress(elapsed_s: float) -> None:
            if elapsed_s > CTRL_C_AFTER_S:
                stop.set()

        return recorded(*arguments, stop=stop, progress=progress, **options)

    recorded = unthreaded(daemon.record)
    monkeypatch.setattr(daemon, "record", record)
    monkeypatch.setattr(dry_run, "check_devices_here", lambda tray: None)  # no device files: the parts are fakes
    monkeypatch.setattr(dry_run, "dry_run", unthreaded(dry_run.dry_run))
    monkeypatch.setattr(tray_check, "check_tray", unthreaded(tray_check.check_tray))


def documented(start: str) -> list[str]:
    """Commands of all pages that start like this, each once, without a comment."""
    result = (" ".join(command.split("  #")[0].split()) for page in PAGES for command in commands_in(page))
    return [command for command in dict.fromkeys(result) if command.startswith(start)]


def test_the_check_finds_the_tray_fit() -> None:
    (command,) = documented("daq check")
    code, message = run(command)
    assert code == 0, message
    assert message[-1] == "fit to fly"


def test_the_zero_is_taken_and_written() -> None:
    (command,) = documented("daq zero")
    code, message = run(command)
    assert code == 0, message
    assert message[-1].endswith("zero.json: attached to every log from now on")
    assert set(json.loads(Path("zero.json").read_text("utf-8"))["readings"]) >= {"/imu", "/probe/airspeed"}


def test_the_daemon_records_until_it_is_stopped() -> None:
    """This includes the command with --record-bus."""
    commands = documented("daq run")
    assert len(commands) == 2
    for i, command in enumerate(commands, 1):
        code, message = run(command)
        assert code == 0, message
        (log,) = Path("logs").glob(f"log-000{i}*.mcap")
        assert log.name in message[-1] and "0 missed" in message[-1]
        assert len(read_log(log).entries["/imu"]) > 25 * CTRL_C_AFTER_S
    assert Path("bench.jsonl").stat().st_size > 10_000


def test_the_check_of_the_tray_file_refuses_what_the_daemon_would_refuse() -> None:
    """The tray has a pulse counter, but neither file gives the motor's pole pairs."""
    example = (ROOT / "daq" / "tray.example.toml").read_text("utf-8")
    Path("no-poles.toml").write_text(example.replace('aircraft = "nexstar"', "", 1), "utf-8")
    code, (message,) = run("daq config --check no-poles.toml")
    assert code == 2 and "pole_pairs = 7" in message
