"""Runs our commands the way a user does."""

import io
import subprocess
import sys
from pathlib import Path

from flight.log_reader import read_log
from flight.log_writer import LogWriter

BIN = Path(sys.executable).parent
WITHOUT_POSIX = Path(__file__).with_name("without_posix.py")


def command(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands; the caller looks at exit code and output."""
    return subprocess.run([BIN / name, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def done(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands that has to succeed."""
    outcome = command(name, *arguments)
    assert outcome.returncode == 0, f"{name} {arguments}: {outcome.stderr}"
    return outcome


def command_without_posix(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands as on a computer without POSIX."""
    line = [sys.executable, "-X", "warn_default_encoding", WITHOUT_POSIX, name, *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=120)


def done_without_posix(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """The same for a command that has to succeed."""
    outcome = command_without_posix(name, *arguments)
    assert outcome.returncode == 0, f"{name} {arguments}: {outcome.stderr}"
    return outcome


def rewritten(
    flown: Path,
    path: Path,
    *,
    without_topic: str = "",
    without_attachment: str = "",
    attached: dict[str, bytes] | None = None,
) -> None:
    """The same log with something left out, or something more attached."""
    log, out = read_log(flown / "log.mcap"), io.BytesIO()
    writer = LogWriter(out)
    for name, data in (log.attachments | (attached or {})).items():
        if name != without_attachment:
            writer.attach(name, data, "text/plain", 0)
    for name, values in log.metadata.items():
        writer.add_metadata(name, values)
    for topic, entries in log.entries.items():
        for entry in entries if topic != without_topic else ():
            writer.write(topic, entry.message, time_ns=entry.time_ns, tick=entry.tick)
    writer.finish()
    path.write_bytes(out.getvalue())
