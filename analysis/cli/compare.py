"""The command `analyze compare`: the difference between two configurations, from the results of their flights."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from flightpower.analysis.cli.verdict import evidence_of_kinds, report_evidence
from flightpower.flight.command_line import application
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_writable

app = application()


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="Folder that `analyze` wrote, of one flight or of several.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Folder of the other configuration.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="Folder for report.html and results.json; default: print only."
        ),
    ] = None,
) -> None:
    """How much more power B requires than A at each speed, and with what confidence.

    Errors that both share, such as those of one installation of the probe, cancel in the difference.

    \b
    Example:
      analyze compare old/ new/ -o difference

    Exit code 0: done; doubts about a flight, or about what the two share, are named first. 1: done, but the results of
    a flight are not to be trusted; lines on stderr say why. 2: the folders cannot be compared; one line on stderr says
    why, and nothing was written.
    """
    if a.resolve() == b.resolve():
        raise InputError(f"A and B are the same folder: {a}; give two")
    if output is not None:
        check_writable(output / "report.html")
        _check_no_other_results(output / "results.json")
    from flightpower.analysis.flights.campaign.campaign import flight_folders_of, read_flights
    from flightpower.analysis.flights.comparison import compare as compare_pools
    from flightpower.analysis.flights.pool import pool_results
    from flightpower.analysis.pages.terminal import print_comparison
    from flightpower.analysis.pages.write import write_comparison

    pool_a, pool_b = (pool_results(read_flights(flight_folders_of(folder))) for folder in (a, b))
    names = [folder.resolve().name for folder in (a, b)]
    if names[0] == names[1]:
        names = [str(a), str(b)]
    comparison = compare_pools(pool_a, pool_b).results(*names)
    if output is not None:
        write_comparison(comparison, output)
    page = output and output / "report.html"
    evidence = evidence_of_kinds(comparison)
    raise typer.Exit(report_evidence(evidence, lambda: print_comparison(comparison, page, Console())))


def _check_no_other_results(path: Path) -> None:
    """Raises InputError if the path holds other results, such as those of one of the flights being compared."""
    from flightpower.analysis.records.pool import COMPARISON_FORMAT
    from flightpower.analysis.results.read import read_json

    if path.exists() and read_json(path).get("format") != COMPARISON_FORMAT:
        raise InputError(f"{path.parent}: has results of `analyze`, which must not be replaced; give another folder")
