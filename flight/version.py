"""The version of this software, as stated in results and logs."""

from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UNKNOWN = "0+unknown"  # run from a folder, never installed
PATIENCE_S = 5.0


@cache
def version() -> str:
    """The installed version. In a checkout it includes the current commit, which may be later than the installation.

    "1.0.0" of a release, "1.0.1.dev3+g555c46e7a" of a commit, with ".dirty" at its end where files were changed.
    """
    from importlib import metadata  # takes 25 ms, spared to commands that state no version

    try:
        installed = metadata.version("flightpower")
    except metadata.PackageNotFoundError:
        installed = UNKNOWN
    if not (ROOT / ".git").exists():
        return installed
    commit = _commit(ROOT)
    return f"{installed.partition('+')[0]}+{commit}" if commit else installed


def _commit(checkout: Path) -> str:
    """The commit, written as in a version ("g555c46e7a.dirty"); empty if git does not know it."""
    import subprocess

    command = ["git", "-C", str(checkout), "describe", "--always", "--dirty=.dirty", "--abbrev=9", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=PATIENCE_S)
    except (OSError, subprocess.SubprocessError):
        return ""
    return f"g{done.stdout.strip()}" if done.returncode == 0 else ""
