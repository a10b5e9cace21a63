"""The attachments of a log: aircraft file, propeller table, calibrations, zeros."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from analysis.airdata.magnetometer import MagnetometerCalibration, parse_magnetometer
from analysis.airdata.probe import ProbeCalibration, parse_probe
from analysis.airdata.transducers import TransducerCalibration, parse_transducers
from analysis.signals.rest import zero_of_attachment
from flight.aircraft import Aircraft, Installation, parse_aircraft
from flight.errors import InputError
from flight.log_reader import Log
from flight.propeller import Propeller
from flight.propeller_files import load_propeller, parse_propeller

# By attachment that an analysis needs, the option instead.
REMEDIES = {
    "aircraft.toml": "--aircraft FILE (`flightpower new aircraft` writes a template)",
    "propeller.csv": '--propeller NAME or FILE (or [propulsion] propeller = "apc-12x8e" in the aircraft file)',
    "probe.json": "--probe FILE (`calibrate probe` writes it)",
}


class LogContents(NamedTuple):
    """What an analysis takes from a log beside its measurements.

    zero : by channel, the reading in still air that `daq zero` took; None if the log has none
    notes : damage of the log, in sentences
    """

    aircraft: Aircraft
    propeller: Propeller
    probe: ProbeCalibration
    magnetometer: MagnetometerCalibration | None
    zero: dict[str, float] | None
    notes: list[str]
    transducers: TransducerCalibration | None = None


class Replacements(NamedTuple):
    """Used instead of the contents of the log where not None.

    weight_N : of the aircraft     zero : by channel
    files : where these were read from, or the name of a shipped propeller, by the attachment that each replaces
    """

    aircraft: Aircraft | None = None
    propeller: Propeller | None = None
    probe: ProbeCalibration | None = None
    magnetometer: MagnetometerCalibration | None = None
    zero: dict[str, float] | None = None
    weight_N: float | None = None
    transducers: TransducerCalibration | None = None
    files: Mapping[str, str] = MappingProxyType({})


def contents(log: Log, replacements: Replacements = Replacements()) -> LogContents:
    """The contents of a log; `replacements` are used instead of its own.

    Raises InputError if attachments are missing and no argument replaces them, naming all of them, or one is malformed.
    """
    if lacking := _lacking(log, replacements):
        raise _not_in_log(log, lacking)
    aircraft = replacements.aircraft or aircraft_of(log)
    propeller = replacements.propeller or propeller_of(log, aircraft)
    if replacements.weight_N is not None:
        aircraft = aircraft.weighing(replacements.weight_N)
    if not aircraft.installation.name:
        aircraft = replace(aircraft, installation=Installation(name=_installation_of_tray(log)))
    return LogContents(
        aircraft,
        propeller.with_beyond_zero_thrust(aircraft.propulsion.beyond_zero_thrust),
        replacements.probe or probe_of(log),
        replacements.magnetometer or magnetometer_of(log),
        replacements.zero or zero_of_attachment(log.attachments.get("zero.json"), f"{log.path}: zero.json"),
        damage(log),
        replacements.transducers or transducers_of(log),
    )


def aircraft_of(log: Log) -> Aircraft:
    """The aircraft file in a log. Raises InputError when there is none, or it is malformed."""
    text = _attachment(log, "aircraft.toml").decode("utf-8", errors="replace")
    return parse_aircraft(text, f"{log.path}: aircraft.toml")


def propeller_of(log: Log, aircraft: Aircraft) -> Propeller:
    """The propeller that an aircraft file names, else that of the log.

    The log's table is that of the propeller its own aircraft file names. Raises InputError when there is none, or it is
    malformed.
    """
    recorded = _recorded_propeller(log)
    name = aircraft.propulsion.propeller
    table = log.attachments.get("propeller.csv")
    if table is not None and name in (None, recorded):
        return parse_propeller(table.decode("utf-8", errors="replace"), recorded or "propeller.csv")
    name = name or recorded
    if name is not None:
        return load_propeller(name)
    raise _not_in_log(log, ["propeller.csv"])


def _recorded_propeller(log: Log) -> str | None:
    """The name in the log's own aircraft file; None where there is none, or it cannot be read."""
    try:
        return aircraft_of(log).propulsion.propeller
    except InputError:
        return None


def probe_of(log: Log) -> ProbeCalibration:
    """The probe's calibration in a log. Raises InputError when there is none, or it is malformed."""
    return parse_probe(_attachment(log, "probe.json"), "probe.json")


def magnetometer_of(log: Log) -> MagnetometerCalibration | None:
    """The magnetometer's calibration in a log, None if there is none. Raises InputError when it is malformed."""
    data = log.attachments.get("magnetometer.json")
    return None if data is None else parse_magnetometer(data, f"{log.path}: magnetometer.json")


def transducers_of(log: Log) -> TransducerCalibration | None:
    """The transducers' calibration in a log, None if there is none. Raises InputError when it is malformed."""
    data = log.attachments.get("transducers.json")
    return None if data is None else parse_transducers(data, f"{log.path}: transducers.json")


def _installation_of_tray(log: Log) -> str:
    """[installation] name of the tray file; empty where there is none."""
    try:
        tray = tomllib.loads(log.attachments.get("tray.toml", b"").decode("utf-8", errors="replace"))
    except tomllib.TOMLDecodeError:
        return ""
    section = tray.get("installation")
    name = section.get("name") if isinstance(section, dict) else None
    return name if isinstance(name, str) else ""


def damage(log: Log) -> list[str]:
    """Parts of the log that are torn or cannot be decoded, in sentences."""
    notes = [f"The log is torn ({log.torn}); the part before is used."] if log.torn else []
    if log.undecodable:
        notes.append(f"{log.undecodable} messages could not be decoded and are left out.")
    return notes


def _lacking(log: Log, replacements: Replacements) -> list[str]:
    """The attachments that are needed, but neither in the log nor replaced."""
    aircraft = replacements.aircraft or (aircraft_of(log) if "aircraft.toml" in log.attachments else None)
    propeller_named = (aircraft and aircraft.propulsion.propeller) or _recorded_propeller(log)
    given = {
        "aircraft.toml": aircraft is not None,
        "propeller.csv": replacements.propeller is not None or propeller_named is not None,
        "probe.json": replacements.probe is not None,
    }
    return [name for name in REMEDIES if not given[name] and name not in log.attachments]


def _not_in_log(log: Log, names: list[str]) -> InputError:
    return InputError(
        f"{log.path}: no {', '.join(names)} in the log; attach {'it' if len(names) == 1 else 'them'} to the log (the"
        f" daemon attaches what the tray file names), or give {', '.join(REMEDIES[name] for name in names)}"
    )


def _attachment(log: Log, name: str) -> bytes:
    if name not in log.attachments:
        raise _not_in_log(log, [name])
    return log.attachments[name]
