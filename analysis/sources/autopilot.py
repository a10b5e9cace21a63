"""Reads an autopilot's log with the reader for its format."""

from pathlib import Path
from typing import TYPE_CHECKING, assert_never

from flightpower.analysis.sources.recognize import Autopilot

if TYPE_CHECKING:
    from flightpower.analysis.sources.recording import AllChannels, FlightRecording


def read_autopilot_log(path: Path, autopilot: Autopilot) -> "FlightRecording":
    """Return the recording in a log. Raises InputError. Readers are imported here because they load NumPy."""
    match autopilot:
        case Autopilot.PX4:
            from flightpower.analysis.sources.px4 import read_px4

            return read_px4(path)
        case Autopilot.ARDUPILOT:
            from flightpower.analysis.sources.ardupilot import read_ardupilot

            return read_ardupilot(path)
        case Autopilot.PAPARAZZI:
            from flightpower.analysis.sources.paparazzi import read_paparazzi

            return read_paparazzi(path)
    assert_never(autopilot)


def all_channels(path: Path, autopilot: Autopilot) -> "AllChannels":
    """Return every number that a log has over time. Raises InputError if it cannot be read."""
    match autopilot:
        case Autopilot.PX4:
            from flightpower.analysis.sources import px4

            return px4.all_channels(path)
        case Autopilot.ARDUPILOT:
            from flightpower.analysis.sources import ardupilot_messages

            return ardupilot_messages.all_channels(path)
        case Autopilot.PAPARAZZI:
            from flightpower.analysis.sources import paparazzi

            return paparazzi.all_channels(path)
    assert_never(autopilot)
