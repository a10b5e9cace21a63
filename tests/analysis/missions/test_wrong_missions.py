"""Each wrong mission or option gives one line on stderr, and nothing on stdout."""

import sys
from pathlib import Path

import msgspec
import pytest
from route_data import aerodynamic_results, electrical_results
from test_mission_files import KML, SQUARE, item, plan_text, waypoints_text

from flightpower.analysis.cli import route
from flightpower.analysis.records.flight import BatteryResult, Evidence, EvidenceKind, PartOfResult, Trust

WIND = ("--wind", "5 m/s from 270")
LEGS = ("--legs", "3 km 045, 2 km 135")
OPTIONS = {
    "no mission": (),
    "mission and legs": ("mission", *LEGS),
    "no such file": ("nowhere.plan",),
    "a leg without course": ("--legs", "3 km"),
    "a leg without unit": ("--legs", "3 045"),
    "a course beyond 360": ("--legs", "3 km 400"),
    "a leg in kilograms": ("--legs", "3 kg 045"),
    "a drop first": ("--legs", "drop 1 kg, 3 km 045"),
    "a drop without mass": ("--legs", "3 km 045, drop it"),
    "a drop beyond the weight": ("--legs", "3 km 045, drop 9 kg, 1 km 225"),
    "no legs": ("--legs", ""),
    "a wind without direction": (*LEGS, "--wind", "5 m/s"),
    "a wind in meters": (*LEGS, "--wind", "5 m from 270"),
    "a wind as no aircraft flies in": (*LEGS, "--wind", "90 m/s from 270"),
    "a wind from beyond 360": (*LEGS, "--wind", "5 m/s from 400"),
    "a negative scatter": (*LEGS, "--wind-sd", "-1"),
    "a speed in words": (*LEGS, "--speed", "fast"),
    "a speed below the stall margin": (*LEGS, "--speed", "9 m/s"),
    "a speed beyond the fastest": (*LEGS, "--speed", "60 m/s"),
    "a leg below the stall margin": ("--legs", "3 km 045 at 8 m/s"),
    "a stall speed that leaves no speed": (*LEGS, "--stall", "18 m/s", "--speed", "17 m/s"),
    "a charge without voltage": (*LEGS, "--battery-Wh", "5000 mAh"),
    "a usable share above one": (*LEGS, "--usable", "1.4"),
    "a resistance without voltage": (*LEGS, "--resistance", "40 mohm"),
    "a battery without capacity": (*LEGS, "--health", "0"),
    "a probability above one": (*LEGS, "--sure", "120"),
    "a weight in meters": (*LEGS, "--weight", "4 m"),
    "a height in kilograms": (*LEGS, "--height", "4 kg"),
    "a climb of zero": (*LEGS, "--climb", "0"),
    "home at no place": ("mission", "--home", "148,11"),
    "results of nothing": (*LEGS, "--results", "mission"),
    "results not to be trusted": (*LEGS, "--results", "distrusted.json"),
    "results without a battery": (*LEGS, "--results", "electrical.json"),
    "results without a model": (*LEGS, "--results", "bare.json", "--battery-Wh", "74"),
    "a map that exists": (*LEGS, "--map", "mission"),
    "a map in no folder": (*LEGS, "--map", "mission/map.svg"),
}
FILES = {
    "text": "hello",
    "nothing": "",
    "broken JSON": "{",
    "JSON of something else": '{"a": 1}',
    "a plan without items": plan_text(),
    "a plan without home": plan_text(*SQUARE, plannedHomePosition=None),
    "a plan with six parameters": plan_text(item(16, east_km=1.0) | {"params": [0, 0, 0, 0, 48, 11]}),
    "a plan with a structure scan": plan_text({"type": "ComplexItem", "complexItemType": "StructureScan"}),
    "circles without end": plan_text(item(17, east_km=1.0)),
    "circles that are none": plan_text(item(18, 0, east_km=1.0)),
    "circles of no time": plan_text(item(19, 0, east_km=1.0)),
    "circles that are too tight": plan_text(item(18, 3, 0, 10, east_km=1.0)),
    "a vertical take-off": plan_text(item(84, east_km=1.0)),
    "an item that is not understood": plan_text(item(16, east_km=1.0), item(4711)),
    "a speed of zero": plan_text(item(178, 0, 0, -1), item(16, east_km=1.0)),
    "a drop without its mass": plan_text(item(16, east_km=1.0), item(211, 1, 0)),
    "a drop before the first waypoint": plan_text(item(211, 1, 0), item(16, east_km=1.0)),
    "a frame that is not understood": plan_text(item(16, east_km=1.0, frame=7)),
    "a place that is none": plan_text(item(16, east_km=1.0, north_km=9000.0)),
    "a place on another continent": plan_text(item(16, east_km=4000.0)),
    "a height that is none": plan_text(item(16, east_km=1.0) | {"params": [0, 0, 0, 0, 48.1, 11.6, None]}),
    "a jump to nowhere": plan_text(item(16, east_km=1.0), item(177, 9, 1)),
    "an endless jump": plan_text(item(16, east_km=1.0), item(177, 1, -1)),
    "cameras alone": plan_text(item(206, 10)),
    "an old waypoint file": waypoints_text(*SQUARE).replace("110", "100"),
    "a waypoint file without items": "QGC WPL 110\n",
    "a waypoint file without home": waypoints_text(*SQUARE, home=False),
    "a line with too few columns": waypoints_text(*SQUARE) + "\n7\t0\t3\t16\t0",
    "a line with words": waypoints_text(*SQUARE) + "\n7\t0\t3\tx\t0\t0\t0\t0\t48\t11\t80\t1",
    "broken KML": "<kml><LineString>",
    "KML without a line": "<kml/>",
    "KML with a single point": "<kml><LineString><coordinates>11,48,0</coordinates></LineString></kml>",
    "KML with words": "<kml><LineString><coordinates>a,b c,d</coordinates></LineString></kml>",
    "KML with two lines": "<kml><LineString/><LineString/></kml>",
    "KML at no place": KML.format("", 0, 148.0, 0),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    results = aerodynamic_results()
    against = Evidence(
        kind=EvidenceKind.CROSS_CHECK, level=Trust.NOT_TO_BE_TRUSTED, part=PartOfResult.CURVE, text="It differs."
    )
    contents = {
        "results.json": results,
        "distrusted.json": msgspec.structs.replace(results, trust=Trust.NOT_TO_BE_TRUSTED, evidence=[against]),
        "electrical.json": electrical_results(),
        "with its battery.json": electrical_results(battery=BatteryResult(energy_Wh=74.0, usable=0.8)),
        "bare.json": msgspec.structs.replace(results, use=None),
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(msgspec.json.encode(content))
    (tmp_path / "mission").write_text(plan_text(*SQUARE), "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ended(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["route", *words])
    try:
        route.main()
    except SystemExit as stopped:
        return int(stopped.code or 0)
    return 0


def is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str) -> None:
    arguments = ("--results", "results.json", *WIND)
    assert ended(monkeypatch, *arguments, *words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("error: ") and printed.err.count("\n") == 1


@pytest.mark.parametrize("case", OPTIONS)
def test_a_wrong_option_is_one_line(case: str, folder, monkeypatch, capsys) -> None:
    is_one_line(monkeypatch, capsys, *OPTIONS[case])


@pytest.mark.parametrize("case", FILES)
def test_a_wrong_mission_is_one_line(case: str, folder, monkeypatch, capsys) -> None:
    (folder / "mission").write_text(FILES[case], "utf-8")
    is_one_line(monkeypatch, capsys, "mission")


def test_the_same_without_a_mistake_is_done(folder, monkeypatch, capsys) -> None:
    """Each way to give a mission works; a battery too small for it is not an error, but gives exit code 1."""
    right = ("--results", "results.json", *WIND)
    assert ended(monkeypatch, *right, "mission", "--map", "map.svg") == 0
    assert ended(monkeypatch, *right, *LEGS, "--speed", "time") == 0
    assert ended(monkeypatch, *right, *LEGS, "--results", "electrical.json", "--battery-Wh", "74") == 0
    assert capsys.readouterr().err == ""
    assert (folder / "map.svg").read_text("utf-8").startswith("<svg")
    assert ended(monkeypatch, *right, *LEGS, "--battery-Wh", "12") == 1


def test_the_battery_of_an_autopilot_s_log_is_that_of_its_analysis(folder, monkeypatch, capsys) -> None:
    printed = []
    for words in (("electrical.json", "--battery-Wh", "74"), ("with its battery.json",)):
        assert ended(monkeypatch, *WIND, *LEGS, "--results", *words) == 0
        printed.append(capsys.readouterr())
    assert printed[0] == printed[1] and "Wh" in printed[0].out
