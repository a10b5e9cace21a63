"""What the local page computes is what the command writes, and only what changed is computed again."""

import json
import math
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flightpower.analysis.flight import with_runs
from flightpower.analysis.maneuvers.runs_file import load, to_toml
from flightpower.analysis.options import Options
from flightpower.analysis.pages.open import form, runs_flight
from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.opened import OpenedFlight
from flightpower.analysis.pages.open.request import LIMITS, FieldError, Run, Values
from flightpower.analysis.pages.open.runs_flight import RunsFlight, runs_text
from flightpower.analysis.pages.open.server import LocalPage
from flightpower.analysis.records.flight import Kind
from flightpower.flight.errors import InputError
from tests.unchanged.commands import run


@pytest.fixture
def log(shared: Folder) -> RunsFlight:
    flight = shared.flight("log.mcap")
    assert isinstance(flight, RunsFlight)
    return flight


@pytest.fixture
def new_log(opened: Folder) -> OpenedFlight:
    """A log of which nothing has been computed yet."""
    return opened.flight("log.mcap")


def runs_of(log: RunsFlight) -> list[Run]:
    return [Run(**run) for run in log.curve(Values("log.mcap"))["runs"]]


def without_the_acceleration(log: RunsFlight) -> Values:
    runs = runs_of(log)
    for listed_run in runs:
        listed_run.keep = listed_run.keep and listed_run.kind != "acceleration"
    return Values("log.mcap", runs=runs, aircraft={"mass.weight": "4.2 kg"})


def test_a_flight_is_shown_with_its_runs_and_the_reasons_of_those_left_out(log: RunsFlight) -> None:
    shown = log.shown
    assert shown["kind"] is Kind.POWER_REQUIRED
    titles = re.findall(r'class="title"><text[^>]*>([^<]*)', shown["strips"])
    assert titles[2:5] == ["motor, rpm", "throttle, %", "angle of attack, deg"]
    used = [run["kind"] for run in shown["runs"] if run["keep"]]
    assert used.count("acceleration") == used.count("deceleration") == 1
    assert all(run["why"] for run in shown["runs"] if not run["keep"])
    first, *_ = shown["form"]
    assert [field["label"] for field in first["fields"]][:3] == [
        "weight in flight",
        "propeller flown",
        "battery energy",
    ]
    by_key = {field["key"]: field for group in shown["form"] for field in group["fields"]}
    assert by_key["probe.position"]["value"].count(", ") == 2 and "[" not in by_key["probe.position"]["value"]
    assert not {"mass.Ix", "propulsion.max_rpm", "elevator.rate", "aerodynamics.CL0"} & by_key.keys()


def test_a_log_is_read_ahead_once_and_what_is_wrong_is_said_when_it_is_asked_for(
    opened: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = LocalPage(opened, set(), "secret")
    for name in ("log.mcap", "missing.mcap"):
        page.read_ahead(name)
    monkeypatch.setattr("flightpower.analysis.pages.open.flights.open_source", None)
    monkeypatch.setattr(runs_flight, "synchronized", None)
    assert opened.flight("log.mcap").shown["runs"]
    with pytest.raises(InputError):
        opened.flight("missing.mcap")


@pytest.mark.slow
def test_the_page_s_curve_is_that_of_the_files_and_of_the_command_that_it_shows(
    log: OpenedFlight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    values = without_the_acceleration(log)
    curve = log.curve(values)["curve"]
    command = log.write(values)["command"]
    written = log.path.parent / "log.report"
    results = json.loads((written / "results.json").read_text("utf-8"))
    for name, curve_values in curve.items():
        assert curve_values == pytest.approx(
            [point[name] for point in results["curves"]["power_required"]["points"]], rel=1e-12
        )
    of_report = {method["name"]: method["power_required"] for method in results["methods"]}
    assert of_report["direct"]
    for method in ("direct", "whole-flight"):
        beside = log.curve(msgspec.structs.replace(values, method=method))
        assert beside["curve"] == curve
        curve_values = beside["method"]["curve"]["power_W"]
        assert curve_values == pytest.approx([point["power_W"] for point in of_report[method]], rel=1e-9)
    assert results["test"]["weight_N"] == pytest.approx(4.2 * 9.80665)
    _, *words = shlex.split(command)
    assert run("analyze", *words, "-o", tmp_path / "again")["exit code"] == 0
    again = json.loads((tmp_path / "again" / "results.json").read_text("utf-8"))
    for key in ("curves", "runs", "methods", "use", "trust"):
        assert again[key] == results[key], key
    assert {path.name for path in (tmp_path / "again").iterdir()} <= {path.name for path in written.iterdir()}


def test_another_weight_and_density_keep_the_polar(log: RunsFlight) -> None:
    """At one lift coefficient, speed goes with the root of weight over density, and power with weight times speed."""
    flown = log.curve(Values("log.mcap"))
    curve = log.curve(Values("log.mcap", other_condition=(1.3 * flown["mass_kg"], 0.9 * flown["density_kgpm3"])))
    faster = (1.3 / 0.9) ** 0.5
    for name, factor in (("speed_mps", faster), ("power_W", 1.3 * faster), ("power_hi_W", 1.3 * faster)):
        assert curve["curve"][name] == pytest.approx(factor * np.array(flown["curve"][name]), rel=1e-9)
    assert curve["mass_kg"] == pytest.approx(1.3 * flown["mass_kg"])
    for nothing in ((-1.0, 1.2), (3.0, 0.0), (np.nan, 1.2)):
        with pytest.raises(InputError):
            log.curve(Values("log.mcap", other_condition=nothing))


def test_two_flights_stay_in_memory_to_be_compared(opened: Folder, flown: bytes) -> None:
    for name in ("b.mcap", "c.mcap"):
        (opened.path / name).write_bytes(flown)
    first, second = opened.flight("log.mcap"), opened.flight("b.mcap")
    assert opened.flight("log.mcap") is first and opened.flight("b.mcap") is second
    assert opened.flight("c.mcap") and opened.flight("b.mcap") is second and opened.flight("log.mcap") is not first


@pytest.mark.slow
def test_other_runs_keep_the_trajectory_and_other_values_do_not(
    new_log: OpenedFlight, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed = []

    def counted(function: Callable[..., object]) -> Callable[..., object]:
        return lambda *arguments: (computed.append(function.__name__), function(*arguments))[1]

    for name in ("synchronized", "flight_path"):
        monkeypatch.setattr(runs_flight, name, counted(getattr(runs_flight, name)))
    before = new_log.curve(Values("log.mcap"))
    assert computed == ["synchronized", "flight_path"]
    runs = [Run(**run) for run in before["runs"]]
    run = next(run for run in runs if run.kind == "deceleration" and run.keep)
    run.start_s += 2.0
    after = new_log.curve(Values("log.mcap", runs=runs))
    assert computed == ["synchronized", "flight_path"]
    assert after["curve"]["speed_mps"] != before["curve"]["speed_mps"]
    heavier = new_log.curve(Values("log.mcap", runs=runs, aircraft={"mass.weight": "4.5 kg"}))
    assert computed == ["synchronized", "flight_path"] * 2
    assert heavier["mass_kg"] == pytest.approx(4.5)
    assert np.mean(heavier["curve"]["power_W"]) > np.mean(after["curve"]["power_W"])
    assert new_log.curve(Values("log.mcap")) is before
    new_log.curve(Values("log.mcap", other_condition=(4.0, 1.2)))
    assert computed == ["synchronized", "flight_path"] * 2, "as recorded stays"


def test_other_methods_are_listed_as_far_as_runs_were_flown_for_them(log: RunsFlight) -> None:
    shown = log.curve(Values("log.mcap"))
    names = {item["name"]: item["missing"] for item in shown["methods"]}
    assert shown["method"] is None and "dynamic" not in names
    assert names["energy"] == "" and "roller coaster" in names["varied-lift"]
    with pytest.raises(InputError):
        log.curve(Values("log.mcap", method="the best"))


def test_what_is_drawn_beside_the_curve_is_in_the_command_and_in_the_report(
    log: OpenedFlight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The methods of maximum likelihood are applied only if asked for."""
    request: list[tuple[bool, Path | None, list[str]]] = []

    def analyze_log(path: Path, folder: Path, options: Options, progress: object, command_line: str) -> None:
        request.append((options.likelihood, options.polar, shlex.split(command_line)[2:]))
        raise InputError("enough")

    monkeypatch.setattr("flightpower.analysis.pages.one_log.analyze_log", analyze_log)
    monkeypatch.chdir(log.path.parent)
    Path("polar.csv").write_text("CL,CD\n0.2,0.03\n0.6,0.04\n1.0,0.08\n", "utf-8")
    for values in (Values("", method="energy"), Values("", method="force-models"), Values("", polar="polar.csv")):
        with pytest.raises(InputError, match="enough"):
            log.write(values)
    polar = log.path.parent / "polar.csv"
    assert request == [(False, None, []), (True, None, ["--likelihood"]), (False, polar, ["--polar", "polar.csv"])]
    polar.unlink()


def test_the_last_curves_are_kept(new_log: OpenedFlight, monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[Values] = []
    monkeypatch.setattr(RunsFlight, "_curve", lambda _, values: computed.append(values) or {})
    requests = [Values("log.mcap", other_condition=(4.0, 1 + k / 100)) for k in range(LIMITS.curves + 1)]
    for values in [*requests, *requests[1:]]:
        new_log.curve(values)
    assert computed == requests
    new_log.curve(requests[0])
    assert computed == [*requests, requests[0]], "the one computed longest ago was dropped"


def test_a_log_that_changed_is_read_again(opened: Folder, new_log: OpenedFlight) -> None:
    assert opened.flight("log.mcap") is new_log
    new_log.path.write_bytes(new_log.path.read_bytes() + b"\0")
    assert opened.flight("log.mcap") is not new_log


@pytest.mark.parametrize(
    "values",
    [
        Values("log.mcap", runs=[]),
        Values("log.mcap", runs=[Run("loop", 60, 70, True)]),
        Values("log.mcap", runs=[Run("steady\"\nkeep = true # ", 60, 70, True)]),
        Values("log.mcap", runs=[Run("deceleration", 70, 60, True)]),
        Values("log.mcap", runs=[Run("deceleration", -5, 60, True)]),
        Values("log.mcap", runs=[Run("deceleration", 1e6, 2e6, True)]),
        Values("log.mcap", runs=[Run("deceleration", 60, float("inf"), True)]),
        Values("log.mcap", runs=[Run("deceleration", 77, 85, True), Run("deceleration", 80, 89, True)]),
        Values("log.mcap", runs=[Run("deceleration", 77, 89, False)]),
        Values("log.mcap", aircraft={"mass.weight": "-3 kg"}),
        Values("log.mcap", aircraft={"mass.weight": "four"}),
        Values("log.mcap", aircraft={"mass.weight": ""}),
        Values("log.mcap", aircraft={"mass.weight": '4 kg"\n[geometry]\nspan = "1 m'}),
        Values("log.mcap", aircraft={"mass.wheight": "4 kg"}),
        Values("log.mcap", aircraft={"x = 1\n[mass]\nweight": "4 kg"}),
        Values("log.mcap", propeller="../../etc/passwd"),
        Values("log.mcap", propeller="apc-99x99"),
    ],
    ids=str,
)  # fmt: skip
def test_wrong_values_are_refused_and_nothing_is_written(log: RunsFlight, values: Values) -> None:
    before = sorted(path.name for path in log.path.parent.rglob("*"))
    with pytest.raises(InputError) as refused:
        log.write(values)
    assert "\n" not in str(refused.value).strip()
    assert sorted(path.name for path in log.path.parent.rglob("*")) == before


def test_what_was_typed_stays_text_number_or_list(log: RunsFlight) -> None:
    typed = {"title": '"]] = 3', "probe.upwash_per_CL": "2 deg", "imu_position": '["1 cm", "0 m", "0 m"]'}
    text = log.aircraft_text(Values("log.mcap", aircraft=typed))
    assert 'title = "\\"]] = 3"\n' in text and 'imu_position = ["1 cm", "0 m", "0 m"]\n' in text
    assert form.parse_aircraft(text, "form").title == '"]] = 3'


@pytest.mark.slow
def test_edited_runs_are_there_when_the_log_is_opened_again(log: RunsFlight) -> None:
    """They are those of the report's runs.toml, whoever edited it; none if it holds the analysis' own runs or no
    list."""
    runs_file = log.path.parent / "log.report" / "runs.toml"
    runs_file.parent.mkdir(exist_ok=True)
    before = runs_file.read_bytes() if runs_file.exists() else None
    try:
        runs_file.unlink(missing_ok=True)
        again = RunsFlight(log.path, log.workspace, log.log)
        own_runs = again.shown["runs"]
        assert again.shown["edited_runs"] == []
        listed = [Run(run["kind"], run["start_s"], run["end_s"], run["keep"]) for run in own_runs]
        moved = [msgspec.structs.replace(run, start_s=run.start_s + 0.4) if run.keep else run for run in listed]
        runs_file.write_text(runs_text(moved, log.path.name), "utf-8")
        edited = RunsFlight(log.path, log.workspace, log.log).shown["edited_runs"]
        starts_s = [run["start_s"] for run in edited if run["keep"]]
        assert starts_s == pytest.approx([run.start_s for run in moved if run.keep], abs=0.011) and starts_s
        measured = again._measured(Values(""))
        runs_file.write_text(to_toml(with_runs(measured, None).maneuvers, log.path.name), "utf-8")
        assert again._edited(measured) == []
        runs_file.write_text("no list", "utf-8")
        assert again._edited(measured) == []
    finally:
        runs_file.unlink() if before is None else runs_file.write_bytes(before)


def test_the_list_of_runs_is_the_file_that_analyze_reads(tmp_path: Path) -> None:
    runs = [Run("deceleration", 77.0, 89.26, True, "a\nremark"), Run("steady", 20.0, 30.0, False)]
    (tmp_path / "runs.toml").write_text(runs_text(runs, "log.mcap"), "utf-8")
    entries = load(tmp_path / "runs.toml")
    assert [(entry.kind, entry.start_s, entry.end_s, entry.keep) for entry in entries] == [
        ("steady", 20.0, 30.0, False), ("deceleration", 77.0, 89.26, True),
    ]  # fmt: skip


@pytest.mark.parametrize("keep", [True, False])
def test_a_run_that_analyze_would_refuse_is_refused_at_its_place(keep: bool) -> None:
    good = Run("steady", 20.0, 30.0, True)
    for wrong in (Run("steady", 30.0, 20.0, keep), Run("glided", 1.0, 2.0, keep), Run("steady", 1.0, math.inf, keep)):
        with pytest.raises(FieldError) as refused:
            runs_text([good, wrong], "log.mcap")
        assert refused.value.field == "run 1"
