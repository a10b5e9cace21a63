"""`--help` of every command: plain, within 80 columns, with units, defaults and an example."""

import re
from inspect import signature
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import flightpower.analysis.cli.analyze
import flightpower.analysis.cli.calibrate
import flightpower.analysis.cli.compare
import flightpower.command
import flightpower.daq.__main__
import flightpower.new
import flightpower.propellers
import flightpower.simulate
from flightpower.analysis.cli import plan

APPLICATIONS = {
    "analyze": flightpower.analysis.cli.analyze.app,
    "analyze compare": flightpower.analysis.cli.compare.app,
    "calibrate": flightpower.analysis.cli.calibrate.app,
    "daq": flightpower.daq.__main__.app,
    "flightpower": flightpower.command.app,
    "flightpower new": flightpower.new.app,
    "flightpower propellers": flightpower.propellers.app,
    "sim": flightpower.simulate.app,
}


def commands() -> list[tuple[str, str]]:
    """(application, its command); the command is empty for the application itself."""
    results = [(name, "") for name in APPLICATIONS]
    for name, app in APPLICATIONS.items():
        several = getattr(typer.main.get_command(app), "commands", {})
        results += [(name, command) for command in several]
    return results


def help_of(name: str, command: str) -> str:
    arguments = [*([command] if command else []), "--help"]
    outcome = CliRunner().invoke(APPLICATIONS[name], arguments, prog_name=name, env={"COLUMNS": "80"})
    assert outcome.exit_code == 0
    return outcome.output


@pytest.mark.parametrize(("name", "command"), commands())
def test_help_is_plain_and_teaches(name: str, command: str) -> None:
    text = help_of(name, command)
    assert max(map(len, text.splitlines())) <= 80
    assert not re.search(r"<bool>|\[/|[╭│]|[^\]]\.\.\.$", text, re.MULTILINE)
    if command or name in ("analyze", "flightpower propellers"):
        assert re.search(rf"^  Examples?:\n    (flightpower )?{name.split()[-1]} {command}", text, re.MULTILINE)
    assert text.encode("cp1252")  # the encoding of a Windows console that is not UTF-8


def test_units_stay() -> None:
    text = help_of("sim", "trim")
    for words in ("above the ground [m].  [default: 100.0]", "Rate of climb [m/s]", "[deg]", "[rpm]"):
        assert words in text


def test_units_stay_in_tables() -> None:
    outcome = CliRunner().invoke(flightpower.simulate.app, ["trim", "--speed", "30 kt"], env={"COLUMNS": "80"})
    assert outcome.exit_code == 0
    assert all(words in outcome.output for words in ("[m/s]", "[deg]", "[W]", " 15.43 "))


def test_help_says_where_the_shipped_propellers_are_listed() -> None:
    text = " ".join(help_of("analyze", "").split())
    assert "a name that `flightpower propellers` lists" in text


def test_plans_are_by_default_those_that_the_page_on_flying_tells() -> None:
    text = (Path(__file__).parents[2] / "docs" / "use" / "flying.md").read_text("utf-8")
    match = re.search(r"For the Nexstar, (\d+) minutes and legs .* \(`flightpower plan nexstar --leg", text)
    legs = re.search(r"(\d+) m in line of sight, (\d+) m with an autopilot unless", text)
    load = re.search(r"largest load factor while porpoising, (\d) unless", text)
    assert match and legs and load
    default = {name: parameter.default for name, parameter in signature(plan.PlanOptions).parameters.items()}
    assert default["minutes"] == float(match[1]) and default["load_factor"] == float(load[1])
    assert [plan.PlanOptions(pilot=pilot).longest_leg_m for pilot in plan.PilotKind] == [
        float(leg) for leg in legs.groups()
    ]
