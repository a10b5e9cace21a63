"""What several commands of the simulator share: options, quantities with units, and the progress bar on stderr."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from flightpower.flight.aircraft import shipped_aircraft
from flightpower.flight.command_line import Quantity
from flightpower.flight.errors import InputError
from flightpower.flight.messages import FIRST_UTC_NS, LAST_UTC_NS

AircraftOption = Annotated[
    str, typer.Option(metavar="NAME", help=f"A shipped aircraft ({', '.join(shipped_aircraft())}), or a file.")
]
HeightOption = Annotated[
    float,
    Quantity("--height", "m", '"300 ft"', least=-500, most=11_000).as_option("Height above the ground [m].", "HEIGHT"),
]
ClimbOption = Annotated[
    float,
    Quantity("--climb", "m/s", '"300 ft/min"', least=-100, most=100).as_option("Rate of climb [m/s]."),
]
BankOption = Annotated[
    float,
    Quantity("--bank", "deg", '"0.5 rad"', least=-80, most=80).as_option("Bank of a level turn [deg].", "ANGLE"),
]
SpeedOption = Annotated[
    float | None,
    Quantity("--speed", "m/s", '"30 kt"', above=0, most=300).as_option("One airspeed [m/s]."),
]
RpmOption = Annotated[
    float | None,
    Quantity("--rpm", "rpm", '"100 Hz"', above=0).as_option(
        "Motor speed [rpm]: gives the climb at --speed, or the speed at --climb."
    ),
]
LikeOption = Annotated[
    str | None,
    typer.Option(
        "--like",
        metavar="NAME",
        help="Shipped aircraft that supplies, scaled, every key that the aircraft file lacks; four keys are enough.",
    ),
]
InstallationOption = Annotated[
    str | None,
    typer.Option(
        "--installation",
        metavar="NAME",
        help="Flights with the same name share their errors of probe, mounting and propeller. "
        "Default: the name in the aircraft file.",
    ),
]


def _date(text: str) -> datetime:
    """Midnight UTC of a day that satellites can date."""
    try:
        day = datetime.fromisoformat(text).replace(tzinfo=UTC)
    except ValueError:
        raise InputError(f'--date: {text!r} is not a date; write it as "2026-05-01"') from None
    if day != day.replace(hour=0, minute=0, second=0, microsecond=0):
        raise InputError(f"--date: {text!r} has a time of day; give the date alone")
    if not FIRST_UTC_NS <= day.timestamp() * 1e9 < LAST_UTC_NS:
        raise InputError(f"--date: {text!r} is no day that GPS can date; give one from 1980 to 2099")
    return day


DateOption = Annotated[
    datetime | None,
    typer.Option("--date", parser=_date, metavar="DATE", help='Day of the flight, such as "2026-05-01".'),
]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Overwrite an earlier simulation.")]
ReplaceFileOption = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
SeedOption = Annotated[
    int,
    typer.Option(
        min=0,
        metavar="N",
        help="Seed for turbulence, noise and errors. The same seed gives the same result.",
    ),
]


Report = Callable[[float], None]  # its argument: how many seconds are done


@contextmanager
def progress_bar(what: str, total_s: float | None = None) -> Iterator[Report]:
    """Yield a function that receives the seconds done, and shows a progress bar on stderr after two seconds."""
    console = Console(stderr=True)
    bar = Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.completed:.0f} s"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    task = bar.add_task(what, total=total_s)
    begun, is_visible = time.monotonic(), False

    def report(seconds: float) -> None:
        nonlocal is_visible
        if not is_visible and console.is_terminal and time.monotonic() - begun > 2:
            bar.start()
            is_visible = True
        bar.update(task, completed=seconds)

    try:
        yield report
    finally:
        if is_visible:
            bar.stop()
