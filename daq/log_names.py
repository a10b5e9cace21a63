"""Names of logs: log-NNNN.mcap, and also the start by satellite time as soon as it is known.

log-0007.mcap becomes log-0007_2026-11-22_143002Z.mcap. The number alone gives the order and is never used twice.
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from flightpower.daq.disk_writer import CARD_FAULTS
from flightpower.flight.errors import InputError

NAME = re.compile(r"log-(\d+)(_[^/]*)?\.mcap")


def log_number(path: Path) -> int:
    """The number in log-NNNN.mcap or log-NNNN_START.mcap; -1 for any other name."""
    match = NAME.fullmatch(path.name)
    return int(match[1]) if match else -1


def numbered_logs(directory: Path) -> list[Path]:
    """The logs of a directory with a number in their name, in order."""
    return sorted((path for path in directory.glob("log-*.mcap") if log_number(path) >= 0), key=log_number)


def all_logs(directory: Path) -> list[Path]:
    """The MCAP files of a directory: first files with other names, by name, then the numbered logs in order."""
    files = (path for path in directory.glob("*.mcap") if not path.name.startswith("."))
    return sorted(files, key=lambda path: (log_number(path), path.name))


def numbered_names(directory: Path) -> Callable[[int], Path]:
    """Names log-NNNN.mcap after the highest number in use. Raises InputError if the directory is unusable.

    A card that fails or is read-only raises nothing, because it may work later; creating the file will show it.
    """
    taken: list[int] = []
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # Names such as log-0007.mcap.part also count, because somebody is copying or renaming that log.
        taken = [log_number(Path(path.name.partition(".mcap")[0] + ".mcap")) for path in directory.glob("log-*.mcap*")]
    except OSError as error:
        if error.errno not in CARD_FAULTS:
            raise InputError(f"{directory}: cannot be used for logs ({error.strerror or error})") from None
    first = max(taken, default=0) + 1
    return lambda number: directory / f"log-{max(first, 1) + number:04d}.mcap"


def part_names(path: Path) -> Callable[[int], Path]:
    """Names for a recording whose first file is given: log.mcap, log-part2.mcap, …"""
    return lambda number: path if number == 0 else path.with_name(f"{path.stem}-part{number + 1}{path.suffix}")


def name_with_start(path: Path, start_unix_ns: int) -> Path:
    """The name of a numbered log whose first tick was at this time; any other name is returned unchanged."""
    if log_number(path) < 0:
        return path
    start = datetime.fromtimestamp(round(start_unix_ns / 1e9), UTC)
    return path.with_name(f"{path.stem.partition('_')[0]}_{start:%Y-%m-%d_%H%M%SZ}{path.suffix}")
