"""`analyze` of an autopilot's log, or of one without flow angles or motor speed: electrical power of level flight."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console

from analysis.performance.request import Request
from analysis.sources.autopilot import read_autopilot_log
from analysis.sources.recognize import Autopilot
from flight.aircraft import Aircraft, Propulsion, Uncertainty, load_aircraft, parse_aircraft
from flight.errors import InputError
from flight.log_reader import Log
from flight.messages import TOPICS_FOR_DRAG

if TYPE_CHECKING:
    from analysis.methods.whole_flight.curve import FlownAircraft
    from analysis.records.flight import Results
    from analysis.sources.recording import FlightRecording
    from flight.propeller import Propeller

ELECTRICAL = ("/static", "/battery")
SPEED = ("/probe/airspeed", "/gps")  # one of them

Progress = Callable[[str], None]


class Done(NamedTuple):
    """The results that were written, and what is to be said of them."""

    results: "Results"
    print_summary: Callable[[Console], None]
    previous_runs: Path | None = None  # where a previous runs.toml is kept, if there was another one
    replaced_report: str = ""  # what was different in a report that was replaced; empty if nothing was


def lacks_drag_topics(log: Log) -> bool:
    """Whether a log of the daemon gives no drag, but electrical power."""
    return not all(map(log.entries.get, TOPICS_FOR_DRAG)) and gives_electrical_power(log)


def gives_electrical_power(log: Log) -> bool:
    """Whether a log has the sensors of an energy balance."""
    return all(map(log.entries.get, ELECTRICAL)) and any(map(log.entries.get, SPEED))


@dataclass(frozen=True)
class OrdinaryFlight:
    """An analysis as the command line asks for it. weight_N, wing_area_m2, span_m: instead of the aircraft file's."""

    log: Path
    folder: Path
    request: Request
    weight_N: float | None
    wing_area_m2: float | None
    span_m: float | None
    air_temperature_K: float | None
    aircraft: Path | None
    propeller: str | None
    command_line: str

    def analyze_autopilot_log(self, autopilot: Autopilot, progress: Progress) -> Done:
        """Write the report of a log of PX4 or ArduPilot. Raises InputError."""
        from analysis.methods.whole_flight.curve import flown_aircraft

        given = load_aircraft(self.aircraft) if self.aircraft else None
        flown = flown_aircraft(given, self.weight_N, self.wing_area_m2, self.span_m, str(self.log))
        return self._analyze(read_autopilot_log(self.log, autopilot), flown, given, progress)

    def analyze_daemon_log(self, log: Log, progress: Progress, reason: str = "") -> Done:
        """Write the report of a log of the daemon. reason: why it gives no drag, where no sensor is missing.

        Raises InputError.
        """
        from analysis.air.contents import propeller_of
        from analysis.methods.whole_flight.curve import flown_aircraft
        from analysis.methods.whole_flight.method import recording_of
        from analysis.sources.structure import check_lacking

        check_lacking(log)
        text = log.attachments.get("aircraft.toml")
        given = load_aircraft(self.aircraft) if self.aircraft else None
        if given is None and text is not None:
            given = parse_aircraft(text.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")
        flown = flown_aircraft(given, self.weight_N, self.wing_area_m2, self.span_m, str(self.log))
        table = None
        if given is not None and self.propeller is None:
            with contextlib.suppress(InputError):  # drag is then withheld
                table = propeller_of(log, given)
        recording = recording_of(log)
        if reason:
            recording = replace(recording, notes=(reason, *recording.notes))
        try:
            return self._analyze(recording, flown, given, progress, table)
        except InputError as error:
            if log.entries.get(SPEED[0]):
                raise
            raise InputError(f"{error}; the log has no {SPEED[0]}, which does without GPS") from None

    def _propeller(self, propulsion: Propulsion) -> "Propeller | None":
        """The table given, or else the aircraft file's where it can be read."""
        from flight.propeller_files import load_propeller

        if self.propeller is not None:
            return load_propeller(self.propeller)
        with contextlib.suppress(InputError):
            return load_propeller(propulsion.propeller) if propulsion.propeller else None
        return None

    def _battery_Wh(self, aircraft: Aircraft | None) -> float | None:
        in_file = aircraft.propulsion.battery_energy_Wh if aircraft else None
        return in_file if self.request.battery_Wh is None else self.request.battery_Wh

    def _analyze(
        self,
        recording: "FlightRecording",
        flown: "FlownAircraft",
        given: Aircraft | None,
        progress: Progress,
        table: "Propeller | None" = None,
    ) -> Done:
        from analysis.methods.thrust_prior import stand_measurements
        from analysis.methods.whole_flight.curve import estimate
        from analysis.methods.whole_flight.drag import ThrustSource, drag_estimate
        from analysis.methods.whole_flight.flight_table import flight_table
        from analysis.methods.whole_flight.simulated_truth import compared
        from analysis.methods.whole_flight.thrust_balance import motor_constants
        from analysis.pages.electrical_page import write_electrical_report
        from analysis.pages.terminal import print_electrical_summary
        from analysis.results.electrical import ElectricalFindings, UsedBattery, electrical_results
        from analysis.results.provenance import provenance_of_file

        recording = replace(recording, air_temperature_K=self.air_temperature_K)
        progress("finding the flight")
        flight = flight_table(recording, flown.weight_N, flown.wing_area_m2)
        progress("balancing energy")
        found = estimate(flight, flown.weight_N, flown.wing_area_m2, flown.span_m, str(self.log))
        progress("balancing thrust")
        propulsion = given.propulsion if given else Propulsion()
        propeller = table or self._propeller(propulsion)
        if propeller is not None:
            propeller = propeller.with_beyond_zero_thrust(propulsion.beyond_zero_thrust)
        source = ThrustSource(
            propeller,
            motor_constants(propulsion),
            given.uncertainty if given else Uncertainty(),
            stand_measurements(given) if given and self.propeller is None else (),
        )
        drag = drag_estimate(flight, found, flown.span_m, source)
        battery_Wh = self._battery_Wh(given)
        battery = None if battery_Wh is None else UsedBattery(battery_Wh, self.request.usable)
        weighed = "given with the command" if self.weight_N is not None else "mass.weight of the aircraft file"
        provenance = provenance_of_file(self.log, weighed, self.aircraft, self.command_line)
        name = propeller.name if propeller else ""
        simulated = compared(recording, flight, found)
        logged, vehicle = recording.parameters, recording.vehicle
        known = ElectricalFindings(flight, found, drag, name, battery, logged, simulated, vehicle)
        results = electrical_results(self.log, flown, known, provenance)
        progress("writing the report")
        replaced = write_electrical_report(results, flight, found, self.folder)
        page = self.folder / "report.html"
        return Done(results, lambda console: print_electrical_summary(results, page, console, replaced))
