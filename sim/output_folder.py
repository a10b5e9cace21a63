"""Writes the folder of a simulated flight, and protects the files that must not be replaced there."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from flightpower.flight.aircraft import aircraft_text
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_writable, json_object_text, write_error

if TYPE_CHECKING:
    from flightpower.sim.fly import Flight
    from flightpower.sim.sensors.budget import DrawnErrors
    from flightpower.sim.world import World

TRUTH, CURVE, TRAY, LOG = "truth.parquet", "truth_power_required.csv", "tray.toml", "log.mcap"
AUTOPILOT_LOGS = {"px4": "log.ulg", "ardupilot": "log.BIN", "ardupilot-telemetry": "log.tlog"}  # names by --as
OUTPUT_FILES = (TRUTH, CURVE, TRAY, LOG, *AUTOPILOT_LOGS.values())
UNFINISHED = ".unfinished"  # exists while files are being written
AIRCRAFT, PROPELLER, PROBE = "aircraft.toml", "propeller.csv", "probe.json"


def check_output(output: Path, replace: bool) -> None:
    """Raise InputError if writing would replace anything but an earlier simulation, complete or interrupted."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: not a folder; give another one")
    cut_short = (output / UNFINISHED).exists()  # True after a simulation that was killed
    taken = [name for name in OUTPUT_FILES if (output / name).exists()]
    if taken and not replace:
        state = " of a simulation that was cut short" if cut_short else ""
        raise InputError(f"{output}: already contains {taken[0]}{state}; give another folder, or --replace")
    if taken and not cut_short and not (output / TRUTH).exists():
        raise InputError(f"{output}: contains a log without {TRUTH}, so not a simulated flight; give another folder")
    check_writable(output / LOG)


@contextmanager
def whole_or_nothing(output: Path) -> Iterator[None]:
    """A context for writing into the folder: if writing fails or is interrupted, nothing is left over.

    Raises StorageError when the disk is full or fails, InputError when the folder cannot be written.
    """
    new_folder, others = not output.exists(), (AIRCRAFT, PROPELLER, PROBE)
    existing = [name for name in others if (output / name).exists()]
    mark = output / UNFINISHED
    try:
        output.mkdir(parents=True, exist_ok=True)
        mark.touch()
        yield
        mark.unlink()
    except BaseException as error:
        with suppress(OSError):
            for name in (*OUTPUT_FILES, *(name for name in others if name not in existing), UNFINISHED):
                (output / name).unlink(missing_ok=True)
            if new_folder:
                output.rmdir()
        if isinstance(error, OSError):
            raise write_error(output, error) from None
        raise


def probe_text(probe: Path | None) -> str:
    """The text of a probe calibration; by default the shipped one, of the simulated probe in the simulated tunnel."""
    if probe is None:
        return (resources.files("flightpower.sim") / "data" / PROBE).read_bytes().decode()
    if not probe.exists():
        raise InputError(f"{probe}: no such file; make a probe calibration with `calibrate probe`")
    return json_object_text(probe, "a probe calibration")


def check_probe(output: Path, calibration: str, probe: Path | None) -> None:
    """Raise InputError if the flight would replace a probe calibration in its folder."""
    path = output / PROBE
    if not path.exists() or (probe is not None and path.samefile(probe)):
        return
    if path.read_bytes() != calibration.encode():
        raise InputError(f"{path}: is another calibration; give it with --probe, or give another folder")


def write_flight(
    output: Path, flight: "Flight", errors: "DrawnErrors", world: "World", *, aircraft: str, calibration: str
) -> None:
    """Write all files except the log. Raises OSError if a file cannot be written.

    aircraft: name or file     calibration: of the probe
    """
    from flightpower.sim.truth import write_truth

    for name in OUTPUT_FILES:
        (output / name).unlink(missing_ok=True)
    metadata = {**flight.metadata, "world": world.name, "errors": errors.as_dict()}
    write_truth(output / TRUTH, flight.truth, metadata, flight.power_required)
    flight.power_required.to_csv(output / CURVE, index=False)
    (output / TRAY).write_text(_tray_text(_aircraft(output, flight, world, aircraft)), "utf-8")
    (output / PROBE).write_bytes(calibration.encode())


def _aircraft(output: Path, flight: "Flight", world: "World", name: str) -> str:
    """The tray's name for the aircraft. Writes the aircraft file and the propeller table if they are not shipped."""
    text = world.aircraft_text(flight.aircraft.text)
    table = world.table(flight.aircraft.propulsion)
    if table is not None:
        (output / PROPELLER).write_text(table.to_csv(), "utf-8")
        named = f'propeller = "{flight.aircraft.propulsion.propeller}"'
        text = text.replace(named, f'propeller = "{(output / PROPELLER).resolve()}"')
    if not Path(name).is_file() and text == aircraft_text(name)[0]:
        return name
    (output / AIRCRAFT).write_text(text, "utf-8")
    return AIRCRAFT


def _tray_text(aircraft: str) -> str:
    """The daemon's example tray, changed for this flight. It names copies of files, so the folder can be moved."""
    text = resources.files("flightpower.daq").joinpath("tray.example.toml").read_text("utf-8")
    lines = []
    for line in text.splitlines():
        key = line.lstrip("# ").split("=")[0].strip()
        if key == "aircraft":
            line = f'aircraft = "{aircraft}"'
        elif key == "directory":
            line = 'directory = "."'
        elif key == "probe_calibration":
            line = f'probe_calibration = "{PROBE}"'
        lines.append(line)
    return "\n".join(lines) + "\n"
