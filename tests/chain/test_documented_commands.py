"""The commands of README, tutorial and docs run as they stand, and print what the tutorial shows.

This file runs the tutorial's commands that have an output, and every other command that needs no log. The daemon's
commands are in test_documented_daemon_commands.py. Those that need a log, and the reasons why some are run elsewhere or
not at all, are in test_documented_commands_with_a_log.py. Names and options of all commands are checked.
"""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from running import rewritten

from flightpower.analysis.records.flight import Trust
from flightpower.flight.aircraft import load_aircraft
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import load_budget
from flightpower.sim.truth import read_truth
from tests.documented_commands import (
    PAGES,
    ROOT,
    TUTORIAL,
    Walk,
    arguments_of,
    commands_in,
    mentions_in,
    parse,
    run,
    same,
    steps_in,
)

pytestmark = pytest.mark.xdist_group("chain")

# The first words of commands that need no log and no sensor.
QUICK = ("sim tunnel", "sim trim", "sim modes", "flightpower new", "daq config", "calibrate weight-and-balance")
BENCHMARK = re.compile(r"python ((?:benchmarks/|-m )[\w./]+)([^`\n]*)")


@pytest.fixture(autouse=True)
def _in_the_tutorial_s_folder(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(walk.folder)


def test_the_tutorial_shows_what_its_commands_print(walk: Walk) -> None:
    """To renew the outputs: python -m tests.documented_commands docs/use/tutorial.md"""
    assert sum(bool(step.command) for step, _ in walk.steps) > 15
    for step, printed in walk.steps:
        if step.command:
            assert step.shown, step.command
            different = [pair for pair in zip(step.shown, printed, strict=False) if not same(*pair)]
            assert len(step.shown) == len(printed) and not different, (step.command, printed)


def test_the_comparison_can_fail() -> None:
    assert same("│ 11.9 │ 41.1 │", "│ 11.9 │ 41.2 │") and same("wrote a.json", "wrote a.json")
    assert not same("range 13.5 m/s", "range 14.5 m/s")
    assert not same("range 13.5 m/s", "reach 13.5 m/s") and not same("from 8 steps", "from 8 steps of 9")
    for wrong in ("sim fly --plan demo --no-such-option", "calibrate tubing LOG --output"):
        with pytest.raises(Exception, match=r"."):
            parse(wrong, complete=True)


def quick_commands() -> list[str]:
    """Commands of all pages that need no log or table, each once, except those of the tutorial."""
    walked = {step.command for step in steps_in(TUTORIAL)}
    result = (" ".join(command.split("  #")[0].split()) for page in PAGES for command in commands_in(page))
    quick = [item for item in dict.fromkeys(result) if item.startswith(QUICK) and item not in walked]
    return [item for item in quick if not item.startswith("flightpower new columns")]


def test_the_other_commands_that_need_no_log_run_as_they_stand(walk: Walk) -> None:
    """They run in the tutorial's folder, whose files they read. A file that exists is not in the way."""
    for command in quick_commands():
        written = re.search(r"(?:-o|--output|>) (\S+)", command)
        if written:
            Path(written[1]).unlink(missing_ok=True)
        code, output = run(command.partition(">")[0])
        assert code == 0, (command, output)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_words_of_every_command_are_known(page: Path) -> None:
    for command in mentions_in(page):
        parse(command, complete=False)
    for command in commands_in(page):
        parse(command, complete=True)
        for option, load in (("--plan", load_plan), ("--errors", load_budget)):
            words = arguments_of(command)
            if option in words[:-1]:
                load(words[words.index(option) + 1])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_benchmarks_have_the_options_that_are_named(page: Path) -> None:
    for program, words in BENCHMARK.findall(page.read_text("utf-8")):
        path = program.removeprefix("-m ").replace(".", "/") + ".py" if program.startswith("-m ") else program
        source = (ROOT / path).read_text("utf-8")
        for option in re.findall(r"(?<!\S)--[\w-]+", words):
            name = option.removeprefix("--").replace("-", "_")
            assert option in source or re.search(rf"\b{name}: ", source), f"{program} has no {option}"


def truth(folder: Path) -> tuple[pd.DataFrame, dict]:
    return read_truth(folder / "truth.parquet")


def printed(walk: Walk, start: str) -> str:
    """The output of the last command that starts like this, in one line."""
    return " ".join([" ".join(output) for step, output in walk.steps if step.command.startswith(start)][-1].split())


def test_the_curve_of_the_demonstration_contains_the_truth_and_is_trusted(walk: Walk) -> None:
    """The propeller stays inside its table. So short a flight leaves the vertical motion of the air unknown."""
    results = json.loads((walk.folder / "out/demo/log.report/results.json").read_text("utf-8"))
    assert results["trust"] == Trust.TRUSTED and results["evidence"] == []
    (air,) = results["warnings"]
    assert "does not average out" in air
    points = results["curves"]["power_required"]["points"]
    assert not any(point["extrapolated"] for point in points)
    V, low, high = (np.array([p[name] for p in points]) for name in ("speed_mps", "power_lo_W", "power_hi_W"))
    curve = pd.read_csv(walk.folder / "out/demo/truth_power_required.csv")
    true = np.interp(V, curve["speed_mps"], curve["power_W"])
    assert np.all((low < true) & (true < high))


def test_rehearsed_bursts_bound_the_lag_of_short_lines(walk: Walk) -> None:
    """A lag of 0.4 ms, a hundredth of a tick, gives no more than an upper bound, and nothing has to change."""
    message = printed(walk, "calibrate tubing")
    assert message.count("from 8 steps") == 3 and "Nothing to change" in message
    for bound, expected in re.findall(r"shorter than ([\d.]+) ms.*?file ([\d.]+) ms", message):
        assert float(expected) < float(bound) < 14


def test_the_rehearsed_magnetometer_calibration_is_the_simulator_s(walk: Walk) -> None:
    content = json.loads((walk.folder / "magnetometer.json").read_text("utf-8"))
    _, metadata = truth(walk.folder / "out/turned")
    error = np.array(content["hard_iron_T"]) - metadata["errors"]["hard_iron"]
    assert np.all(np.abs(error) < 4 * np.array(content["hard_iron_error_T"]))
    # Lengths of vectors do not determine a rotation, and the field strength sets the scale of all axes.
    iron = np.array(content["soft_iron"]) @ np.array(metadata["errors"]["soft_iron"])
    assert np.allclose(iron / (np.trace(iron) / 3), np.eye(3), atol=5 * content["soft_iron_error"])


def test_rehearsed_surfaces_are_those_of_the_aircraft_file(walk: Walk) -> None:
    message = printed(walk, "calibrate surfaces")
    pulses = [int(word) for word in re.search(r"pulse_us = \[([\d, ]+)\]", message)[1].split(",")]
    elevator = load_aircraft("nexstar").elevator
    for pulse, angle_deg in zip(pulses, (-20, -10, 0, 10, 20), strict=True):
        assert np.degrees(elevator.angle_of_pulse_rad(pulse)) == pytest.approx(angle_deg, abs=0.05)


def test_without_gps_no_airspeed_calibration_is_written(walk: Walk, tmp_path: Path) -> None:
    rewritten(walk.folder / "out/box", tmp_path / "no-gps.mcap", without_topic="/gps")
    code, output = run(f"calibrate airspeed {tmp_path}/no-gps.mcap -o {tmp_path}/airspeed.json")
    assert code == 1 and output[-1].endswith("not determined: fly with GPS")
    assert not (tmp_path / "airspeed.json").exists()


def test_the_rehearsed_airspeed_scale_and_wind_are_the_simulator_s(walk: Walk) -> None:
    message = printed(walk, "calibrate airspeed")
    value, half_width, side = re.search(r"reads ([\d.]+) ± ([\d.]+) % too (high|low)", message).groups()
    table, metadata = truth(walk.folder / "out/box")
    scale = (1 if side == "high" else -1) * float(value) / 100
    assert abs(scale - metadata["errors"]["values"]["V_scale"]) < 1.5 * float(half_width) / 100
    assert float(half_width) < 0.5
    wind, direction = re.search(r"wind ([\d.]+) m/s from (\d+) deg", message).groups()
    flown = table[table["phase"] == "flight"]
    assert float(wind) == pytest.approx(
        np.hypot(flown["wind_north_mps"].mean(), flown["wind_east_mps"].mean()), abs=0.3
    )
    assert float(direction) == pytest.approx(310, abs=3)
