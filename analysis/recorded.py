"""What travels in a log beside the measurements, and what of the measurements was lost."""

import pandas as pd

from analysis.airdata.magnetometer import MagnetometerCalibration, parse_magnetometer
from analysis.airdata.probe import ProbeCalibration, parse_probe
from analysis.channels import COLUMNS
from flight.aircraft import Aircraft, parse_aircraft
from flight.errors import InputError
from flight.log_reader import Log
from flight.propeller import Propeller
from flight.propeller_files import parse_propeller

LARGEST_UNMENTIONED_LOSS = 0.02
OPTIONAL = ("/battery", "/mag")  # a tray without them lacks nothing


def aircraft_of(log: Log) -> Aircraft:
    """The aircraft file in a log. Raises InputError when there is none, or it is malformed."""
    text = _attachment(log, "aircraft.toml", "give one with --aircraft FILE")
    return parse_aircraft(text.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")


def propeller_of(log: Log, aircraft: Aircraft) -> Propeller:
    """The propeller's table in a log. Raises InputError when there is none, or it is malformed."""
    table = _attachment(log, "propeller.csv", "the tray's aircraft file names the propeller that goes into logs")
    return parse_propeller(table.decode("utf-8", errors="replace"), aircraft.propulsion.propeller)


def probe_of(log: Log) -> ProbeCalibration:
    """The probe's calibration in a log. Raises InputError when there is none, or it is malformed."""
    remedy = "calibrate the probe and name the file in the tray"
    return parse_probe(_attachment(log, "probe.json", remedy), "probe.json")


def magnetometer_of(log: Log) -> MagnetometerCalibration | None:
    """The magnetometer's calibration in a log, None if there is none. Raises InputError when it is malformed."""
    data = log.attachments.get("magnetometer.json")
    return None if data is None else parse_magnetometer(data, f"{log.path}: magnetometer.json")


def state_of(log: Log) -> list[str]:
    """What a reader should know of the log as a file."""
    said = [f"The log is torn ({log.torn}); what came before is used."] if log.torn else []
    if log.undecodable:
        said.append(f"{log.undecodable} messages could not be decoded and are left out.")
    return said


def silent_topics(table: pd.DataFrame) -> list[str]:
    """What was lost in flight: each topic that carried none of its values for more than a moment."""
    lost = table.loc[table["flying"], list(COLUMNS)].isna()
    columns: dict[str, list[str]] = {}
    for name, (topic, _) in COLUMNS.items():
        if topic not in OPTIONAL:
            columns.setdefault(topic, []).append(name)
    by_topic = {topic: float(lost[names].all(axis=1).mean()) for topic, names in columns.items()}
    return [
        f"{topic} carried no value for {100 * share:.0f} % of the flight."
        for topic, share in by_topic.items()
        if share > LARGEST_UNMENTIONED_LOSS
    ]


def _attachment(log: Log, name: str, remedy: str) -> bytes:
    if name not in log.attachments:
        raise InputError(f"{log.path}: carries no {name}; {remedy}")
    return log.attachments[name]
