"""`flightpower COMMAND …`: the commands of all sides under one name, and `flightpower new` for files to begin with."""

import importlib
import sys
from importlib import metadata
from importlib.util import find_spec
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperGroup

from flight.errors import InputError


class Side(NamedTuple):
    """A command of its own: the module with its `app`, and what it needs installed, by the name of the extra."""

    module: str
    help: str
    needs: tuple[str, ...]
    extra: str = ""


LAPTOP = ("casadi", "jinja2", "numpy", "pandas", "plotly", "scipy")
SIDES = {
    "analyze": Side("analysis.cli.analyze", "From a log to the power-required curve.", LAPTOP, "analysis"),
    "calibrate": Side("analysis.cli.calibrate", "Probe, tubes, magnetometer, surfaces, airspeed.", LAPTOP, "analysis"),
    "sim": Side("sim.__main__", "Simulated flights and wind tunnel.", ("casadi", "numpy", "pandas", "pyarrow"), "sim"),
    "daq": Side("daq.__main__", "Record the sensors on the aircraft's computer.", ("smbus2", "serial", "termios")),
    "new": Side("flightpower.new", "Files to begin with: an aircraft, a tray.", ()),
}


class Sides(TyperGroup):
    """Loads the command that is called or completed, and no other: help alone needs none of them."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(SIDES)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in SIDES:
            return None
        listed = typer.Typer(add_completion=False)
        listed.command(name=cmd_name, help=SIDES[cmd_name].help)(lambda: None)
        return typer.main.get_command(listed)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        return name, load(name) if name in SIDES else command, rest


def load(name: str) -> Any:
    """The command of a side. Raises InputError saying what to install when something that it needs is missing."""
    side = SIDES[name]
    missing = [module for module in side.needs if find_spec(module) is None]
    if missing and side.extra:
        raise InputError(
            f"flightpower {name}: {', '.join(missing)} not installed; run: pip install 'flightpower[{side.extra}]'"
        )
    if missing:
        raise InputError(
            f"flightpower {name}: runs on Linux only, on the aircraft's computer ({missing[0]} is missing)"
        )
    command = typer.main.get_command(importlib.import_module(side.module).app)
    command.name = name
    return command


app = typer.Typer(
    cls=Sides,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="""Power required of small electric aircraft, measured in accelerations and decelerations.

    To begin with an aircraft of your own: `flightpower new aircraft -o my.toml`, then
    `flightpower analyze log.mcap --aircraft my.toml`.
    """,
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"flightpower {metadata.version('flightpower')}")
        raise typer.Exit


@app.callback()
def _group(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point. Wrong input gives one line on stderr and exit code 2."""
    try:
        app(prog_name="flightpower")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        sys.exit(1)


if __name__ == "__main__":
    main()
