"""`flightpower COMMAND …`: all commands under one name, and `flightpower new` for starter files."""

import importlib
from importlib.util import find_spec
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup

from flightpower.flight.command_line import application, command_of, run
from flightpower.flight.errors import InputError


class Side(NamedTuple):
    """A separate command: the module with its `app`, and the extra that it needs installed."""

    module: str
    help: str
    needs: tuple[str, ...]
    extra: str = ""


LOGS = ("jinja2", "numpy", "pandas", "pyulog", "scipy")
LAPTOP = ("casadi", *LOGS)
SIDES = {
    "analyze": Side("flightpower.analysis.cli.analyze", "From a log to the power-required curve.", LOGS, "analysis"),
    "export": Side(
        "flightpower.analysis.cli.export", "A flight as tables and files for other programs.", LAPTOP, "analysis"
    ),
    "open": Side(
        "flightpower.analysis.pages.open.command",
        "Flights in the browser: edit runs.",
        (*LAPTOP, "waitress"),
        "analysis",
    ),
    "plan": Side("flightpower.analysis.cli.plan", "What to fly next, for the narrowest interval.", LAPTOP, "analysis"),
    "route": Side(
        "flightpower.analysis.cli.route", "The energy of a mission in wind, and the way home.", LOGS, "autopilot"
    ),
    "parameters": Side(
        "flightpower.analysis.cli.parameters", "A flight's parameters for an autopilot.", LOGS, "autopilot"
    ),
    "fleet": Side(
        "flightpower.analysis.cli.fleet", "Many airframes: which got worse.", (*LAPTOP, "fsspec", "pyarrow"), "fleet"
    ),
    "calibrate": Side(
        "flightpower.analysis.cli.calibrate", "Probe, tubes, magnetometer, surfaces, airspeed.", LAPTOP, "analysis"
    ),
    "sim": Side(
        "flightpower.simulate", "Simulated flights and wind tunnel.", ("casadi", "numpy", "pandas", "pyarrow"), "sim"
    ),
    "daq": Side("flightpower.daq.__main__", "Record the sensors on the aircraft's computer.", ()),
    "propellers": Side("flightpower.propellers", "Propeller tables by size and maker.", ("numpy",), "analysis"),
    "new": Side("flightpower.new", "Files to begin with: an aircraft, a tray, a map of columns.", ()),
}


class Sides(TyperGroup):
    """The separate commands. Only the command that is called or completed is loaded; help loads none."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(SIDES)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in SIDES:
            return None
        listed = application()
        listed.command(name=cmd_name, help=SIDES[cmd_name].help)(lambda: None)
        return typer.main.get_command(listed)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        return name, load(name, help_alone="--help" in rest) if name in SIDES else command, rest


def load(name: str, *, help_alone: bool = False) -> Any:
    """Load a separate command. Raises InputError saying what to install if a needed package is missing.

    help_alone : only its help is requested, which is shown even without the packages if the module can be loaded
    """
    side = SIDES[name]
    missing = [module for module in side.needs if find_spec(module) is None]
    lacking = InputError(
        f'flightpower {name}: {", ".join(missing)} not installed; in the clone: pip install ".[{side.extra}]"'
    )
    if missing and not help_alone:
        raise lacking
    try:
        command = command_of(importlib.import_module(side.module).app)
    except ImportError:
        if missing:
            raise lacking from None
        raise
    command.name = name
    return command


app = application(
    cls=Sides,
    add_completion=True,
    help="""Power required of small electric aircraft, measured in accelerations and decelerations.

    \b
    A simulated flight:
      flightpower sim tunnel -o tunnel.csv
      flightpower calibrate probe tunnel.csv -o probe.json
      flightpower sim fly --probe probe.json -o out
      flightpower analyze out/log.mcap

    \b
    An aircraft of your own:
      flightpower new aircraft -o my.toml      then fill it in
      flightpower analyze log.mcap --aircraft my.toml

    Each command has --help.
    """,
)


@app.callback()
def _group() -> None:
    pass


def main() -> None:
    """Entry point. Wrong input gives one line on stderr and exit code 2."""
    run(app, "flightpower")


if __name__ == "__main__":
    main()
