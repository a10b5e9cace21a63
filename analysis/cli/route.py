"""The command `route`, for the energy of a mission in wind: only arguments, messages and exit codes."""

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from flightpower.analysis.options import ReplaceOption
from flightpower.flight.command_line import ExitCode, Quantity, application, run, takes_options
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_file

if TYPE_CHECKING:
    from flightpower.analysis.missions.inputs import RouteInput
    from flightpower.analysis.missions.mission import Mission, Speed, Wind
    from flightpower.analysis.missions.prediction import Flight, Objective
    from flightpower.analysis.records.flight import Results, WithCurves
    from flightpower.analysis.records.pool import PooledResults

app = application()
Read = TypeVar("Read", bound="WithCurves")


@dataclass(frozen=True)
class StallOptions:
    """The stall speed, and the margin above it that every airspeed keeps."""

    stall_mps: Annotated[
        float | None,
        Quantity("--stall", "m/s", '"20 kt"', above=0, most=100).as_option(
            "Stall speed (equivalent airspeed); default: that of the largest lift coefficient flown, or if that is"
            " unknown the slowest of the curve."
        ),
    ] = None
    stall_margin: Annotated[
        float,
        Quantity("--stall-margin", "", "1.2", least=1, most=3).as_option(
            "Least airspeed, as a multiple of the stall speed."
        ),
    ] = 1.2


class SpeedChoice(StrEnum):
    MISSION = "mission"
    ENERGY = "energy"
    TIME = "time"


@dataclass(frozen=True)
class RouteOptions(StallOptions):
    """Assumptions about flight, wind and battery."""

    legs: Annotated[
        str | None,
        typer.Option("--legs", metavar="LEGS", help='Instead of a mission: "3 km 045, 2 km 135 +50 m, drop 0.5 kg".'),
    ] = None
    wind_sd_mps: Annotated[
        float,
        Quantity("--wind-sd", "m/s", '"3 kt"', least=0, most=20).as_option(
            "Standard deviation of each component of the mean wind; the default is that of a forecast."
        ),
    ] = 1.5
    speed: Annotated[
        str,
        typer.Option(
            "--speed",
            metavar="SPEED",
            help="Airspeeds: mission (energy where it has none), energy or time (the best in this wind), or one for all"
            ' legs, such as "17 m/s", equivalent airspeed.',
        ),
    ] = SpeedChoice.MISSION
    battery_Wh: Annotated[
        str | None,
        typer.Option(
            "--battery-Wh", metavar="ENERGY", help='"74 Wh" or "5000 mAh, 14.8 V"; default: as in the results.'
        ),
    ] = None
    usable: Annotated[
        str | None,
        typer.Option("--usable", metavar="SHARE", help="Usable share of the battery; the rest is the reserve."),
    ] = None
    health: Annotated[
        float,
        Quantity("--health", "%", '"85 %"', above=0, most=100).as_option("Capacity left of an aged battery [%]."),
    ] = 100.0
    health_sd: Annotated[
        float,
        Quantity("--health-sd", "%", '"3 %"', least=0, most=50).as_option("Its standard deviation [%]."),
    ] = 4.0
    resistance_ohm: Annotated[
        float,
        Quantity("--resistance", "ohm", '"40 mohm"', least=0, most=10).as_option(
            "Internal resistance of the battery; its loss is then included, at the voltage of --battery-Wh."
        ),
    ] = 0.0
    climb_mps: Annotated[
        float | None,
        Quantity("--climb", "m/s", '"300 ft/min"', above=0, most=100).as_option(
            "Largest rate of climb and descent; default: 0.3 of the stall speed."
        ),
    ] = None
    weight_N: Annotated[
        float | None,
        typer.Option(
            "--weight",
            parser=lambda text: _weight_N(text, "--weight"),
            metavar="WEIGHT",
            help='At the start, such as "4.1 kg"; default: as in the results.',
        ),
    ] = None
    dropped_N: Annotated[
        float | None,
        typer.Option(
            "--drop",
            parser=lambda text: _weight_N(text, "--drop"),
            metavar="WEIGHT",
            help="Mass dropped at each release in the mission.",
        ),
    ] = None
    home: Annotated[
        str | None, typer.Option("--home", metavar="LAT,LON", help="Home [deg]; default: as in the mission.")
    ] = None
    height_m: Annotated[
        float,
        Quantity("--height", "m", '"300 ft"', least=0, most=5000).as_option(
            "Height above home, for legs and for lines without heights.", "HEIGHT"
        ),
    ] = 100.0
    elevation_m: Annotated[
        float | None,
        Quantity("--elevation", "m", '"1500 ft"', least=-500, most=6000).as_option(
            "Elevation of home above sea level; default: the air density of the results.", "HEIGHT"
        ),
    ] = None
    temperature_K: Annotated[
        float | None,
        Quantity("--temperature", "K", '"20 degC"', least=220, most=330).as_option(
            "At home; default: as in the results, or the standard temperature at --elevation."
        ),
    ] = None
    idle_W: Annotated[
        float | None,
        Quantity("--idle-power", "W", '"8 W"', least=0, most=1000).as_option(
            "Drawn with the motor off; default: from the results of an autopilot's log, otherwise 0."
        ),
    ] = None
    power_sd: Annotated[
        float,
        Quantity("--power-sd", "%", '"2 %"', least=0, most=50).as_option(
            "Standard deviation of the mean power of the route about that of steady flight [%]: gusts, control."
        ),
    ] = 3.0
    sure: Annotated[
        float,
        Quantity("--sure", "%", '"99 %"', least=50, most=99.8).as_option(
            "Probability that counts as safe [%].", "PROBABILITY"
        ),
    ] = 95.0


@app.command()
@takes_options(RouteOptions)
def route(
    mission: Annotated[
        Path | None, typer.Argument(metavar="MISSION", help=".plan of QGroundControl, .waypoints, XML of INAV, .kml.")
    ] = None,
    *,
    options: RouteOptions,
    results: Annotated[
        Path, typer.Option("--results", metavar="FILE", help="results.json of `analyze`, of one log or of several.")
    ],
    wind_text: Annotated[
        str,
        typer.Option("--wind", metavar="WIND", help='Wind at the height of the flight: "5 m/s from 270 deg", or 0.'),
    ],
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="FILE", help="Write the map as an SVG image.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
    replace: ReplaceOption = False,
) -> None:
    """The energy of a mission in wind: by leg, charge left with its interval, the probability of coming home.

    Airspeeds are those of the mission, or the best in this wind; none is slower than the stall margin allows, none
    faster than was flown. A mission that ends away from home is continued straight home.

    \b
    Examples:
      flightpower route survey.plan --results log.report/results.json --wind "5 m/s from 270 deg"
      flightpower route field.waypoints --results results.json --wind "12 kt from 200" --speed energy --map map.svg
      flightpower route --legs "3 km 045, 2 km 135 +50 m, 4 km 250" --results results.json --wind 0

    Exit code 0: the route ends with the reserve left, at least as likely as --sure says. 1: it does not. 2: wrong
    input; one line on stderr says what.
    """
    if map_file is not None:
        check_new_file(map_file, replace=replace)
    if (mission is None) == (options.legs is None):
        raise InputError('give a mission file or --legs "3 km 045, 2 km 135", one of them')
    from flightpower.analysis.missions.mission import parse_wind
    from flightpower.analysis.missions.prediction import predict

    wind = parse_wind(wind_text, options.wind_sd_mps)
    speed = _asked_speed(options.speed)
    flown = _mission(mission, options)
    read = read_route_input(results)
    assumed = _flight(read, wind, speed, options)
    result = predict(read, flown, assumed)
    for question in _questions(read, assumed, options):
        print(f"note: {question}", file=sys.stderr)
    if json:
        import msgspec

        print(msgspec.json.encode(result).decode())
    else:
        from flightpower.analysis.missions.route_text import lines

        for line in lines(result):
            print(line)
    if map_file is not None:
        from flightpower.analysis.pages.charts.route_map import map_svg

        write_file(map_file, map_svg(result, flown, wind))
    raise typer.Exit(ExitCode.DONE if result.probability >= result.sure else ExitCode.FAILURE)


def _mission(path: Path | None, options: RouteOptions) -> "Mission":
    from flightpower.analysis.cli.plan import place_of
    from flightpower.analysis.missions.mission import Assumed, parse_legs, with_return
    from flightpower.analysis.missions.mission_files import load_mission
    from flightpower.flight.units import GRAVITY_MPS2

    if path is None:
        return with_return(parse_legs(options.legs or "", options.height_m), ends_by_landing=False)
    home = None if options.home is None else place_of(options.home)
    dropped_kg = (options.dropped_N or 0.0) / GRAVITY_MPS2
    return load_mission(path, Assumed(home, options.height_m, dropped_kg, options.elevation_m))


def _asked_speed(text: str) -> "Speed | Objective | None":
    """Return the airspeed or objective asked for; None means the mission's airspeeds. Raises InputError."""
    from flightpower.analysis.missions.mission import Speed
    from flightpower.analysis.missions.prediction import Objective

    if text == SpeedChoice.MISSION:
        return None
    if text in set(Objective):
        return Objective(text)
    words = ", ".join(SpeedChoice)
    wanted = Quantity("--speed", "m/s", '"30 kt"', above=0, most=200)
    try:
        return Speed(wanted.parse(text))
    except InputError:
        raise InputError(f'--speed {text}: should be one of {words}, or an airspeed such as "17 m/s"') from None


def _flight(results: "RouteInput", wind: "Wind", speed: "Speed | Objective | None", options: RouteOptions) -> "Flight":
    """Combine results and options. Raises InputError if the battery's energy or the air density is not known."""
    from flightpower.analysis.missions.energy import Battery
    from flightpower.analysis.missions.prediction import Air, Flight
    from flightpower.analysis.performance.request import parse_request, voltage_of
    from flightpower.flight.atmosphere import pressure_at, temperature_at

    request = parse_request(options.battery_Wh, options.usable)
    energy_Wh = request.battery_Wh or (results.battery and results.battery.energy_Wh)
    if not energy_Wh:
        raise InputError('the results have no battery; give --battery-Wh "5000 mAh, 14.8 V"')
    voltage_V = voltage_of(options.battery_Wh or "")
    if options.resistance_ohm and voltage_V is None:
        raise InputError('--resistance also requires the voltage; give the battery as --battery-Wh "5000 mAh, 14.8 V"')
    battery = Battery(
        energy_J=3600 * energy_Wh,
        reserve=1 - request.usable,
        health=options.health / 100,
        health_sd=options.health_sd / 100,
        open_circuit_V=voltage_V,
        resistance_ohm=options.resistance_ohm,
    )
    temperature_K, pressure_Pa = results.air_temperature_K, results.air_pressure_Pa
    if options.elevation_m is not None:
        temperature_K, pressure_Pa = float(temperature_at(options.elevation_m)), float(pressure_at(options.elevation_m))
    if temperature_K is None or pressure_Pa is None:
        raise InputError("the results have no air density; analyze the logs again, or give --elevation of home")
    weight_N = options.weight_N or results.test.weight_N
    return Flight(
        wind,
        battery,
        Air(pressure_Pa, options.temperature_K or temperature_K),
        weight_N,
        stall_mps=options.stall_mps,
        stall_margin=options.stall_margin,
        speed=speed,
        climb_mps=options.climb_mps,
        idle_W=options.idle_W,
        sure=options.sure / 100,
        power_sd=options.power_sd / 100,
    )


def _questions(results: "RouteInput", flight: "Flight", options: RouteOptions) -> list[str]:
    """Return a question on each entered value that is far from the flight's value."""
    from flightpower.analysis.performance.request import unusual_battery, unusual_weight

    given_Wh = flight.battery.energy_J / 3600 if options.battery_Wh is not None else None
    weight = unusual_weight("--weight", flight.weight_N, results.test.weight_N)
    return [question for question in (weight, unusual_battery(given_Wh, flight.weight_N)) if question]


def read_route_input(path: Path) -> "RouteInput":
    """Read the part of one flight's or a pool's results that a route needs, with the checks of `read_results`."""
    from flightpower.analysis.missions import inputs

    return _trusted(path, inputs.read_route_input(path))


def read_results(path: Path) -> "Results | PooledResults":
    """Read the results of one flight or of a pool; doubts go to stderr.

    Raises InputError if the file is anything else, or if its results are not to be trusted.
    """
    from flightpower.analysis.results import read

    return _trusted(path, read.read_flight_or_pool(path))


def _trusted(path: Path, results: Read) -> Read:
    from flightpower.analysis.records.flight import Trust
    from flightpower.analysis.results.evidence import sentence

    if results.trust is Trust.NOT_TO_BE_TRUSTED:
        raise InputError(f"{path}: not to be trusted ({results.evidence[0].kind}); use another flight's results")
    for evidence in results.evidence:
        if evidence.level is Trust.DOUBTFUL:
            print(f"{evidence.level}: {sentence(evidence)}", file=sys.stderr)
    return results


def _weight_N(text: str, option: str) -> float:
    from flightpower.analysis.performance.request import parse_weight

    return parse_weight(text, option)


def main() -> None:
    """Run the command. Wrong input gives one line on stderr and exit code 2."""
    run(app, "route")


if __name__ == "__main__":
    main()
