"""The command `plan`, which plans a flight for the narrowest interval: only arguments, messages and exit codes."""

import dataclasses
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from flightpower.analysis.missions.plan_settings import LEG
from flightpower.analysis.missions.speed_unit import SpeedUnit
from flightpower.analysis.options import ReplaceOption
from flightpower.flight.aircraft import Aircraft, load_aircraft, shipped_aircraft
from flightpower.flight.command_line import Quantity, application, run, takes_options
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_files

if TYPE_CHECKING:
    from flightpower.analysis.missions.search import FlightPlan

app = application()


class QuestionName(StrEnum):
    """Quantities that the flight can be planned to measure best."""

    CURVE = "curve"
    ENDURANCE = "endurance"
    RANGE = "range"
    PROPELLERS = "propellers"
    PROBE = "probe"


class PilotKind(StrEnum):
    LINE_OF_SIGHT = "line-of-sight"
    AUTOPILOT = "autopilot"


class Firmware(StrEnum):
    PX4 = "px4"
    ARDUPILOT = "ardupilot"


@dataclass(frozen=True)
class PlanOptions:
    """The user's requirements for a plan."""

    propeller: Annotated[
        str | None,
        typer.Option("--propeller", metavar="NAME", help="Propeller, or its table, instead of the aircraft file's."),
    ] = None
    minutes: Annotated[
        float,
        Quantity("--minutes", "min", '"0.3 h"', above=0, most=240).as_option(
            "Whole flight, including two minutes standing on the ground. Four hours take half a minute to plan."
        ),
    ] = 21.0
    wind_kt: Annotated[
        float,
        Quantity("--wind-kt", "kt", '"5 m/s"', least=0, most=40).as_option(
            "Wind at 6 m above the ground, which makes the turbulence."
        ),
    ] = 5.0
    question: Annotated[QuestionName, typer.Option("--question", help="What the flight should measure best.")] = (
        QuestionName.CURVE
    )
    pilot: Annotated[PilotKind, typer.Option("--pilot", help="Who flies.")] = PilotKind.LINE_OF_SIGHT
    leg_m: Annotated[
        float | None,
        Quantity("--leg", "m", '"1500 ft"', least=100, most=20000).as_option(
            f"Longest straight flight; default: {LEG.length_m[0]:.0f} m in line of sight,"
            f" {LEG.length_m[1]:.0f} m with an autopilot."
        ),
    ] = None
    height_m: Annotated[
        float,
        Quantity("--height", "m", '"130 ft"', least=25, most=1000).as_option(
            "Above the ground. The length of vertical gusts equals this height: flying low averages them sooner, but"
            " leaves less room for a stall.",
            "HEIGHT",
        ),
    ] = 40.0
    side_m: Annotated[
        float | None,
        Quantity("--side", "m", '"300 ft"', least=10, most=20000).as_option(
            "Room for the turns to each side of the legs, in still air; default: what the turns need."
        ),
    ] = None
    load_factor: Annotated[
        float,
        Quantity("--load-factor", "", "1.7", above=1.2, most=2.0).as_option(
            "Largest load factor while porpoising; the smallest is the same amount below 1."
        ),
    ] = 2.0
    stall_mps: Annotated[
        float | None,
        Quantity("--stall", "m/s", '"20 kt"', above=0, most=100).as_option(
            "Stall speed, wings level; default: computed with a largest lift coefficient of 1.2."
        ),
    ] = None
    after: Annotated[
        list[Path] | None,
        typer.Option("--after", metavar="FILE", help="results.json of an earlier flight; may be repeated."),
    ] = None
    home: Annotated[
        str | None,
        typer.Option("--home", metavar="LAT,LON", help="Middle of the legs [deg]; also writes a mission."),
    ] = None
    heading_deg: Annotated[
        float | None,
        Quantity("--heading", "deg", '"1.2 rad"', least=-360, most=360).as_option(
            "Heading of the legs [deg]; adds a map to the card. Without it a mission's legs run north."
        ),
    ] = None
    wind_from_deg: Annotated[
        float | None,
        Quantity("--wind-from", "deg", '"4.7 rad"', least=0, most=360).as_option(
            "Where the wind comes from [deg], with --heading; default: 50 degrees to the left of the first leg."
        ),
    ] = None
    firmware: Annotated[Firmware, typer.Option("--firmware", help="Of the mission.")] = Firmware.PX4

    def __post_init__(self) -> None:
        """Convert names given as text. Raises InputError for unknown names, and for --wind-from without --heading."""
        for name, kind in (("question", QuestionName), ("pilot", PilotKind), ("firmware", Firmware)):
            value = getattr(self, name)
            if value not in set(kind):
                raise InputError(f"{name}: {value!r} is not one of {', '.join(kind)}")
            object.__setattr__(self, name, kind(value))
        if self.wind_from_deg is not None and self.heading_deg is None:
            raise InputError(
                f"--wind-from {self.wind_from_deg:g}: means nothing without --heading of the legs; give both"
            )

    @property
    def first_leg_deg(self) -> float | None:
        """Heading of the first leg, if given; with a wind direction, the legs' heading that goes into the wind."""
        if self.heading_deg is None or self.wind_from_deg is None:
            return self.heading_deg
        with_wind = abs((self.wind_from_deg - self.heading_deg + 180) % 360 - 180) > 90
        return (self.heading_deg + 180 * with_wind) % 360

    @property
    def longest_leg_m(self) -> float:
        """Longest leg [m]: the given length, or the usual length for this pilot."""
        by_autopilot = self.pilot is PilotKind.AUTOPILOT
        return self.leg_m or (LEG.length_m[1] if by_autopilot else LEG.length_m[0])

    @property
    def place_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude [deg] of the middle of the legs, if given. Raises InputError."""
        return None if self.home is None else place_of(self.home)


@app.command()
@takes_options(PlanOptions)
def plan(
    aircraft: Annotated[str, typer.Argument(metavar="AIRCRAFT", help="A shipped aircraft, or an aircraft file.")],
    options: PlanOptions,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="Default: plan-AIRCRAFT.")
    ] = None,
    speed_unit: Annotated[
        SpeedUnit, typer.Option("--speed-unit", help="Unit beside m/s on the card: that of the pilot's display.")
    ] = SpeedUnit.KNOT,
    replace: ReplaceOption = False,
) -> None:
    """What to fly next: the sequence of maneuvers that gives the answer its smallest interval.

    Writes a card to print (card.html) and one for the daemon, which ticks off the runs (card.toml), a plan for the
    simulator (plan.toml) and, with --home, a mission for an autopilot (mission.plan, mission.waypoints).

    \b
    Examples:
      flightpower plan nexstar --minutes 21 --wind-kt 15
      flightpower plan my.toml --after flight1.report/results.json --question endurance
      flightpower plan my.toml --propeller apc-12x8e --wind-kt 8
      flightpower plan my.toml --pilot autopilot --home 48.1,11.5 --heading 250
    """
    place = options.place_deg
    craft = _aircraft(aircraft, options)
    folder = output or Path(f"plan-{craft.name}")
    check_new_file(folder / "plan.toml", replace=replace)

    with Console(stderr=True).status("planning …") as status:
        made = flight_plan(aircraft, options, lambda step: status.update(f"planning: {step} …"))
    from flightpower.analysis.missions.card import card, runs_to_tick_off
    from flightpower.analysis.missions.plan_mission import Home, qgroundcontrol_plan, waypoint_file
    from flightpower.analysis.missions.simulator_plan import simulator_plan

    files = {
        "plan.toml": simulator_plan(made.maneuvers, made.aircraft, made.request),
        "card.html": card(made, craft.title, speed_unit),
        "card.toml": runs_to_tick_off(made),
    }
    if place is not None:
        where = Home(*place, radians(options.first_leg_deg or 0.0))
        files["mission.plan"] = qgroundcontrol_plan(made, where, options.firmware)
        files["mission.waypoints"] = waypoint_file(made, where)
    write_files({folder / name: text for name, text in files.items()})
    _print(made, folder, list(files), speed_unit, stall_given=options.stall_mps is not None)
    if options.propeller is not None:
        print(f'before you rehearse it, put propeller = "{options.propeller}" into the aircraft file')
    like = [] if aircraft in shipped_aircraft() else ["--like", "nexstar"]
    words = ["--aircraft", aircraft, *like, "--plan", str(folder / "plan.toml"), "--no-hardware", "-o", "flown"]
    print(f"rehearse it: sim fly {shlex.join(words)}")


def _aircraft(name_or_path: str, options: PlanOptions) -> Aircraft:
    craft = load_aircraft(name_or_path)
    if options.propeller is None:
        return craft
    return dataclasses.replace(craft, propulsion=dataclasses.replace(craft.propulsion, propeller=options.propeller))


def flight_plan(aircraft: str, options: PlanOptions, progress: Callable[[str], None] = lambda _: None) -> "FlightPlan":
    """Plan a flight for a shipped aircraft or an aircraft file. progress: called with each step. Raises InputError."""
    from flightpower.analysis.missions import information
    from flightpower.analysis.missions.expected_aircraft import expected_aircraft
    from flightpower.analysis.missions.pieces import Pilot, Space
    from flightpower.analysis.missions.search import Request, plan_flight

    results = [information.read_results(path) for path in options.after or []]
    expected = expected_aircraft(
        _aircraft(aircraft, options), options.height_m, A=information.polar(results), stall_mps=options.stall_mps
    )
    side_m = inf if options.side_m is None else options.side_m
    request = Request(
        options.minutes,
        options.wind_kt,
        Space(options.longest_leg_m, options.height_m, side_m),
        Pilot(options.pilot is PilotKind.AUTOPILOT, options.load_factor - 1),
        options.question,
        information.information(results),
        heading_deg=options.first_leg_deg,
        wind_from_deg=options.wind_from_deg,
    )
    return plan_flight(expected, request, progress)


def place_of(text: str) -> tuple[float, float]:
    """Return latitude and longitude [deg] from the text of `--home`. Raises InputError."""
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f'--home {text}: should be latitude and longitude in degrees, such as "48.1,11.5"') from None
    if not (abs(latitude) <= 85 and abs(longitude) <= 180):
        raise InputError(f"--home {text}: latitude should be within 85, longitude within 180 degrees")
    return latitude, longitude


def _print(made: "FlightPlan", folder: Path, files: list[str], unit: SpeedUnit, *, stall_given: bool) -> None:
    from flightpower.analysis.missions import card as texts

    console = Console(highlight=False, soft_wrap=True)
    console.print(f"Plan for {made.question.title}: {made.seconds / 60:.1f} min, {made.request.wind_kt:g} kt")
    console.print(f"Computed with {made.aircraft.basis}.")
    for warning in texts.warnings(made):
        console.print(f"warning: {warning}")
    console.print(texts.margin(made, unit))
    if not stall_given:
        console.print("If you know the stall speed, give it with --stall.")
    for row in texts.rows(made):
        console.print(f"{row.times:>5} {row.title} ({row.seconds:.0f} s)")
    widths = ", ".join(f"{half} at {speed}" for speed, half in texts.expected_interval(made, unit))
    console.print(f"Expected 95 % interval of power: {widths}")
    console.print("What each part is worth, at the speed with the widest interval:")
    for line in texts.losses(made):
        console.print(f"  {line}")
    console.print(f"wrote {', '.join(str(folder / name) for name in files)}")


def main() -> None:
    """Run the command. Wrong input gives one line on stderr and exit code 2."""
    run(app, "plan")


if __name__ == "__main__":
    main()
