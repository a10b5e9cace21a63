"""`flightpower new`: files to begin with."""

import importlib
import json
import sys
from importlib import resources
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from flightpower import templates
from flightpower.flight.aircraft import shipped_aircraft
from flightpower.flight.command_line import application
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_file

app = application(help="Write a commented file to fill in.")

Output = Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE", help="File to write; default: printed.")]
Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]


@app.command(short_help="An aircraft file: required and optional keys.")
def aircraft(
    output: Output = None,
    like: Annotated[
        str | None,
        typer.Option("--like", metavar="NAME", help=f"Fill it in as one of these: {', '.join(shipped_aircraft())}."),
    ] = None,
    replace: Replace = False,
) -> None:
    """An aircraft file: required and optional keys, each with its meaning and how to measure it.

    Name, span, wing area and weight are enough for a power-required curve. --like fills in all keys, those of the
    simulator too, with the values of an aircraft that comes with flightpower: change what differs.

    \b
    Examples:
      flightpower new aircraft -o my.toml
      flightpower new aircraft --like nexstar -o my.toml
    """
    if like is not None and like not in shipped_aircraft():
        raise InputError(f"--like {like}: should be one of {', '.join(shipped_aircraft())}")
    _write(templates.like(like, output) if like else templates.blank(), output, replace)


@app.command(short_help="A tray file: the sensors and how they are connected.")
def tray(
    output: Output = None,
    aircraft: Annotated[
        str | None, typer.Option("--aircraft", metavar="FILE", help="Aircraft file that goes into every log.")
    ] = None,
    replace: Replace = False,
) -> None:
    """A tray file: the sensors of the aircraft's computer and how they are connected, for `daq run --config`.

    \b
    Example:
      flightpower new tray --aircraft my.toml -o tray.toml
    """
    text = resources.files("flightpower.daq").joinpath("tray.example.toml").read_text("utf-8")
    if aircraft is not None:
        # A JSON string is also a TOML string, in which the backslashes of a Windows path are escaped.
        text = text.replace('aircraft = "nexstar" ', f"aircraft = {json.dumps(aircraft, ensure_ascii=False)} ", 1)
    _write(text, output, replace)


@app.command(short_help="A map of the columns of a table, to analyze it.")
def columns(
    table: Annotated[Path, typer.Argument(metavar="FILE", help="A CSV, Parquet or .mat file of a flight.")],
    output: Output = None,
    replace: Replace = False,
) -> None:
    """A map of the columns of a table: which quantity each is, in which unit, with which sign and delay.

    It is drafted from names and values, and checked by physics: gravity, rates against attitude, airspeed against GPS.
    Look through it, and analyze the table; FILE.columns.toml beside the table is found without an option.

    \b
    Examples:
      flightpower new columns table.csv -o table.csv.columns.toml
      flightpower new columns table.mat -o map.toml
    """
    draft = importlib.import_module("flightpower.analysis.sources.map_draft")  # needs libraries of the laptop
    _write(draft.draft(table, output), output, replace)


def _write(text: str, output: Path | None, replace: bool) -> None:
    if output is None:
        if isinstance(sys.stdout, TextIOWrapper):
            sys.stdout.reconfigure(encoding="utf-8")  # the encoding of files, in case the output is redirected into one
        print(text, end="")
        return
    check_new_file(output, replace=replace)
    write_file(output, text)
    print(f"wrote {output}")
