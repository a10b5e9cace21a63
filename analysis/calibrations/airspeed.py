"""The command `calibrate airspeed`: scale error of the airspeed, and wind, from a flight."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flightpower.analysis.air.airspeed_scale import FORMAT
from flightpower.analysis.calibrations.runner import Calibrated, OptionalFile, calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.options import AircraftOption, ProbeOption, refuse_drag_options
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.flight.errors import InputError
from flightpower.flight.files import sha256_of

if TYPE_CHECKING:
    from flightpower.analysis.trajectory.consistency import AirspeedCalibration
    from flightpower.flight.aircraft import Aircraft


@calibration(OptionalFile)
def airspeed(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG", help="A log recorded by the daemon, or one of PX4 (.ulg) or ArduPilot (.BIN)."),
    ],
    aircraft: AircraftOption = None,
    probe: ProbeOption = None,
) -> Calibrated:
    """Estimate the scale error of the airspeed and the wind, from flight on several headings with GPS.

    Fly two legs or more of half a minute at a steady speed, there and back along one line, better along two crossing
    lines; turns help. A steady wind changes the ground speed by opposite amounts on opposite headings; the mean
    difference is the scale error. On a single heading, wind and scale error cannot be separated, and a note says so.
    `analyze` estimates the same for each flight; that of other flights with the same installation begins with this
    scale if it is given: `--airspeed FILE`. Exit code 1 and no file if the standard error of the scale stays above 0.8
    of what it was before the flight, as without GPS.

    To rehearse it: `sim fly --plan airspeed-box -o out/box`.

    \b
    Examples:
      calibrate airspeed log.mcap
      calibrate airspeed log.mcap --probe probe.json -o airspeed.json
      analyze other.mcap --airspeed airspeed.json
      calibrate airspeed log.ulg                     a log of PX4 or ArduPilot
    """
    from flightpower.analysis.air.contents import Replacements
    from flightpower.analysis.air.probe import PROBE_FILE
    from flightpower.analysis.flight import recorded, synchronized, trajectory_with
    from flightpower.analysis.trajectory.consistency import calibrate
    from flightpower.flight.aircraft import load_aircraft
    from flightpower.flight.log_reader import read_log

    autopilot = autopilot_of(log)
    if autopilot:
        refuse_drag_options(log, "the log is an autopilot's", probe=probe, aircraft=aircraft)
        return _calibrated(autopilot_airspeed(log, autopilot), [], log)
    replacements = Replacements(
        aircraft=load_aircraft(aircraft) if aircraft else None, probe=PROBE_FILE.load(probe) if probe else None
    )
    flight = synchronized(recorded(read_log(log), replacements))
    if not flight.table["flying"].any():
        raise InputError(f"{log}: no flight in this log")
    calibration = calibrate(flight.table, trajectory_with(flight, flight.data))
    return _calibrated(calibration, list(flight.notes), log, flight.aircraft)


def autopilot_airspeed(log: Path, autopilot: Autopilot) -> "AirspeedCalibration":
    """Estimate scale and wind from a flight under PX4 or ArduPilot. Raises InputError."""
    from flightpower.analysis.methods.whole_flight.airspeed_gps import airspeed_errors, one_way
    from flightpower.analysis.methods.whole_flight.flight_table import flight_table
    from flightpower.analysis.sources.autopilot import read_autopilot_log
    from flightpower.analysis.sources.recording import GPS
    from flightpower.analysis.trajectory.consistency import AirspeedCalibration, notes_on, why_not_determined

    typical_N, area_m2 = 60.0, 1.0  # only their ratio matters here: it serves to recognize flight
    flight = flight_table(read_autopilot_log(log, autopilot), typical_N, area_m2)
    if flight.first_wind_mps is not None:
        raise InputError(f"{log}: the log has no airspeed to calibrate")
    errors = airspeed_errors(flight)
    if errors.wind_mps is None or errors.wind_from_deg is None:
        raise InputError(f"{log}: no GPS velocity in flight: neither scale nor wind can be determined")
    table = flight.table[flight.flown]
    spread = one_way(table[GPS[0]].to_numpy(), table[GPS[1]].to_numpy(), errors)
    error = errors.scale_variance**0.5
    notes = [*flight.notes, *notes_on(spread, error, errors.prior_sigma)]
    return AirspeedCalibration(
        errors.scale,
        error,
        errors.wind_mps,
        errors.wind_from_deg,
        spread,
        notes,
        why_not_determined(error, errors.prior_sigma),
    )


def _calibrated(
    calibration: "AirspeedCalibration", notes: list[str], log: Path, aircraft: "Aircraft | None" = None
) -> Calibrated:
    flown = {"aircraft": aircraft.name, "installation": aircraft.installation.name} if aircraft else {}
    named = {key: name for key, name in flown.items() if name}
    content = {name: value for name, value in calibration._asdict().items() if name != "unsupported"}
    content = {"format": FORMAT, "source": log.name, "log_sha256": sha256_of(log), **named, **content}
    return Calibrated(summary(calibration, notes), content, unsupported=calibration.unsupported)


def summary(calibration: "AirspeedCalibration", notes: list[str]) -> list[str]:
    """Return the result in lines, with the notes on the log after those on the result."""
    side = "high" if calibration.scale >= 0 else "low"
    half = NORMAL_95 * calibration.scale_error
    return [
        f"airspeed reads {100 * abs(calibration.scale):.2f} ± {100 * half:.2f} % too {side} (95 % interval)",
        f"wind {calibration.wind_mps:.1f} m/s from {calibration.wind_from_deg:.0f} deg, mean of the flight",
        *(f"note: {note}" for note in calibration.notes + notes),
    ]
