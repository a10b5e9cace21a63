"""A flight of an autopilot on the local page: what is shown, guessed, left out by hand, and repeated by the command."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from flightpower.analysis.curve import Kind
from flightpower.analysis.options import Options
from flightpower.analysis.pages.charts.figure import Axis
from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.pictures import strips
from flightpower.analysis.pages.open.request import LIMITS, FieldError, Values
from flightpower.analysis.pages.open.server import _drafted_map
from flightpower.analysis.pages.open.whole_flight import WholeFlight
from flightpower.analysis.pipeline import analyze
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.recording import Channel, Event, EventKind
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from tests.unchanged.commands import flight, run

LOGS = {"flight.BIN": "ardupilot", "flight.ulg": "px4"}
AIRCRAFT = {"mass": "3.84 kg", "wing-area": "0.464 m^2", "span": "1.75 m"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    folder = tmp_path_factory.mktemp("whole")
    for name in ("flights", "workspace"):
        (folder / name).mkdir()
    for name, autopilot in LOGS.items():
        (folder / "flights" / name).write_bytes(flight("ordinary-flight", "--as", autopilot, "--seed", "3"))
    return Folder(folder / "flights", folder / "workspace")


@pytest.fixture(params=LOGS)
def log(folder: Folder, request: pytest.FixtureRequest) -> WholeFlight:
    return opened(folder, request.param)


def opened(folder: Folder, name: str = "flight.BIN") -> WholeFlight:
    flight = folder.flight(name)
    assert isinstance(flight, WholeFlight)
    return flight


def titles(strips: str) -> list[str]:
    return re.findall(r'class="title"><text[^>]*>([^<]*)', strips)


def power_at_15(curve: dict[str, Any]) -> float:
    return float(np.interp(15.0, curve["speed_mps"], curve["power_W"]))


def test_a_log_is_shown_with_strips_modes_track_and_curve_without_a_word_typed(log: WholeFlight) -> None:
    shown = log.shown
    assert shown["kind"] is Kind.ELECTRICAL
    strip_titles = titles(shown["strips"])
    assert strip_titles[:4] == ["indicated airspeed, m/s", "speed over ground, m/s", "height, m", "electrical power, W"]
    assert ("modes" in strip_titles) == bool(shown["events"])
    assert [field["key"] for field in shown["form"][0]["fields"]][:3] == ["mass", "wing-area", "span"]
    curve = log.curve(Values(log.path.name))
    assert set(curve["guessed"]) == {"mass", "wing-area", "span"} and curve["guessed"]["mass"].endswith(" kg")
    assert curve["airborne"] and curve["airborne"][-1][1] < log.end_s
    track = curve["figures"]["track"]
    assert all(word in track for word in (">north<", ">wind, ", " m<")), "the track shows north, wind and scale"


def test_the_guess_is_near_enough_for_a_picture_and_is_never_written(folder: Folder) -> None:
    """The guessed mass may be wrong by a factor of three; level-flight power is measured and barely depends on it."""
    log, name = opened(folder), "flight.BIN"
    guessed, exact = log.curve(Values(name)), log.curve(Values(name, aircraft=AIRCRAFT))
    assert exact["guessed"] == {} and exact["mass_kg"] == pytest.approx(3.84)
    assert 1 / 3 < guessed["mass_kg"] / 3.84 < 3
    assert power_at_15(guessed["curve"]) == pytest.approx(power_at_15(exact["curve"]), rel=0.15)
    before = sorted(log.path.parent.iterdir())
    for aircraft, field in (({}, "mass"), ({"mass": "3.84 kg", "span": "1.75 m"}, "wing-area")):
        with pytest.raises(FieldError) as refused:
            log.write(Values(name, aircraft=aircraft))
        assert refused.value.field == field
    assert sorted(log.path.parent.iterdir()) == before


def test_what_was_left_out_by_hand_is_repeated_by_the_command(
    folder: Folder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = opened(folder)
    uncut = log.curve(Values("flight.BIN", aircraft=AIRCRAFT))
    start, end = uncut["airborne"][0]
    middle = (start + end) / 2
    values = Values("flight.BIN", aircraft=AIRCRAFT, left_out=[(round(middle), round(middle) + 60.0)])
    cut = log.curve(values)
    assert len(cut["airborne"]) == len(uncut["airborne"]) + 1 and cut["curve"] != uncut["curve"]
    assert not any(a < middle + 30 < b for a, b in cut["airborne"])
    command = log.write(values)["command"]
    results = json.loads((log.path.parent / "flight.report" / "results.json").read_text("utf-8"))
    for name, curve_values in cut["curve"].items():
        assert curve_values == pytest.approx(
            [point[name] for point in results["curves"]["electrical_power"]["points"]], rel=1e-12
        )
    _, *words = shlex.split(command)
    assert words[-2:] == ["--leave-out", f"{round(middle):.1f} to {round(middle) + 60:.1f} s"]
    assert run("analyze", *words, "-o", tmp_path / "again")["exit code"] == 0
    again = json.loads((tmp_path / "again" / "results.json").read_text("utf-8"))
    assert again["curves"] == results["curves"]
    reopened = opened(Folder(folder.path, folder.workspace))
    assert reopened.shown["remembered"] == {
        "mass": "3.84 kg", "wing-area": "0.464 m^2", "span": "1.75 m",
    }, "the next time its report says what was flown"  # fmt: skip
    assert reopened.shown["left_out"] == values.left_out, "and what was left out"
    left_out_file = log.path.parent / "flight.report" / "left_out.txt"
    assert Options(leave_out=str(left_out_file)).left_out_s == tuple(values.left_out)
    log.write(msgspec.structs.replace(values, left_out=[], aircraft=AIRCRAFT | {"battery-Wh": "74"}))
    emptied = opened(Folder(folder.path, folder.workspace)).shown
    assert (emptied["left_out"], Options(leave_out=str(left_out_file)).left_out_s) == ([], ())
    assert emptied["remembered"]["battery-Wh"] == "74"
    for unusable in ("100000 to 200000 s", "soon"):
        left_out_file.write_text(unusable, "utf-8")
        assert opened(Folder(folder.path, folder.workspace)).shown["left_out"] == []


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"aircraft": AIRCRAFT | {"mass": "heavy"}}, "mass"),
        ({"aircraft": AIRCRAFT | {"span": "-1 m"}}, "span"),
        ({"aircraft": AIRCRAFT | {"battery-Wh": "a lot"}}, "battery-Wh"),
        ({"aircraft": AIRCRAFT | {"air-temperature": "20 m"}}, "air-temperature"),
        ({"propeller": "../../etc/passwd"}, "propeller"),
        ({"left_out": [(10.0, 20.0), (200.0, 100.0)]}, "run 1"),
        ({"left_out": [(-5.0, 20.0)]}, "run 0"),
        ({"left_out": [(1e5, 2e5)]}, "run 0"),
        ({"left_out": [(float("nan"), 20.0)]}, "run 0"),
    ],
    ids=str,
)
def test_a_wrong_value_is_refused_at_its_field(folder: Folder, changed: dict[str, Any], field: str) -> None:
    with pytest.raises(FieldError) as refused:
        opened(folder).curve(Values("flight.BIN", **changed))
    assert refused.value.field == field and "\n" not in str(refused.value)


def test_the_energy_of_the_battery_and_the_temperature_are_options_of_the_command(folder: Folder) -> None:
    values = Values("flight.BIN", aircraft=AIRCRAFT | {"battery-Wh": "74", "air-temperature": "30 degC", "span": ""})
    log = opened(folder)
    assert "--battery-Wh 74 --air-temperature '30 degC'" in log.command(values) and "--span" not in log.command(values)
    warm, usual = (
        log.curve(Values("flight.BIN", aircraft=AIRCRAFT | {"air-temperature": text}))["density_kgpm3"]
        for text in ("40 degC", "0 degC")
    )
    assert warm / usual == pytest.approx(273.15 / 313.15, rel=1e-3)


def test_any_channel_of_the_log_is_drawn_when_it_is_asked_for(log: WholeFlight) -> None:
    name = "vehicle_status.vehicle_type" if log.path.suffix == ".ulg" else "CTUN.ThO"
    assert name in log.channels and len(log.channels) > 20
    strip_titles = titles(log.drawn(Values(log.path.name, channels=[name]))["strips"])
    assert name in strip_titles and strip_titles[0] == "indicated airspeed, m/s"
    with pytest.raises(InputError, match="no such channel"):
        log.drawn(Values(log.path.name, channels=["CTUN.Thrust"]))
    with pytest.raises(InputError, match="drawn at most"):
        log.drawn(Values(log.path.name, channels=[name] * (LIMITS.channels + 1)))


def test_another_flight_is_compared_at_equal_weight_and_density(folder: Folder) -> None:
    """At one lift coefficient speed goes with the root of weight over density."""
    log = opened(folder)
    flown = log.curve(Values("flight.BIN", aircraft=AIRCRAFT))
    weight_and_density = (2 * flown["mass_kg"], 0.9 * flown["density_kgpm3"])
    curve = log.curve(Values("flight.BIN", aircraft=AIRCRAFT, other_condition=weight_and_density))
    factor = (2 / 0.9) ** 0.5
    assert curve["curve"]["speed_mps"] == pytest.approx(factor * np.array(flown["curve"]["speed_mps"]), rel=1e-9)
    assert curve["kind"] == flown["kind"] == "electrical_power"


def test_a_log_of_the_daemon_without_flow_angles_keeps_its_aircraft_file(
    flown: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its values are keys of that file, and nothing is guessed."""
    for name in ("flights", "workspace"):
        (tmp_path / name).mkdir()
    (tmp_path / "flights" / "log.mcap").write_bytes(flown)
    monkeypatch.setattr("flightpower.analysis.pipeline.lacks_drag_topics", lambda _: True)
    log = opened(Folder(tmp_path / "flights", tmp_path / "workspace"), "log.mcap")
    keys = {field["key"] for group in log.shown["form"] for field in group["fields"]}
    assert {"mass.weight", "geometry.span"} <= keys and not any(key.startswith("uncertainty.") for key in keys)
    heavier = log.curve(Values("log.mcap", aircraft={"mass.weight": "4.5 kg"}))
    assert heavier["guessed"] == {} and heavier["mass_kg"] == pytest.approx(4.5)
    assert log.curve(Values("log.mcap"))["mass_kg"] == pytest.approx(load_aircraft("nexstar").mass.weight_N / 9.80665)
    with pytest.raises(FieldError) as refused:
        log.curve(Values("log.mcap", aircraft={"mass.weight": "four"}))
    assert refused.value.field == "mass.weight"
    assert "/imu angular_rate_x_radps" in log.channels
    msgspec.json.encode(log.shown)


def test_a_curve_by_runs_has_no_stretches_to_leave_out(flown: bytes, tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(flown)
    with pytest.raises(InputError, match="--leave-out: has no effect, since the curve is by runs"):
        analyze(open_source(tmp_path / "log.mcap"), Options(leave_out="10 to 20 s"))


def test_what_an_autopilot_says_is_drawn_as_text_alone() -> None:
    """Messages and channel names come from a file that anybody may have made, and the page inserts the drawing."""
    script = "<img src=x onerror=alert(1)>"
    t_s = np.arange(10.0)
    events = [Event(1.0, EventKind.MODE, script), Event(2.0, EventKind.MESSAGE, f'">{script}')]
    page_text = strips([(t_s, t_s, Axis("height", "m"))], {script: Channel(t_s, t_s)}, events, 9.0)
    assert "<img" not in page_text and page_text.count("&lt;img") >= 3
    assert strips([], {}, [], 9.0) == ""


def test_a_table_whose_map_gives_no_curve_says_what_its_map_lacks(tmp_path: Path) -> None:
    """The message does not say that the log lacks an aircraft file, which nobody attaches to a table; a corrected map
    is read again."""
    (tmp_path / "workspace").mkdir()
    t_s = np.arange(0.0, 600.0, 0.5)
    rows = zip(t_s, 15 + 3 * np.sin(t_s / 20), 100 + 10 * np.sin(t_s / 40), 8 + np.sin(t_s / 20), strict=True)
    lines = ["time,airspeed,altitude,current,pack", *(f"{t:.1f},{V:.2f},{h:.1f},{A:.2f},15.0" for t, V, h, A in rows)]
    table = tmp_path / "flight.csv"
    table.write_text("\n".join(lines), "utf-8")
    note = _drafted_map(table)
    columns = tmp_path / "flight.csv.columns.toml"
    assert f"drafted by their names into {columns.name}" in note and "battery_voltage" not in columns.read_text("utf-8")
    folder = Folder(tmp_path, tmp_path / "workspace")
    with pytest.raises(InputError, match=r"the map of its columns lacks \[battery_voltage\]") as refused:
        folder.flight(table.name)
    assert "aircraft.toml" not in str(refused.value)
    columns.write_text(columns.read_text("utf-8") + '\n[battery_voltage]\ncolumn = "pack"\nunit = "V"\n', "utf-8")
    flight = folder.flight(table.name)
    assert flight.kind is Kind.ELECTRICAL and not flight.changed()
    columns.write_text(columns.read_text("utf-8") + "# checked\n", "utf-8")
    assert flight.changed()
