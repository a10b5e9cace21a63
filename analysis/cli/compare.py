"""The command `analyze compare`: the difference between two configurations, from the results of their flights."""

from pathlib import Path
from typing import Annotated

import typer

from flight.command_line import application

app = application()


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="Folder that `analyze` wrote, of one flight or of several.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The same for the other configuration.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="Folder for the page and comparison.json.")
    ] = None,
) -> None:
    """How much more power B takes than A at each speed, and with what confidence.

    Errors that both share, such as those of one installation of the probe, cancel in the difference.

    \b
    Example:
      analyze compare old/ new/ -o difference
    """
