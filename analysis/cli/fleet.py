"""The commands `fleet add` and `fleet show`: many airframes, many flights. Arguments and messages only."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from flightpower.analysis.options import ReplaceOption
from flightpower.flight.command_line import Quantity, application, run
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_files

app = application()

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
    """Keep the statistics of flights, a row each. Flights already in the dataset are skipped.

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
    found = read_flights([flight for folder in folders for flight in flight_folders_of(folder)])
    flights, others = [], []
    for one in found:
        if one.pooling is not None or Kind.ELECTRICAL in one.curves:
            flights.append(one)
        else:
            others.append(f"{one.log}: its curve is not by the dynamic method, and its log has no battery")
    if not flights:
        raise InputError(f"{folders[0]}: no flight to add; {others[0]}")
    added = Dataset(to).add(flights)
    for line in others:
        console.print(f"left out: {line}", markup=False)
    console.print(f"{to}: {added.new} flights added, {added.known} were there already", markup=False)


@app.command()
def show(
    dataset: DatasetArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Folder for fleet.html and fleet.json; else print only."),
    ] = None,
    airframe: Annotated[
        list[str] | None, typer.Option("--airframe", metavar="NAME", help="Only this one; may be repeated.")
    ] = None,
    false_alarms: Annotated[
        float,
        Quantity("--false-alarms", "", "1", least=0.01, most=50).as_option(
            "That are accepted in a year of an airframe that does not change. Fewer find smaller changes later."
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
        for name in ("fleet.html", "fleet.json"):
            check_new_file(output / name, replace=replace)
    import msgspec

    from flightpower.analysis.flights.airframes import airframes
    from flightpower.analysis.flights.dataset import Dataset
    from flightpower.analysis.flights.fleet_summary import fleet_results
    from flightpower.analysis.pages.fleet_page import render_fleet
    from flightpower.analysis.pages.terminal import print_fleet

    unread: list[str] = []
    results = fleet_results(airframes(Dataset(dataset), false_alarms, unread, airframe or ()), unread)
    page = output and output / "fleet.html"
    if output is not None:
        text = msgspec.json.encode(results)
        write_files({output / "fleet.json": text, output / "fleet.html": render_fleet(results)})
    print_fleet(results, page, Console())


def main() -> None:
    """Entry point. Wrong input gives one line on stderr and exit code 2."""
    run(app, "fleet")


if __name__ == "__main__":
    main()
