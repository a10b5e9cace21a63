"""Runs our commands: installed, the way a user does, or in this process, which spares the import of the libraries."""

import io
import json
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.log_writer import LogWriter

BIN = Path(sys.executable).parent
UNSHOWN = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)  # hidden by an interpreter
WITHOUT_POSIX = Path(__file__).with_name("without_posix.py")


class Laptop(NamedTuple):
    """The outcomes of the laptop's commands without POSIX, by their first words, and the folder that they wrote."""

    folder: Path
    outcomes: dict[str, subprocess.CompletedProcess[str]]


def read_once(path: Path) -> Log:
    """The log that `read_log` reads, kept until the file changes."""
    return _read(path, path.stat().st_mtime_ns) if path.is_file() else read_log(path)


@lru_cache(maxsize=2)
def _read(path: Path, mtime_ns: int) -> Log:
    return read_log(path)


def installed(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands in its own process; the caller looks at exit code and output."""
    return subprocess.run([BIN / name, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def command(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs a command in this process: returns what `installed` would; an uncaught error is raised.

    `analyze` reads a log once, however often it is analyzed.
    """
    main = next(iter(entry_points(group="console_scripts", name=name))).load()
    line, out, err, code = [name, *map(str, arguments)], io.StringIO(), io.StringIO(), 0
    with (
        patch.object(sys, "argv", line),
        patch("flightpower.analysis.sources.open.read_log", read_once),
        redirect_stdout(out),
        redirect_stderr(err),
        warnings.catch_warnings(record=True) as warned,
    ):
        warnings.simplefilter("default")
        for category in UNSHOWN:
            warnings.simplefilter("ignore", category)
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    for w in warned:
        err.write(warnings.formatwarning(w.message, w.category, w.filename, w.lineno))
    return subprocess.CompletedProcess(line, code, out.getvalue(), err.getvalue())


def done(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands in this process; it has to succeed."""
    return succeeded(command(name, *arguments))


def succeeded(outcome: subprocess.CompletedProcess[str]) -> subprocess.CompletedProcess[str]:
    """The outcome of a command that has to succeed."""
    assert outcome.returncode == 0, f"{outcome.args}: {outcome.stderr}"
    return outcome


def commands_without_posix(*commands: list[str]) -> list[subprocess.CompletedProcess[str]]:
    """Run our commands one after another, in one process, as on a computer without POSIX."""
    line = [sys.executable, "-X", "warn_default_encoding", WITHOUT_POSIX]
    ran = subprocess.run(line, input=json.dumps(commands), capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    return [
        subprocess.CompletedProcess(command, code, out, err)
        for command, (code, out, err) in zip(commands, json.loads(ran.stdout), strict=True)
    ]


def rewritten(
    flown: Path,
    path: Path,
    *,
    without_topic: str = "",
    without_attachment: str = "",
    attached: dict[str, bytes] | None = None,
    ticks: int | None = None,
) -> None:
    """Write this log with something left out or attached, and only with its first `ticks` if given."""
    log, out = read_once(flown / "log.mcap"), io.BytesIO()
    writer = LogWriter(out)
    for name, data in (log.attachments | (attached or {})).items():
        if name != without_attachment:
            writer.attach(name, data, "text/plain", 0)
    for name, values in log.metadata.items():
        writer.add_metadata(name, values)
    for topic, entries in log.entries.items():
        for entry in entries if topic != without_topic else ():
            if ticks is not None and entry.tick >= ticks:
                break
            writer.write(topic, entry.message, time_ns=entry.time_ns, tick=entry.tick)
    writer.finish()
    path.write_bytes(out.getvalue())
