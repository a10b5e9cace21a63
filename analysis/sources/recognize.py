"""Recognizes from a log's format which autopilot wrote it."""

from enum import StrEnum
from pathlib import Path

from flightpower.flight.formats import Format, format_of


class Autopilot(StrEnum):
    """The autopilot that wrote a log."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"
    PAPARAZZI = "Paparazzi"


WRITTEN_BY = {
    Format.ULOG: Autopilot.PX4,
    Format.DATAFLASH: Autopilot.ARDUPILOT,
    Format.DATAFLASH_TEXT: Autopilot.ARDUPILOT,
    Format.TELEMETRY: Autopilot.ARDUPILOT,
    Format.PAPARAZZI: Autopilot.PAPARAZZI,
}


def autopilot_of(path: Path) -> Autopilot | None:
    """Return the autopilot that wrote a log; None if no autopilot did. Raises InputError if the file cannot be read."""
    log_format = format_of(path)
    if log_format is Format.MAT:
        from flightpower.analysis.sources.matlab_log import is_matlab_log  # loads NumPy

        return Autopilot.ARDUPILOT if is_matlab_log(path) else None
    return WRITTEN_BY.get(log_format)
