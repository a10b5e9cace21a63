"""The command `flightpower export`: writes an analyzed flight as files that other programs open."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from flightpower.analysis.cli.verdict import report_evidence
from flightpower.analysis.options import Options, QuietOption, ReplaceOption
from flightpower.analysis.pages.exports import FOLDERS, KINDS
from flightpower.analysis.sources.open import open_source
from flightpower.flight.command_line import ExitCode, application, run, takes_options
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_error

SUFFIX = {"parquet": ".parquet", "csv": ".csv", "mat": ".mat", "mcap": ".derived.mcap"}

app = application(no_args_is_help=False)


@app.command()
@takes_options(Options)
def export(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG…", help="Logs of the daemon, PX4, ArduPilot or Paparazzi, or tables."),
    ],
    to: Annotated[str, typer.Option("--to", metavar="KIND", help=f"{', '.join(KINDS[:-1])} or {KINDS[-1]}.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="File to write; for csv and parquet a folder, with one file per table. With several logs: the"
            " folder for"
            " all of them. Default: beside the log.",
        ),
    ] = None,
    options: Options = Options(),
    replace: ReplaceOption = False,
    quiet: QuietOption = False,
) -> ExitCode:
    """Analyze a log and write its data for other programs: tables for pandas, MATLAB and spreadsheets, or an MCAP file
    for Foxglove and PlotJuggler.

    Tables: synchronized channels, reconstructed states and derived quantities with standard errors, runs, curves. Units
    are in the names of the columns (docs/use/exports.md).

    \b
    Examples:
      flightpower export log.mcap --to parquet -o flight
      flightpower export log.mcap --to mat -o flight.mat
      flightpower export log.mcap --to mcap        opens in Foxglove beside the log
      flightpower export flights/*.mcap --to csv -o tables

    Exit code 0: done. 1: written, but the result is not to be trusted; stderr says why. 2: the input cannot be used;
    one line on stderr says why, and nothing was written of that log and those after it.
    """
    if to not in KINDS:
        raise InputError(f"--to {to}: should be one of {', '.join(KINDS)}")
    if len(logs) == 1:
        return _export(logs[0], output or logs[0].with_suffix(SUFFIX[to]), to, options, replace=replace, quiet=quiet)
    if output is not None and output.is_file():
        raise InputError(f"{output}: is a file; give the folder for several logs with -o")
    paths = [(output or log.parent) / log.with_suffix(SUFFIX[to]).name for log in logs]
    if same := [path for path in paths if paths.count(path) > 1]:
        raise InputError(f"{same[0]}: two logs would be written there; export each with its own -o")
    if output is not None:
        try:
            output.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise write_error(output, error) from None
    codes = [
        _export(log, path, to, options, replace=replace, quiet=quiet) for log, path in zip(logs, paths, strict=True)
    ]
    return max(codes)


def _export(log: Path, path: Path, to: str, options: Options, *, replace: bool, quiet: bool) -> ExitCode:
    """Analyze a log and write it to `path`. On InputError nothing has been written."""
    if log.is_dir():
        raise InputError(f"{log}: is a folder; give its logs, such as {log}/*.mcap")
    if path.exists() and log.exists() and path.samefile(log):
        raise InputError(f"{path}: is the log itself; give another name with -o")
    if path.is_dir() != (to in FOLDERS) and path.exists():
        raise InputError(f"{path}: is {'a folder' if path.is_dir() else 'a file'}; give another name with -o")
    if path.is_dir() and any(path.iterdir()) and not replace:
        raise InputError(f"{path}: is not empty; give --replace, or another folder with -o")
    check_new_file(path / "tables" if to in FOLDERS else path, replace=replace)
    stderr = Console(stderr=True, quiet=quiet)
    with stderr.status("reading the log …") as status:
        source = open_source(log, options.columns)
        from flightpower.analysis.pages.exports.tables import export_tables, tables_of
        from flightpower.analysis.pipeline import analyze

        analysis = analyze(source, options, lambda step: status.update(f"{step} …"))
        status.update("writing …")
        export_tables(tables_of(analysis), source, to, path)
    if not quiet:
        print(f"{path}: written")
    return report_evidence(analysis.results.evidence, lambda: None)


def main() -> None:
    run(app, "export")


if __name__ == "__main__":
    main()
