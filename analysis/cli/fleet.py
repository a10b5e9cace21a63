"""The commands `fleet add` and `fleet show` for many airframes and flights: only arguments and messages."""

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer
from rich.console import Console

from flightpower.analysis.options import ReplaceOption
from flightpower.flight.command_line import Quantity, application, run
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_files

if TYPE_CHECKING:
    from flightpower.analysis.flights.flight_statistics import PoolFlight

app = application()

PAGES = ("fleet.html", "fleet.json", "flights.csv", "curves.csv")

DatasetArgument = Annotated[
    str,
    typer.Argument(metavar="DATASET", help="A folder, or an address such as s3://bucket/fleet.", show_default=False),
]


@app.command()
def add(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER…", help="Folders that `analyze` wrote.")],
    to: Annotated[
        str, typer.Option("--to", metavar="DATASET", help="A folder, or an address such as s3://bucket/fleet.")
    ],
) -> None:
    """Add flights to the dataset of a fleet, one row per flight. Flights already in the dataset are skipped.

    \b
    Example:
      flightpower fleet add flights/ --to fleet

    Exit code 0: done. 2: a folder or the dataset cannot be used; one line on stderr says why.
    """
    if not to:
        raise InputError("--to is empty; give a folder, or an address such as s3://bucket/fleet")
    from flightpower.analysis.flights.campaign.campaign import flight_folders_of, read_flights
    from flightpower.analysis.flights.dataset import Dataset
    from flightpower.analysis.records.flight import Kind

    console = Console(highlight=False)
    new = already_in = 0
    left_out = []
    for of_folder in [flight_folders_of(folder) for folder in folders]:
        flights = []
        for flight in read_flights(of_folder):
            if flight.pooling is not None or Kind.ELECTRICAL in flight.curves:
                flights.append(flight)
            else:
                left_out.append(f"{flight.log}: its curve is not by the dynamic method, and its log has no battery")
        added = Dataset(to).add(flights, {folder.name: folder for folder in of_folder})
        new, already_in = new + added.new, already_in + added.already_there
    if not new and not already_in:
        raise InputError(f"{folders[0]}: no flight to add; {left_out[0]}")
    for line in left_out:
        console.print(f"left out: {line}", markup=False)
    console.print(f"{to}: {new} flights added, {already_in} were already there", markup=False)


@app.command()
def show(
    dataset: DatasetArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FOLDER",
            help="Folder for fleet.html, fleet.json, and flights.csv and curves.csv for spreadsheets; default:"
            " print only.",
        ),
    ] = None,
    airframe: Annotated[
        list[str] | None, typer.Option("--airframe", metavar="NAME", help="Show only this airframe; may be repeated.")
    ] = None,
    false_alarms: Annotated[
        float,
        Quantity("--false-alarms", "", "1", least=0.01, most=50).as_option(
            "False alarms to accept per year for an airframe that does not change. A lower rate finds small"
            " changes later."
        ),
    ] = 1.0,
    replace: ReplaceOption = False,
) -> None:
    """The curve of each airframe and of the fleet, and which airframes need more power than they did, and why.

    \b
    Example:
      flightpower fleet show fleet -o fleet-today

    Exit code 0: done. 2: the dataset cannot be read; one line on stderr says why.
    """
    if output is not None:
        for name in PAGES:
            check_new_file(output / name, replace=replace)
    import msgspec

    from flightpower.analysis.flights.airframes import airframes
    from flightpower.analysis.flights.dataset import Dataset
    from flightpower.analysis.flights.fleet_summary import fleet_results
    from flightpower.analysis.pages.fleet_page import curves_csv, flights_csv, render_fleet
    from flightpower.analysis.pages.terminal import print_fleet

    unread: list[str] = []
    result = airframes(Dataset(dataset), false_alarms, unread, airframe or ())
    results = fleet_results(result, unread, partial(_report, dataset, output))
    page = output and output / "fleet.html"
    if output is not None:
        contents: list[str | bytes] = [
            render_fleet(results), msgspec.json.encode(results), flights_csv(results), curves_csv(results)
        ]  # fmt: skip
        write_files({output / name: content for name, content in zip(PAGES, contents, strict=True)})
    print_fleet(results, page, Console())


def _report(dataset: str, output: Path | None, flight: "PoolFlight") -> str:
    """Return the link from the fleet's page to a flight's page; "" if that page is not on this computer."""
    page = Path(dataset, flight.folder, "report.html")
    if output is None or not flight.folder or not page.is_file():
        return ""
    try:
        return quote(Path(os.path.relpath(page.resolve(), output.resolve())).as_posix())
    except ValueError:  # the page is on another Windows drive
        return page.resolve().as_uri()


def main() -> None:
    """Run the command. Wrong input gives one line on stderr and exit code 2."""
    run(app, "fleet")


if __name__ == "__main__":
    main()
