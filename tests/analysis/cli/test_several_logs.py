"""`analyze` of several logs and `analyze compare`: what is refused, and which files the results depend on."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.reader import SeekingReader
from rich.console import Console
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.cli.compare import app as compare_app
from flightpower.analysis.cli.several_logs import (
    FlightAnalysis,
    ProgressOnConsole,
    _attachments,
    files_used,
    own_aircraft_note,
    settings,
)
from flightpower.analysis.flights.campaign.campaign import Campaign, flight_folders_of, read_flights
from flightpower.analysis.flights.campaign.processes import Outcome
from flightpower.analysis.flights.pool import pool_results
from flightpower.analysis.options import Options, refuse_autopilot_options
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import AbsolutePressure
from tests.analysis.flights.synthetic_flights import flight, truth
from tests.analysis.missions.route_data import electrical_flight


def run(*arguments: object):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def message(*arguments: object) -> str:
    outcome = run(*arguments)
    assert isinstance(outcome.exception, InputError), outcome.output
    return str(outcome.exception)


def log_of(path: Path, **attachments: str) -> Path:
    with path.open("wb") as stream:
        writer = LogWriter(stream)
        for name, text in attachments.items():
            writer.attach(name.replace("_", "."), text.encode(), "text/plain", 0)
        writer.write("/static", AbsolutePressure(pressure_Pa=1e5, temperature_K=288.0), time_ns=10**18, tick=0)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        ((), "give the folder for the results with -o"),
        (("-o", "out", "--runs", "runs.toml"), "belongs to one log"),
        (("-o", "out", "--leave-out", "10 to 20 s"), "belongs to one log"),
        (("-o", "out", "--aircraft", "nothing.toml"), "neither a file nor one of"),
    ],
)
def test_options_that_several_logs_cannot_have(tmp_path: Path, monkeypatch, options, cause: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert cause in message("a.mcap", "b.mcap", *options)
    assert not list(tmp_path.iterdir())


def test_no_usable_log_is_wrong_input(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("a.mcap", "b.mcap", "-o", "out")
    assert "none of the 2 logs" in str(outcome.exception)
    assert "a.mcap: cannot be read" in outcome.stderr and "b.mcap: cannot be read" in outcome.stderr


def test_compare_is_a_command_and_a_log_of_that_name_is_not_lost(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "Usage: analyze compare" in run("compare", "--help").output
    assert "a: is not a folder" in message("compare", "a", "b")
    assert "compare: cannot be read" in message("./compare")


def test_results_depend_on_the_files_that_are_read(tmp_path: Path) -> None:
    table, aircraft = tmp_path / "mine.csv", tmp_path / "aircraft.toml"
    table.write_text("table")
    text = load_aircraft("nexstar").text
    named = [line for line in text.splitlines() if line.startswith("propeller = ")]
    own = text.replace(named[0], f'propeller = "{table}"')
    aircraft.write_text(own)
    plain = log_of(tmp_path / "plain.mcap", aircraft_toml=text)
    assert files_used(plain, Options()) == []
    assert files_used(plain, Options(aircraft=aircraft)) == [("--aircraft", aircraft), ("--propeller", table)]
    assert files_used(plain, Options(propeller=str(table))) == [("--propeller", table)]
    assert files_used(log_of(tmp_path / "own.mcap", aircraft_toml=own), Options()) == [("--propeller", table)]
    assert files_used(log_of(tmp_path / "both.mcap", aircraft_toml=own, propeller_csv="rpm"), Options()) == []
    (tmp_path / "junk.mcap").write_text("junk")
    assert files_used(tmp_path / "junk.mcap", Options()) == []


def test_mass_is_for_the_logs_of_autopilots_beside_logs_with_an_aircraft_file(tmp_path: Path) -> None:
    """The option is refused if every log has its own aircraft file, as it is for a single such log."""
    tray, autopilot = log_of(tmp_path / "tray.mcap", aircraft_toml="x"), tmp_path / "log.ulg"
    autopilot.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    own_options = Options(mass_kg=4.1, span_m=2.0, propeller="APC 12x6")
    note = own_aircraft_note([tray, autopilot], own_options)
    assert note == "--mass, --span: for the logs of autopilots; 1 of 2 logs keep the aircraft file that they hold"
    mixed = FlightAnalysis(own_options, mixed=True).under(Path("/"))
    assert mixed.options_of(tray) == replace(mixed.options, mass_kg=None, span_m=None)
    assert mixed.options_of(autopilot).mass_kg == 4.1
    assert FlightAnalysis(own_options).options_of(tray) == own_options
    for logs, options in (
        ([tray], own_options),
        ([autopilot], own_options),
        ([tray, autopilot], Options(propeller="APC 12x6")),
    ):
        assert not own_aircraft_note(logs, options)
    with pytest.raises(InputError, match=r"--mass, --span: only for logs of autopilots"):
        refuse_autopilot_options(tray, own_options)


def test_settings_are_values_and_names_of_files_without_their_folders() -> None:
    here, there = (Options(probe=Path(folder, "probe.json"), weight_N=4.0) for folder in ("here", "there"))
    assert settings(here) == settings(there) != settings(Options(probe=Path("probe.json"), weight_N=5.0))


def test_an_analysis_below_a_root_reads_the_copies() -> None:
    moved = FlightAnalysis(Options(aircraft=Path("/a/x.toml"), probe=Path("b.json"), propeller="apc-12x8e")).under(
        Path("/root")
    )
    assert moved.options == Options(aircraft=Path("/root/a/x.toml"), probe=Path("b.json"), propeller="apc-12x8e")


def test_folders_of_a_pool_of_several_flights_and_of_one(tmp_path: Path) -> None:
    def results(folder: str, **content: object) -> None:
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "results.json").write_text(json.dumps(content))

    rng = np.random.default_rng(1)
    results("pool/a", **flight(truth(rng), rng, "a"))
    electrical = msgspec.to_builtins(electrical_flight())
    results("pool/b", **electrical)
    results("pool/removed", **flight(truth(rng), rng, "removed"))
    assert [folder.name for folder in flight_folders_of(tmp_path / "pool")] == ["a", "b", "removed"]
    (tmp_path / "pool" / "results.json").write_text(json.dumps({"flights": [{"log": "a"}, {"log": "b"}]}))
    by_power = pool_results(read_flights(flight_folders_of(tmp_path / "pool")))
    assert [this_flight.name for this_flight in by_power.flights] == ["b"] and by_power.left_out[0].log == "a"
    assert by_power.other_kind is not None and [of.name for of in by_power.other_kind.flights] == ["a"]
    others = {"flights": [{"log": "a"}], "other_kind": {"flights": [{"log": "b"}, {"log": "a"}]}}
    (tmp_path / "pool" / "results.json").write_text(json.dumps(others))
    assert [folder.name for folder in flight_folders_of(tmp_path / "pool")] == ["a", "b"]
    assert flight_folders_of(tmp_path / "pool" / "a") == [tmp_path / "pool" / "a"]
    (tmp_path / "pool" / "a" / "empty").mkdir()
    with pytest.raises(InputError, match=r"no results\.json"):
        flight_folders_of(tmp_path / "pool" / "a" / "empty")


def test_the_last_line_gives_seconds_and_megabytes() -> None:
    console = Console(file=StringIO(), width=100)
    progress = ProgressOnConsole(console, quiet=False)
    progress.planned(3, completed=2)
    assert (progress.bars.tasks[0].completed, progress.bars.tasks[0].total) == (2, 5)
    progress.ended("a", Outcome("", seconds=12.34))
    progress.ended("b", Outcome("b: torn", seconds=0.1))
    progress.finished(Campaign(processor_seconds=61.7, peak_bytes=321_000_000))
    assert "a: 12.3 s (1 of 3)" in console.file.getvalue()
    assert (
        "1 analyzed, 1 refused in 62 s of processor time, with at most 321 MB of memory each" in console.file.getvalue()
    )


def test_a_comparison_does_not_replace_the_results_of_a_flight(tmp_path: Path) -> None:
    results = tmp_path / "a" / "results.json"
    results.parent.mkdir()
    results.write_text(json.dumps({"format": "flightpower-results-2"}))
    outcome = CliRunner().invoke(compare_app, [str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(tmp_path / "a")])
    assert isinstance(outcome.exception, InputError) and "must not be replaced" in str(outcome.exception)
    assert json.loads(results.read_text()) == {"format": "flightpower-results-2"}


def test_a_folder_is_not_compared_with_itself(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for other in ("a", "./a", str(tmp_path / "a")):
        outcome = CliRunner().invoke(compare_app, ["a", other])
        assert str(outcome.exception) == "A and B are the same folder: a; give two"


def test_attachments_are_those_of_the_log_and_none_of_a_torn_one(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log.mcap", aircraft_toml="span", propeller_csv="rpm,J")
    with log.open("rb") as stream:
        attachments = {item.name: item.data for item in SeekingReader(stream).iter_attachments()}
    assert _attachments(log) == attachments == {"aircraft.toml": b"span", "propeller.csv": b"rpm,J"}
    log.write_bytes(log.read_bytes()[:-40])
    assert _attachments(log) == {}
