"""The files attached to a log, so that `analyze log.mcap` needs nothing else."""

from pathlib import Path
from typing import NamedTuple

from flightpower.daq.config import Tray
from flightpower.daq.still_air_zero import parse_zero
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.files import json_object_text, read_text
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.shipped_propellers import FOLDER, shipped_propellers
from flightpower.flight.version import version


class Attachments(NamedTuple):
    """The texts of the attached files, unchanged; None for a file that the tray does not name."""

    tray: str
    aircraft: Aircraft | None
    propeller: str | None
    probe: str | None
    magnetometer: str | None
    transducers: str | None
    zero: str | None


def load_attachments(tray: Tray) -> Attachments:
    """Read the files that the tray names. Raises InputError naming a file that is missing or malformed."""
    aircraft = load_aircraft(tray.aircraft) if tray.aircraft else None
    name = aircraft.propulsion.propeller if aircraft else None
    propeller = None if name is None else propeller_text(name)
    probe = calibration_text(tray.probe_calibration, "probe")
    magnetometer = calibration_text(tray.magnetometer_calibration, "magnetometer")
    transducers = calibration_text(tray.transducer_calibration, "transducer")
    return Attachments(tray.text, aircraft, propeller, probe, magnetometer, transducers, zero_text(tray.zero))


def write_attachments(
    log: LogWriter,
    attachments: Attachments,
    *,
    rate_Hz: float,
    start_unix_ns: int,
    start_monotonic_ns: int,
    part: int = 1,
    previous_log: str = "",
) -> None:
    """Write all attachments and the metadata `flightpower` into a new log.

    part: number of the log within its recording, from 1. previous_log: file name of the part before it.
    """
    for name, text, media_type in (
        ("tray.toml", attachments.tray, "application/toml"),
        ("aircraft.toml", attachments.aircraft.text if attachments.aircraft else None, "application/toml"),
        ("propeller.csv", attachments.propeller, "text/csv"),
        ("probe.json", attachments.probe, "application/json"),
        ("magnetometer.json", attachments.magnetometer, "application/json"),
        ("transducers.json", attachments.transducers, "application/json"),
        ("zero.json", attachments.zero, "application/json"),
    ):
        if text is not None:
            log.attach(name, text.encode(), media_type, start_unix_ns)
    facts = {
        "version": version(),
        "tick_rate_Hz": f"{rate_Hz:g}",
        "start_unix_ns": str(start_unix_ns),
        "start_monotonic_ns": str(start_monotonic_ns),
        "aircraft": attachments.aircraft.name if attachments.aircraft else "",
        "part": str(part),
        "previous_log": previous_log,
    }
    log.add_metadata("flightpower", facts)


def propeller_text(name_or_path: str) -> str:
    """The text of a propeller file, shipped or at a path, looked up as in `flight.propeller_files`, without NumPy."""
    if name_or_path in shipped_propellers():
        return FOLDER.joinpath(f"{name_or_path}.csv").read_text("utf-8")
    if not Path(name_or_path).is_file():
        raise InputError(f"propeller {name_or_path}: neither a shipped table nor a file")
    return read_text(Path(name_or_path))


def calibration_text(path: str | None, kind: str) -> str | None:
    """The calibration file of probe, magnetometer or transducers. The only check is that it is a JSON object."""
    if path is None:
        return None
    return json_object_text(Path(path), f"a {kind} calibration")


def zero_text(path: str) -> str | None:
    """The text of the still-air zero next to the tray file; None if no zero was taken."""
    if not Path(path).exists():
        return None
    text = read_text(Path(path))
    parse_zero(text, path)
    return text
