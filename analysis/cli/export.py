"""The command `flightpower export`: an analyzed flight as files that other programs open."""

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from analysis.exports import FOLDERS, KINDS
from flight.command_line import application, run
from flight.errors import InputError
from flight.log_reader import read_log
from flight.output_file import check_writable
from flight.units import weight_to_N

SUFFIX = {"parquet": ".parquet", "csv": ".csv", "mat": ".mat", "mcap": ".derived.mcap"}

app = application(no_args_is_help=False)


@app.command()
def export(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log of the daemon (docs/log-format.md).")],
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
    aircraft: Annotated[
        Path | None, typer.Option("--aircraft", metavar="FILE", help="Aircraft file instead of the log's.")
    ] = None,
    propeller: Annotated[
        str | None, typer.Option("--propeller", metavar="NAME", help="Propeller instead of the log's.")
    ] = None,
    probe: Annotated[
        Path | None, typer.Option("--probe", metavar="FILE", help="Probe calibration instead of the log's.")
    ] = None,
    zero: Annotated[Path | None, typer.Option("--zero", metavar="FILE", help="Zero instead of the log's.")] = None,
    magnetometer: Annotated[
        Path | None,
        typer.Option("--magnetometer", metavar="FILE", help="Magnetometer calibration instead of the log's."),
    ] = None,
    weight: Annotated[
        str | None, typer.Option("--weight", metavar="WEIGHT", help='Weight in this flight, such as "4.1 kg".')
    ] = None,
    runs: Annotated[Path | None, typer.Option("--runs", metavar="FILE", help="An edited runs.toml.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Analyze a log and write its data for other programs: tables for pandas, MATLAB and spreadsheets, or an MCAP file
    for Foxglove and PlotJuggler.

    Tables: synchronized channels, reconstructed states and derived quantities with standard errors, runs, curves. Units
    are in the names of the columns (docs/exports.md).

    \b
    Examples:
      flightpower export log.mcap --to parquet -o flight
      flightpower export log.mcap --to mat -o flight.mat
      flightpower export log.mcap --to mcap        opens in Foxglove beside the log

    Exit code 0: done. 2: the input cannot be used; one line on stderr says why, and nothing was written.
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
    check_writable(path / "tables" if to in FOLDERS else path)
    weight_N = None if weight is None else weight_to_N(weight, "--weight")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    stderr = Console(stderr=True, quiet=quiet)
    with stderr.status("reading the log …") as status:
        recorded = read_log(log)
        from analysis.exports import interface

        flight = interface.analyze(
            recorded, aircraft=aircraft, propeller=propeller, probe=probe, zero=zero, magnetometer=magnetometer,
            weight_N=weight_N, runs=runs, progress=lambda step: status.update(f"{step} …"),
        )  # fmt: skip
        status.update("writing …")
        interface.export(flight, to, path)
    if not quiet:
        print(f"{path}: written")


def main() -> None:
    run(app, "export")


if __name__ == "__main__":
    main()
