"""Options that several commands of the simulator share, and quantities with units."""

from typing import Annotated

import typer

from flight.aircraft import shipped_aircraft
from flight.command_line import quantity

AircraftOption = Annotated[
    str, typer.Option(metavar="NAME", help=f"A shipped aircraft ({', '.join(shipped_aircraft())}), or a file.")
]
HeightOption = Annotated[
    float,
    typer.Option(
        parser=quantity("--height", "m", '"300 ft"', least=-500, most=11_000),
        metavar="HEIGHT",
        help="Height above the ground [m].",
    ),
]
ClimbOption = Annotated[
    float,
    typer.Option(
        parser=quantity("--climb", "m/s", '"300 ft/min"', least=-100, most=100),
        metavar="CLIMB",
        help="Rate of climb [m/s].",
    ),
]
BankOption = Annotated[
    float,
    typer.Option(
        parser=quantity("--bank", "deg", '"0.5 rad"', least=-80, most=80),
        metavar="ANGLE",
        help="Bank of a level turn [deg].",
    ),
]
SpeedOption = Annotated[
    float | None,
    typer.Option(
        parser=quantity("--speed", "m/s", '"30 kt"', above=0, most=300),
        metavar="SPEED",
        help="One airspeed [m/s].",
    ),
]
RpmOption = Annotated[
    float | None,
    typer.Option(
        parser=quantity("--rpm", "rpm", '"100 Hz"', above=0),
        metavar="RPM",
        help="Motor speed [rpm]: gives the climb at --speed, or the speed at --climb.",
    ),
]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Overwrite an earlier simulation.")]
ReplaceFileOption = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
SeedOption = Annotated[
    int,
    typer.Option(
        min=0,
        metavar="N",
        help="Number that turbulence, noise and errors are drawn by. The same seed gives the same result.",
    ),
]
