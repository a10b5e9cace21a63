"""A stand-in for the analysis of a log, which takes no time. Other processes import it, and nothing else with it."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from flightpower.analysis.flights.campaign.processes import below
from flightpower.flight.errors import InputError, StorageError

SLOW_S = 300.0  # for a log with the word `slow`: longer than a busy machine needs for all that a test waits for


@dataclass(frozen=True)
class Stub:
    """Writes the log's words into results.json; some words cause a failure or a wait. Each call adds a line to
    `calls`."""

    calls: Path
    aircraft: Path | None = None

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress) -> None:
        with self.calls.open("a") as stream:
            stream.write(f"{log.name}\n")
        words = log.read_text().split()
        progress("reading")
        (folder / "path.csv").write_text("written first")
        if "wrong" in words:
            raise InputError(f"{log}: wrong words")
        if "full" in words:
            raise StorageError(f"{folder / 'report.html'}: cannot be written (No space left on device)")
        if "broken" in words:
            raise ZeroDivisionError("two\nlines")
        if "killed" in words:
            os.kill(os.getpid(), signal.SIGKILL)
        if "large" in words:
            bytearray(2**34)
        if "slow" in words:
            time.sleep(SLOW_S)
        run_list = runs.read_text() if runs else ""
        aircraft = self.aircraft.read_text() if self.aircraft else ""
        (folder / "results.json").write_text(f"{log} {words} {run_list} {aircraft}")
        (folder / "runs.toml").write_text(run_list or "found")

    def under(self, root: Path) -> "Stub":
        return Stub(self.calls, self.aircraft and below(root, self.aircraft))
