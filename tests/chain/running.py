"""Runs our commands the way a user does."""

import subprocess
import sys
from pathlib import Path

BIN = Path(sys.executable).parent


def command(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands; the caller looks at exit code and output."""
    return subprocess.run([BIN / name, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def done(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run one of our commands that has to succeed."""
    outcome = command(name, *arguments)
    assert outcome.returncode == 0, f"{name} {arguments}: {outcome.stderr}"
    return outcome
