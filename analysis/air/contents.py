"""The attachments of a log: aircraft file, propeller table, calibrations, zeros."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePath
from types import MappingProxyType
from typing import NamedTuple

from flightpower.analysis.air.airspeed_scale import AirspeedScale
from flightpower.analysis.air.flight_data import Calibrations
from flightpower.analysis.air.magnetometer import MAGNETOMETER_FILE, MagnetometerCalibration
from flightpower.analysis.air.probe import PROBE_FILE, ProbeCalibration
from flightpower.analysis.air.thrust_stand import ThrustStand
from flightpower.analysis.air.transducers import TRANSDUCERS_FILE, TransducerCalibration
from flightpower.analysis.sources.rest import ZERO_FILE
from flightpower.flight.aircraft import Aircraft, parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller, parse_propeller
from flightpower.flight.propeller_search import with_table_error

# For each attachment that an analysis needs, the option that can replace it.
REMEDIES = {
    "aircraft.toml": "--aircraft FILE (`flightpower new aircraft` writes a template)",
    "propeller.csv": '--propeller NAME or FILE (or [propulsion] propeller = "apc-12x8e" in the aircraft file)',
    "probe.json": "--probe FILE (`calibrate probe` writes it)",
}


class LogContents(NamedTuple):
    """What an analysis uses from a log in addition to the measurements.

    zero : by channel, the reading in still air that `daq zero` took; None if the log has none
    notes : damage to the log, in sentences
    """

    aircraft: Aircraft
    propeller: Propeller
    probe: ProbeCalibration
    magnetometer: MagnetometerCalibration | None
    zero: dict[str, float] | None
    notes: list[str]
    transducers: TransducerCalibration | None = None
    thrust_stand: ThrustStand | None = None
    airspeed: AirspeedScale | None = None

    @property
    def calibrations(self) -> Calibrations:
        return Calibrations(self.probe, self.magnetometer, self.zero, self.transducers, self.airspeed)


class Replacements(NamedTuple):
    """Replacements for contents of the log; None where the log's own are used.

    weight_N : of the aircraft     zero : by channel
    files : by the attachment that is replaced, the file that was read, or the name of a shipped propeller
    """

    aircraft: Aircraft | None = None
    propeller: Propeller | None = None
    probe: ProbeCalibration | None = None
    magnetometer: MagnetometerCalibration | None = None
    zero: dict[str, float] | None = None
    weight_N: float | None = None
    transducers: TransducerCalibration | None = None
    thrust_stand: ThrustStand | None = None
    airspeed: AirspeedScale | None = None
    files: Mapping[str, str] = MappingProxyType({})


def contents(log: Log, replacements: Replacements = Replacements()) -> LogContents:
    """The contents of a log; `replacements` are used instead of its own.

    Raises InputError if attachments are missing and not replaced, naming all of them, or if one is malformed.
    """
    recorded = _recorded_aircraft(log, needed=replacements.aircraft is None)
    aircraft = replacements.aircraft or recorded
    missing = _what_is_missing(
        log, replacements, [aircraft_file for aircraft_file in (aircraft, recorded) if aircraft_file]
    )
    if missing or aircraft is None:
        raise _not_in_log(log, missing)
    aircraft = with_installation_of(log, aircraft)
    notes = damage(log)
    if replacements.airspeed is not None:
        where = replacements.files.get("airspeed.json", "--airspeed")
        replacements.airspeed.check_other_flight(log.path, where)
        notes += replacements.airspeed.notes_on_aircraft(aircraft, where)
    if replacements.weight_N is not None:
        aircraft = aircraft.weighing(replacements.weight_N)
    propeller = replacements.propeller or _propeller(log, aircraft, recorded)
    if replacements.thrust_stand is not None:
        replacements.thrust_stand.check_table(propeller, replacements.files.get("thrust_stand.json", "--thrust-stand"))
        aircraft = replacements.thrust_stand.applied_to(aircraft)
    elif replacements.propeller and (note := _of_another_table(aircraft, replacements.propeller)):
        aircraft = replace(aircraft, propulsion=replace(aircraft.propulsion, static_thrust_ratio=None))
        notes.append(note)
    propeller = propeller.with_beyond_zero_thrust(aircraft.propulsion.beyond_zero_thrust)
    uncertainty, of_table = with_table_error(aircraft.uncertainty, aircraft.keys, propeller)
    aircraft = replace(aircraft, uncertainty=uncertainty)
    notes += [of_table] if of_table else []
    zero = ZERO_FILE.parsed_if_any(log.attachments.get("zero.json"), f"{log.path}: zero.json")
    return LogContents(
        aircraft,
        propeller,
        replacements.probe or PROBE_FILE.parsed(log.attachments["probe.json"], "probe.json"),
        replacements.magnetometer
        or MAGNETOMETER_FILE.parsed_if_any(log.attachments.get("magnetometer.json"), f"{log.path}: magnetometer.json"),
        replacements.zero or (zero.by_channel() if zero else None),
        notes,
        replacements.transducers
        or TRANSDUCERS_FILE.parsed_if_any(log.attachments.get("transducers.json"), f"{log.path}: transducers.json"),
        replacements.thrust_stand,
        replacements.airspeed,
    )


def aircraft_of(log: Log) -> Aircraft:
    """The aircraft file in a log. Raises InputError when there is none, or it is malformed."""
    recorded = _recorded_aircraft(log, needed=True)
    if recorded is None:
        raise _not_in_log(log, ["aircraft.toml"])
    return recorded


def _recorded_aircraft(log: Log, *, needed: bool) -> Aircraft | None:
    """The log's own aircraft file; None where there is none. Raises InputError when it is needed and malformed."""
    data = log.attachments.get("aircraft.toml")
    if data is None:
        return None
    try:
        return parse_aircraft(data.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")
    except InputError:
        if needed:
            raise
        return None


def propeller_of(log: Log, aircraft: Aircraft) -> Propeller:
    """The propeller named in the aircraft file, otherwise the log's propeller.

    The table in the log belongs to the propeller that the log's own aircraft file names. Raises InputError when there
    is no table, or it is malformed.
    """
    return _propeller(log, aircraft, _recorded_aircraft(log, needed=False))


def _propeller(log: Log, aircraft: Aircraft, recorded: Aircraft | None) -> Propeller:
    in_log = recorded.propulsion.propeller if recorded else None
    name = aircraft.propulsion.propeller
    table = log.attachments.get("propeller.csv")
    if table is not None and name in (None, in_log):
        try:
            return parse_propeller(table.decode("utf-8", errors="replace"), in_log or "propeller.csv")
        except InputError as error:
            raise InputError(f"{log.path}: its propeller.csv is damaged; give --propeller ({error})") from None
    name = name or in_log
    if name is not None:
        return load_propeller(name)
    raise _not_in_log(log, ["propeller.csv"])


def with_installation_of(log: Log, aircraft: Aircraft) -> Aircraft:
    """The aircraft with the [installation] name of the log's tray file, where its own file has none."""
    if aircraft.installation.name:
        return aircraft
    try:
        tray = tomllib.loads(log.attachments.get("tray.toml", b"").decode("utf-8", errors="replace"))
    except tomllib.TOMLDecodeError:
        return aircraft
    section = tray.get("installation")
    name = section.get("name") if isinstance(section, dict) else None
    if not isinstance(name, str):
        return aircraft
    return replace(aircraft, installation=replace(aircraft.installation, name=name))


def _of_another_table(aircraft: Aircraft, propeller: Propeller) -> str:
    """A sentence if the aircraft file's static thrust ratio belongs to another propeller's table; else empty."""
    named = aircraft.propulsion.propeller
    if aircraft.propulsion.static_thrust_ratio is None or named is None:
        return ""
    if propeller.name in (named, PurePath(named).stem):
        return ""
    return (
        f"propulsion.static_thrust_ratio of the aircraft file belongs to the propeller {named} and is not used with"
        f" {propeller.name}: give --thrust-stand with a result of `calibrate thrust` for this table."
    )


def damage(log: Log) -> list[str]:
    """Sentences on parts of the log that are truncated or cannot be decoded."""
    notes = [f"The log is {log.incomplete}."] if log.torn else []
    for topic, undecodable in sorted(log.undecodable_of.items()):
        left_out = "1 message is" if undecodable.count == 1 else f"{undecodable.count} messages are"
        notes.append(f"{left_out} left out: {topic}: {undecodable.mistake}.")
    return notes


def _what_is_missing(log: Log, replacements: Replacements, aircraft: list[Aircraft]) -> list[str]:
    """Attachments that are needed, but neither in the log nor replaced. aircraft: the one used, and the log's own."""
    propeller_named = any(aircraft_file.propulsion.propeller for aircraft_file in aircraft)
    present = {
        "aircraft.toml": bool(aircraft),
        "propeller.csv": replacements.propeller is not None or propeller_named,
        "probe.json": replacements.probe is not None,
    }
    return [name for name in REMEDIES if not present[name] and name not in log.attachments]


def _not_in_log(log: Log, names: list[str]) -> InputError:
    similar = [f"{match} is not {name}" for name in names if (match := _other_case(log, name))]
    if similar:
        return InputError(f"{log.path}: the attachment {', '.join(similar)}: rename it")
    return InputError(
        f"{log.path}: no {', '.join(names)} in the log; attach {'it' if len(names) == 1 else 'them'} to the log (the"
        f" daemon attaches what the tray file names), or give {', '.join(REMEDIES[name] for name in names)}"
    )


def _other_case(log: Log, name: str) -> str | None:
    """The attachment whose name differs from this one only in upper or lower case, or by a path before it."""
    return next((attachment for attachment in log.attachments if PurePath(attachment).name.lower() == name), None)
