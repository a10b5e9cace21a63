"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from flight.errors import InputError

QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
AircraftOption = Annotated[
    Path | None, typer.Option("--aircraft", metavar="FILE", help="Aircraft file to use instead of the log's.")
]
PropellerOption = Annotated[
    str | None,
    typer.Option(
        "--propeller",
        metavar="NAME",
        help="Propeller to use instead of the log's: a name that `flightpower propellers` lists,"
        " a CSV file of its format, a PER3 file of APC, or tables of UIUC.",
    ),
]
ProbeOption = Annotated[
    Path | None, typer.Option("--probe", metavar="FILE", help="Probe calibration to use instead of the log's.")
]


def option_name(field: str) -> str:
    return f"--{field.replace('_', '-')}"


def refuse_drag_options(log: Path, why: str, **given: object) -> None:
    """Raises InputError for an option that a log without drag has no use for. why: what is missing."""
    if names := _given(given):
        raise InputError(f"{log}: {names}: has no effect, since {why}; leave it out")


def refuse_autopilot_options(log: Path, **given: object) -> None:
    """Raises InputError for an option that a log with an aircraft file of its own has no use for."""
    if names := _given(given):
        raise InputError(f"{log}: {names}: only for logs of autopilots; give --weight, or --aircraft FILE")


def _given(options: dict[str, object]) -> str:
    return ", ".join(f"--{name.replace('_', '-')}" for name, value in options.items() if value is not None)
