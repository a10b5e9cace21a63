"""The steps common to all calibrations: protect existing files, print the result, and write it if it is good enough."""

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import msgspec
import typer

from flightpower.analysis.options import ReplaceOption
from flightpower.flight.command_line import ExitCode, as_command
from flightpower.flight.files import check_new_file, write_files

LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="A log recorded by the daemon.")]
CalibrationFile = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Calibration file to write.")]
OptionalFile = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="JSON file to write as well.")
]
AircraftFileLines = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", metavar="FILE", help="File to write with the lines for the aircraft file; default: printed."
    ),
]


class Calibrated(NamedTuple):
    """The result of a calibration.

    summary, warnings : lines to print     unsupported : why the result is not good enough to be written; empty if it is
    content : sections of an aircraft file as text, or an object for a JSON file; None if there is nothing to write
    pages : further files by path     remark : text to print after the names of the files written
    """

    summary: Sequence[str]
    content: object = None
    warnings: Sequence[str] = ()
    unsupported: str = ""
    pages: Mapping[Path, str] = {}
    remark: str = ""


def calibration(file: Any, default: str | None = None) -> Callable[[Callable[..., Calibrated]], Callable[..., None]]:
    """Turn a function that calibrates into a command with --replace and with --output, annotated as `file`.

    These options are passed on if the function has parameters `output` and `replace`. The command exits with code 1 if
    the measurements do not support the result.
    """

    def decorated(calibrate: Callable[..., Calibrated]) -> Callable[..., None]:
        hints, keyword = get_type_hints(calibrate, include_extras=True), inspect.Parameter.KEYWORD_ONLY
        signature = inspect.signature(calibrate).parameters
        parameters = [
            parameter.replace(kind=keyword, annotation=hints[parameter.name])
            for parameter in signature.values()
            if parameter.name not in ("output", "replace")
        ]
        source, *_ = (parameter.name for parameter in parameters)
        path = None if default is None else Path(default)
        parameters.append(inspect.Parameter("output", keyword, default=path, annotation=file))
        parameters.append(inspect.Parameter("replace", keyword, default=False, annotation=ReplaceOption))

        def run_calibration(**keywords: Any) -> None:
            if keywords["output"] is not None:
                check_new_file(keywords["output"], replace=keywords["replace"])
            calibration = calibrate(**{name: value for name, value in keywords.items() if name in signature})
            lines_to_stdout = (
                file is AircraftFileLines and keywords["output"] is None and calibration.content is not None
            )
            _report(calibration, keywords[source], sys.stderr if lines_to_stdout else sys.stdout)
            _write(calibration, keywords["output"])

        return as_command(run_calibration, calibrate, parameters)

    return decorated


def _report(calibration: Calibrated, source: object, messages: Any) -> None:
    for line in calibration.summary:
        print(line, file=messages)
    for line in calibration.warnings:
        print(f"warning: {line}", file=sys.stderr)
    if calibration.unsupported:
        where = f"{source}: " if isinstance(source, Path) else ""
        print(f"error: {where}nothing written; {calibration.unsupported}", file=sys.stderr)
        raise typer.Exit(ExitCode.FAILURE)


def _write(calibration: Calibrated, output: Path | None) -> None:
    if calibration.content is None:
        return
    if output is None:
        print(calibration.content if isinstance(calibration.content, str) else "", end="")
        return
    text = calibration.content if isinstance(calibration.content, str) else _json(calibration.content)
    write_files({output: text, **calibration.pages})
    print(f"wrote {' and '.join(map(str, (output, *calibration.pages)))}{calibration.remark}")


def _json(content: object) -> bytes:
    return msgspec.json.format(msgspec.json.encode(content), indent=1)
