"""The command `flightpower export`: an analyzed flight as files that other programs open."""

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
from flightpower.flight.files import check_new_file

SUFFIX = {"parquet": ".parquet", "csv": ".csv", "mat": ".mat", "mcap": ".derived.mcap"}

app = application(no_args_is_help=False)


@app.command()
@takes_options(Options)
def export(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="A log of the daemon, PX4, ArduPilot or Paparazzi, or a table.")
    ],
    to: Annotated[str, typer.Option("--to", metavar="KIND", help=f"{', '.join(KINDS[:-1])} or {KINDS[-1]}.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="File to write; for csv and parquet a folder of files, one a table. Default: beside the log.",
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

    Exit code 0: done. 1: written, but the result is not to be trusted; stderr says why. 2: the input cannot be used;
    one line on stderr says why, and nothing was written.
    """
    if to not in KINDS:
        raise InputError(f"--to {to}: should be one of {', '.join(KINDS)}")
    path = output or log.with_suffix(SUFFIX[to])
    if log.is_dir():
        raise InputError(f"{log}: is a folder; give a log, such as log.mcap")
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
