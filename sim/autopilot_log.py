"""Writes a simulated flight as PX4 or ArduPilot logs it."""

from pathlib import Path

from flightpower.flight.errors import InputError
from flightpower.sim.ardupilot_log import write_ardupilot_log
from flightpower.sim.fly import Flight
from flightpower.sim.log_faults import FAULTS
from flightpower.sim.output_folder import AUTOPILOT_LOGS
from flightpower.sim.px4_log import write_px4_log
from flightpower.sim.sensors import FlightSensorTruth
from flightpower.sim.sensors.budget import DrawnErrors


def faults_of(recorder: str | None, text: str) -> list[str]:
    """The faults that --log-faults names. Raises InputError for a fault that is unknown, or does not apply."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if recorder is not None and recorder not in AUTOPILOT_LOGS:
        raise InputError(f"--as {recorder}: not known; give {' or '.join(AUTOPILOT_LOGS)}")
    if names and recorder is None:
        raise InputError("--log-faults: needs --as px4 or --as ardupilot")
    unknown = [name for name in names if name not in FAULTS]
    if unknown:
        raise InputError(f"--log-faults {', '.join(unknown)}: not known; known: {', '.join(FAULTS)}")
    return names


def write_autopilot_log(
    output: Path,
    recorder: str,
    flight: Flight,
    sensor_truth: FlightSensorTruth,
    errors: DrawnErrors,
    *,
    faults: list[str],
) -> Path:
    """Write the log and return its path. recorder: of AUTOPILOT_LOGS."""
    path = output / AUTOPILOT_LOGS[recorder]
    write = write_px4_log if recorder == "px4" else write_ardupilot_log
    write(path, flight, sensor_truth, errors, faults)
    return path
