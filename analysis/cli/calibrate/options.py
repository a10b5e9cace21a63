"""Options that several commands share, and how results are written."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from analysis.files import write_file
from flight.errors import InputError
from flight.output_file import check_writable

Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="A log recorded by the daemon.")]
AircraftFile = Annotated[
    Path | None,
    typer.Option("--aircraft", metavar="FILE", help="Aircraft file to use instead of the one in the log."),
]

AircraftFileLines = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        help="File to write with the lines for the aircraft file; default: printed.",
    ),
]


def check_output(path: Path | None, replace: bool) -> None:
    """Raises InputError if the file exists and must not be replaced, or cannot be written."""
    if path is None:
        return
    if path.is_file() and not replace:
        raise InputError(f"{path}: exists already; give --replace, or another name with -o")
    check_writable(path)


def write_json(path: Path, content: object) -> None:
    """A calibration as an indented JSON file."""
    write_file(path, msgspec.json.format(msgspec.json.encode(content), indent=1))


def write_or_print(text: str, output: Path | None) -> None:
    """A section for the aircraft file: to `output`, or to stdout if that is None."""
    if output is None:
        print(text, end="")
        return
    write_file(output, text)
    print(f"wrote {output}")
