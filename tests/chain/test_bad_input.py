"""Whatever a user hands over by mistake gives one clear line on stderr and exit code 2, and nothing is written."""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from running import command, done, installed, rewritten

from flightpower.flight.aircraft import load_aircraft

pytestmark = pytest.mark.xdist_group("chain")
FEW = 250  # ticks of a log that is refused before its flight is examined


def refused(
    *arguments: object, naming: str, cause: str, folder: Path, run: Callable[..., CompletedProcess[str]] = command
) -> None:
    before = sorted(path for path in folder.rglob("*"))
    outcome = run("analyze", *arguments)
    assert outcome.returncode == 2, outcome.stderr
    lines = outcome.stderr.strip().splitlines()
    assert len(lines) == 1, outcome.stderr
    assert lines[0].startswith("error: ")
    assert naming in lines[0] and cause in lines[0], lines[0]
    assert outcome.stdout == ""
    assert sorted(path for path in folder.rglob("*")) == before, "something was written"


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (None, "cannot be read"),
        (b"", "is empty"),
        (b"\x89MC", "neither a log nor a table"),
        (b"time,speed\n" + b"0,12\n" * 100, "columns need a map"),
        (b"\x89MCAP0\r\n", "holds no message"),
        (b"\x89MCAP0\r\n" + bytes(1000), "holds no message"),
    ],
    ids=["missing", "empty", "three bytes", "a table", "only the magic", "zeros"],
)
def test_what_is_no_log(tmp_path: Path, content: bytes | None, cause: str) -> None:
    path = tmp_path / "flight.mcap"
    if content is not None:
        path.write_bytes(content)
    refused(path, naming="flight.mcap", cause=cause, folder=tmp_path, run=command if content else installed)


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    refused(tmp_path, naming=tmp_path.name, cause="cannot be read", folder=tmp_path)


def test_a_log_torn_before_its_first_message(flown: Path, tmp_path: Path) -> None:
    path = tmp_path / "torn.mcap"
    path.write_bytes((flown / "log.mcap").read_bytes()[:3000])
    refused(path, naming="torn.mcap", cause="holds no message", folder=tmp_path)


@pytest.mark.parametrize("topic", ["/probe/airspeed", "/static"])
def test_a_log_without_a_needed_topic(flown: Path, tmp_path: Path, topic: str) -> None:
    rewritten(flown, tmp_path / "flight.mcap", without_topic=topic, ticks=FEW)
    refused(tmp_path / "flight.mcap", naming="flight.mcap", cause=topic, folder=tmp_path)


@pytest.mark.parametrize("topic", ["/imu", "/probe/alpha", "/rpm"])
def test_a_log_without_a_topic_that_drag_needs_gives_electrical_power(flown: Path, tmp_path: Path, topic: str) -> None:
    """It gives the curve of battery power, the power for drag by this method, and drag by the propeller table."""
    rewritten(flown, tmp_path / "flight.mcap", without_topic=topic)
    done("analyze", tmp_path / "flight.mcap", "--quiet", "-o", tmp_path / "report")
    results = json.loads((tmp_path / "report" / "results.json").read_text("utf-8"))
    assert results["curves"]["electrical_power"]["points"]
    assert f"The log lacks {topic}, which drag needs" in results["warnings"][0]
    assert "motor speed" in results["withheld"][0]


def test_a_wrong_aircraft_file_whose_runs_give_no_drag_is_doubted_first_of_all(flown: Path, tmp_path: Path) -> None:
    """A quarter of the weight makes drag negative, and the energy balance also finds another aircraft's power."""
    ended = command("analyze", flown / "log.mcap", "--aircraft", "light-1kg", "--quiet", "-o", tmp_path / "report")
    assert ended.returncode == 1
    assert ended.stderr.startswith("doubtful: the whole curve. The runs give no drag")
    results = json.loads((tmp_path / "report" / "results.json").read_text("utf-8"))
    assert results["trust"] == "not to be trusted" and list(results["curves"]) == ["electrical_power"]
    assert results["methods_tried"][0]["reason"] == "its drag polar is unphysical"
    assert [item["kind"] for item in results["evidence"]] == [
        "efficiency from battery to thrust", "method that the log allows", "motor efficiency"
    ]  # fmt: skip
    assert results["balance"]["shaft_over_electrical"] < 0.3


@pytest.mark.parametrize(("name", "option"), [("aircraft.toml", "--aircraft FILE"), ("probe.json", "--probe FILE")])
def test_a_log_without_a_needed_attachment_names_the_option_that_gives_it(
    flown: Path, tmp_path: Path, name: str, option: str
) -> None:
    rewritten(flown, tmp_path / "flight.mcap", without_attachment=name, ticks=FEW)
    refused(tmp_path / "flight.mcap", naming=name, cause=option, folder=tmp_path)


def test_a_log_without_any_propeller(flown: Path, tmp_path: Path) -> None:
    own_file = tmp_path / "mine.toml"
    own_file.write_text(load_aircraft("nexstar").text.replace('propeller = "apc-12x8e"', ""))
    log = tmp_path / "flight.mcap"
    mine_attached = {"aircraft.toml": own_file.read_bytes()}
    rewritten(flown, log, without_attachment="propeller.csv", attached=mine_attached, ticks=FEW)
    refused(log, naming="propeller.csv", cause="--propeller", folder=tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ('span = "5.73 ft"', 'span = "5.73 lbf"', "geometry.span"),
        ('span = "5.73 ft"', "span = 5.73", "geometry.span"),
        ('span = "5.73 ft"', "", "geometry.span is missing"),
        ('span = "5.73 ft"', 'span = "5.73 ft"\nspam = 1', "unknown key 'spam'"),
        ('weight = "8.47 lbf"', 'weight = "0 lbf"', "mass.weight"),
        ("[geometry]", "[geometry", "not valid TOML"),
    ],
)
def test_a_wrong_aircraft_file(flown: Path, tmp_path: Path, old: str, new: str, cause: str) -> None:
    text = load_aircraft("nexstar").text
    assert old in text
    (tmp_path / "mine.toml").write_text(text.replace(old, new, 1))
    refused(
        flown / "log.mcap", "--aircraft", tmp_path / "mine.toml", "-o", tmp_path / "report",
        naming="mine.toml", cause=cause, folder=tmp_path,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("option", "name", "content", "cause"),
    [
        ("--aircraft", "none.toml", None, "neither a file nor one of"),
        ("--magnetometer", "mine.json", "{", "not a magnetometer calibration"),
        ("--magnetometer", "none.json", None, "cannot be read"),
        ("--probe", "mine.json", "{", "probe"),
        ("--probe", "none.json", None, "cannot be read"),
        ("--zero", "mine.json", "{", "zero"),
        ("--zero", "none.json", None, "cannot be read"),
        ("--propeller", "apc-99x9", None, "neither a file nor one of"),
        ("--propeller", "apc-10x5e", None, "is it the propeller that was flown?"),
        ("--runs", "mine.toml", '[[run]]\nkind = "acceleration"\nend = "70 s"\n', "start is missing"),
        # 2.4 s of one acceleration: the fitted parabola falls with lift.
        (
            "--runs",
            "mine.toml",
            '[[run]]\nkind = "acceleration"\nstart = "38 s"\nend = "40.4 s"\n',
            "its drag polar is unphysical",
        ),
    ],
)
def test_a_wrong_replacement_names_its_file(
    flown: Path, tmp_path: Path, option: str, name: str, content: str | None, cause: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content, "utf-8")
    file = tmp_path / name if "." in name else name
    naming = "" if "unphysical" in cause else name
    refused(flown / "log.mcap", option, file, "-o", tmp_path / "report", naming=naming, cause=cause, folder=tmp_path)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--battery-Wh", "0"),
        ("--usable", "80"),
        ("--weight", "4.1"),
        ("--weight", "-1 kg"),
        ("--weights", "0 kg"),
        ("--density-altitudes", "20 km"),
    ],
)
def test_a_question_that_cannot_be_meant(tmp_path: Path, option: str, value: str) -> None:
    refused(tmp_path / "flight.mcap", option, value, naming=option, cause=value, folder=tmp_path)


def test_a_report_folder_that_is_a_file(flown: Path, tmp_path: Path) -> None:
    (tmp_path / "report").write_text("mine")
    refused(flown / "log.mcap", "-o", tmp_path / "report", naming="report", cause="is a file", folder=tmp_path)
    assert (tmp_path / "report").read_text() == "mine"
