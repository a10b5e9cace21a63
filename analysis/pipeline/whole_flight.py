"""From the energy balance of a whole flight to results: electrical power, and drag where thrust is known."""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from msgspec import structs

from flightpower.analysis.air.airspeed_scale import AIRSPEED_FILE
from flightpower.analysis.air.contents import propeller_of, with_installation_of
from flightpower.analysis.flight import Progress
from flightpower.analysis.methods.thrust_prior import stand_measurements
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate, flown_aircraft
from flightpower.analysis.methods.whole_flight.drag import ThrustSource, drag_estimate
from flightpower.analysis.methods.whole_flight.flight_table import (
    FlightTable,
    flight_table,
    require_channels,
    require_length,
)
from flightpower.analysis.methods.whole_flight.simulated_truth import compared
from flightpower.analysis.methods.whole_flight.thrust_balance import motor_constants
from flightpower.analysis.options import Options
from flightpower.analysis.performance.other_weights import electrical_at_weights
from flightpower.analysis.records.flight import MethodTried, Results
from flightpower.analysis.results.energy_balance import EnergyBalanceFindings, assemble_energy_balance
from flightpower.analysis.results.provenance import provenance_of_file
from flightpower.analysis.sources.daemon_log import SPEED
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.sources.structure import check_lacking
from flightpower.analysis.trajectory.settings import PRIORS
from flightpower.flight.aircraft import Aircraft, Propulsion, Uncertainty, load_aircraft, parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.propeller_search import with_table_error


@dataclass(frozen=True, kw_only=True)
class WholeFlightAnalysis:
    """Everything that the energy balance shows about a flight, for the report.

    results : as written to `results.json`
    left_out_s : stretches [s] that the user left out
    """

    log: Log | FlightRecording
    flight: FlightTable
    estimate: ElectricalEstimate
    results: Results
    left_out_s: tuple[tuple[float, float], ...] = ()


def analyze_daemon_log(
    log: Log,
    options: Options,
    progress: Progress,
    *,
    reason: str = "",
    tried: Sequence[MethodTried] = (),
    command_line: str = "",
) -> WholeFlightAnalysis:
    """Analyze the energy balance of a log of the daemon. reason: sentence on why it gives no drag although no sensor is
    missing. tried: methods that its runs allow but that give no curve.

    Raises InputError if the log or a file of the options cannot be used.
    """
    check_lacking(log)
    text = log.attachments.get("aircraft.toml")
    aircraft = _aircraft_file(options)
    if aircraft is None and text is not None:
        aircraft = parse_aircraft(text.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")
    table = None
    if aircraft is not None:
        aircraft = with_installation_of(log, aircraft)
    if aircraft is not None and options.propeller is None:
        with contextlib.suppress(InputError):  # drag is then withheld
            table = propeller_of(log, aircraft)
    recording = recording_of(log)
    if reason:
        recording = replace(recording, notes=(reason, *recording.notes))
    try:
        analysis = analyze_recording(
            recording, options, progress, aircraft, table, tried=tried, command_line=command_line
        )
        return replace(analysis, log=log)
    except InputError as error:
        if log.entries.get(SPEED[0]):
            raise
        raise InputError(f"{error}; the log has no {SPEED[0]}, which does without GPS") from None


def analyze_recording(
    recording: FlightRecording,
    options: Options,
    progress: Progress,
    aircraft: Aircraft | None = None,
    table: Propeller | None = None,
    *,
    tried: Sequence[MethodTried] = (),
    command_line: str = "",
) -> WholeFlightAnalysis:
    """Analyze the energy balance of a recording.

    aircraft : contents of the aircraft file; None for the options' file     table : of the propeller in the log
    tried : as for `analyze_daemon_log`
    Raises InputError if the recording or a file of the options cannot be used.
    """
    path = Path(recording.path)
    aircraft = aircraft or _aircraft_file(options)
    require_channels(recording)
    try:
        flown = flown_aircraft(aircraft, options.flown_weight_N, options.wing_area_m2, options.span_m, str(path))
    except InputError:
        require_length(recording)  # do not ask for weight and wing area if the log gives no curve in any case
        raise
    recording = replace(recording, air_temperature_K=options.air_temperature_K)
    airspeed = AIRSPEED_FILE.load(options.airspeed) if options.airspeed else None
    of_airspeed: list[str] = []
    if airspeed is not None:
        airspeed.check_other_flight(path, str(options.airspeed))
        if aircraft is not None:
            of_airspeed = airspeed.notes_on_aircraft(aircraft, str(options.airspeed))
        recording = airspeed.corrected_recording(recording)
    progress("finding the flight")
    flight = flight_table(recording, flown.weight_N, flown.wing_area_m2, options.left_out_s)
    if airspeed is not None:
        remains = PRIORS.calibrated["V_scale"]
        flight = flight._replace(
            airspeed_scale_sigma=math.hypot(airspeed.scale_error, remains), notes=[*flight.notes, *of_airspeed]
        )
    progress("balancing energy")
    electrical = estimate(flight, flown.weight_N, flown.wing_area_m2, flown.span_m, str(path))
    progress("balancing thrust")
    propulsion = aircraft.propulsion if aircraft else Propulsion()
    propeller = table or _propeller(options, propulsion)
    if propeller is not None:
        propeller = propeller.with_beyond_zero_thrust(propulsion.beyond_zero_thrust)
    uncertainty = aircraft.uncertainty if aircraft else Uncertainty()
    if propeller is not None:
        uncertainty, of_table = with_table_error(uncertainty, aircraft.keys if aircraft else (), propeller)
        flight = flight._replace(notes=[*flight.notes, of_table] if of_table else flight.notes)
    source = ThrustSource(
        propeller,
        motor_constants(propulsion),
        uncertainty,
        stand_measurements(aircraft) if aircraft and options.propeller is None else (),
    )
    drag = drag_estimate(flight, electrical, flown.span_m, source)
    weighed = "given with the command" if options.flown_weight_N is not None else "mass.weight of the aircraft file"
    findings = EnergyBalanceFindings(
        flight,
        electrical,
        drag,
        propeller.name if propeller else "",
        options.request.battery(aircraft),
        recording.parameters,
        compared(recording, flight, electrical),
        recording.vehicle,
        tried,
    )
    provenance = provenance_of_file(path, weighed, options.aircraft, command_line, recording)
    results = assemble_energy_balance(path, flown, findings, provenance)
    others = electrical_at_weights(electrical.curve, options.request.weights_N, results.battery)
    notes = [*others, *options.request.questions(flown.weight_N)]
    results = structs.replace(results, warnings=[*results.warnings, *notes])
    return WholeFlightAnalysis(
        log=recording, flight=flight, estimate=electrical, results=results, left_out_s=options.left_out_s
    )


def _aircraft_file(options: Options) -> Aircraft | None:
    return load_aircraft(options.aircraft) if options.aircraft else None


def _propeller(options: Options, propulsion: Propulsion) -> Propeller | None:
    """The propeller table from the options, or else from the aircraft file if it can be read."""
    if options.propeller is not None:
        return load_propeller(options.propeller)
    with contextlib.suppress(InputError):
        return load_propeller(propulsion.propeller) if propulsion.propeller else None
    return None
