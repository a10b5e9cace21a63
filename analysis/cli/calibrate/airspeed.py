"""`calibrate airspeed`"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.options import AircraftFile, LogFile, Replace, check_output, write_json
from analysis.estimation.intervals import NORMAL_95
from flight.errors import InputError

if TYPE_CHECKING:
    from analysis.trajectory.airspeed_scale import AirspeedCalibration


def airspeed(
    log: LogFile,
    aircraft: AircraftFile = None,
    probe: Annotated[
        Path | None,
        typer.Option("--probe", metavar="FILE", help="Probe calibration to use instead of the one the log carries."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="JSON file to write as well.")
    ] = None,
    replace: Replace = False,
) -> None:
    """Estimate the scale error of the airspeed and the wind, from flight on several headings with GPS.

    Fly two legs or more of half a minute at a steady speed, there and back along one line, better along two crossing
    lines; turns help. A steady wind changes the ground speed by opposite amounts on opposite headings; the mean
    difference is the scale error. On one heading only, wind and scale error cannot be told apart, and a note says so.
    `analyze` estimates the same for each flight.

    \b
    Examples:
      calibrate airspeed log.mcap
      calibrate airspeed log.mcap --probe probe.json -o airspeed.json
    """
    from analysis.airdata.from_log import flight_data
    from analysis.airdata.probe import load_probe
    from analysis.drag.assumed_values import alpha_scale_sigma
    from analysis.log_checks.axes import check_axes
    from analysis.log_checks.log import check_log
    from analysis.log_contents import Replacements, contents
    from analysis.trajectory.airspeed_scale import calibrate
    from analysis.trajectory.reconstruction import reconstruct
    from flight.aircraft import load_aircraft
    from flight.log_reader import read_log

    check_output(output, replace)
    recorded = read_log(log)
    given = Replacements(
        aircraft=load_aircraft(aircraft) if aircraft else None, probe=load_probe(probe) if probe else None
    )
    carried = contents(recorded, given)
    check_log(recorded, carried.propeller.diameter_m)
    data = flight_data(recorded, carried.aircraft, carried.propeller, carried.probe, carried.magnetometer, carried.zero)
    if not data.table["flying"].any():
        raise InputError(f"{log}: no flight in this log")
    check_axes(data.table, str(log))
    sigma = math.hypot(carried.probe.alpha_scale_sigma, alpha_scale_sigma(carried.aircraft))
    trajectory = reconstruct(data.table, data.rest, alpha_scale_sigma=sigma, compass=data.compass, log=str(log))
    found = calibrate(data.table, trajectory)
    for line in summary(found, carried.notes + data.notes):
        print(line)
    if output:
        write_json(output, {"format": "flightpower-airspeed-1", "source": log.name, **found._asdict()})
        print(f"wrote {output}")


def summary(found: "AirspeedCalibration", notes: list[str]) -> list[str]:
    """The result in lines, with the notes on the log after those on the result."""
    side = "high" if found.scale >= 0 else "low"
    half = NORMAL_95 * found.scale_error
    return [
        f"airspeed reads {100 * abs(found.scale):.2f} ± {100 * half:.2f} % too {side} (95 % interval)",
        f"wind {found.wind_mps:.1f} m/s from {found.wind_from_deg:.0f} deg, mean of the flight",
        *(f"note: {note}" for note in found.notes + notes),
    ]
