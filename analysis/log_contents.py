"""What a log carries beside the measurements: aircraft file, propeller table, calibrations, zeros."""

from typing import NamedTuple

from analysis.airdata.magnetometer import MagnetometerCalibration, parse_magnetometer
from analysis.airdata.probe import ProbeCalibration, parse_probe
from analysis.signals.rest import zero_of_attachment
from flight.aircraft import Aircraft, parse_aircraft
from flight.errors import InputError
from flight.log_reader import Log
from flight.propeller import Propeller
from flight.propeller_files import parse_propeller


class LogContents(NamedTuple):
    """What an analysis takes from a log beside its measurements.

    zero : by channel, what `daq zero` measured; None where the log carries none
    notes : damage of the log, in sentences
    """

    aircraft: Aircraft
    propeller: Propeller
    probe: ProbeCalibration
    magnetometer: MagnetometerCalibration | None
    zero: dict[str, float] | None
    notes: list[str]


def contents(
    log: Log,
    aircraft: Aircraft | None = None,
    propeller: Propeller | None = None,
    magnetometer: MagnetometerCalibration | None = None,
) -> LogContents:
    """The contents of a log; what is given replaces what the log carries.

    Raises InputError when something that nothing replaces is missing or malformed.
    """
    aircraft = aircraft or aircraft_of(log)
    propeller = propeller or propeller_of(log, aircraft)
    return LogContents(
        aircraft,
        propeller.with_beyond_zero_thrust(aircraft.propulsion.beyond_zero_thrust),
        probe_of(log),
        magnetometer or magnetometer_of(log),
        zero_of_attachment(log.attachments.get("zero.json"), f"{log.path}: zero.json"),
        damage(log),
    )


def aircraft_of(log: Log) -> Aircraft:
    """The aircraft file in a log. Raises InputError when there is none, or it is malformed."""
    text = _attachment(log, "aircraft.toml", "give one with --aircraft FILE")
    return parse_aircraft(text.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")


def propeller_of(log: Log, aircraft: Aircraft) -> Propeller:
    """The propeller's table in a log. Raises InputError when there is none, or it is malformed."""
    table = _attachment(log, "propeller.csv", "the tray's aircraft file names the propeller that goes into logs")
    return parse_propeller(table.decode("utf-8", errors="replace"), aircraft.propulsion.propeller or "propeller.csv")


def probe_of(log: Log) -> ProbeCalibration:
    """The probe's calibration in a log. Raises InputError when there is none, or it is malformed."""
    remedy = "calibrate the probe and name the file in the tray"
    return parse_probe(_attachment(log, "probe.json", remedy), "probe.json")


def magnetometer_of(log: Log) -> MagnetometerCalibration | None:
    """The magnetometer's calibration in a log, None if there is none. Raises InputError when it is malformed."""
    data = log.attachments.get("magnetometer.json")
    return None if data is None else parse_magnetometer(data, f"{log.path}: magnetometer.json")


def damage(log: Log) -> list[str]:
    """What of the log is torn or cannot be decoded, in sentences."""
    said = [f"The log is torn ({log.torn}); what came before is used."] if log.torn else []
    if log.undecodable:
        said.append(f"{log.undecodable} messages could not be decoded and are left out.")
    return said


def _attachment(log: Log, name: str, remedy: str) -> bytes:
    if name not in log.attachments:
        raise InputError(f"{log.path}: carries no {name}; {remedy}")
    return log.attachments[name]
