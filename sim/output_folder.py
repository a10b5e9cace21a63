"""The folder of a simulated flight: which files it holds, and what must not be replaced there."""

import json
from importlib import resources
from pathlib import Path

from flight.complete_aircraft import CompleteAircraft
from flight.errors import InputError
from flight.output_file import check_writable
from flight.text_file import read_text

TRUTH, CURVE, TRAY, LOG = "truth.parquet", "truth_power_required.csv", "tray.toml", "log.mcap"
OUTPUT_FILES = (TRUTH, CURVE, TRAY, LOG)
PROBE = "probe.json"


def check_output(output: Path, replace: bool) -> None:
    """Raise InputError if writing would replace something else than an earlier simulation."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: not a folder; give another one")
    taken = [name for name in OUTPUT_FILES if (output / name).exists()]
    if taken and not replace:
        raise InputError(f"{output}: already contains {taken[0]}; give another folder, or --replace")
    if taken and not (output / TRUTH).exists():
        raise InputError(f"{output}: contains a log without {TRUTH}, so not a simulated flight; give another folder")
    check_writable(output / LOG)


def probe_text(probe: Path | None) -> str:
    """The probe calibration of a file; by default the shipped one, of the simulated probe in the simulated tunnel."""
    if probe is None:
        return (resources.files("sim") / "data" / PROBE).read_bytes().decode()
    if not probe.exists():
        raise InputError(f"{probe}: no such file; make a probe calibration with `calibrate probe`")
    text = read_text(probe)
    try:
        calibration = json.loads(text)
    except ValueError as error:
        raise InputError(f"{probe}: not a probe calibration ({error})") from None
    if not isinstance(calibration, dict):
        raise InputError(f"{probe}: not a probe calibration (not a JSON object)")
    return text


def check_probe(output: Path, calibration: str, probe: Path | None) -> None:
    """Raise InputError if the flight would replace a probe calibration in its folder."""
    there = output / PROBE
    if not there.exists() or (probe is not None and there.samefile(probe)):
        return
    if there.read_bytes() != calibration.encode():
        raise InputError(f"{there}: is another calibration; give it with --probe, or give another folder")


def tray_text(output: Path, name: str, craft: CompleteAircraft) -> str:
    """The daemon's example tray, changed for this flight. Files it needs are copied, so the directory can be moved."""
    text = resources.files("daq").joinpath("tray.example.toml").read_text("utf-8")
    if Path(name).is_file():
        (output / "aircraft.toml").write_text(craft.text, "utf-8")
        name = "aircraft.toml"
    lines = []
    for line in text.splitlines():
        key = line.lstrip("# ").split("=")[0].strip()
        if key == "aircraft":
            line = f'aircraft = "{name}"'
        elif key == "directory":
            line = 'directory = "."'
        elif key == "probe_calibration":
            line = f'probe_calibration = "{PROBE}"'
        lines.append(line)
    return "\n".join(lines) + "\n"
